import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import ldls

TURN = Rotation.from_euler("xyz", [3.0, -2.0, 20.0], degrees=True)
TRANSLATION = [0.27, -0.06, 0.08]
POSE = np.eye(4)
POSE[:3, :3], POSE[:3, 3] = TURN.as_matrix(), TRANSLATION
WAYS = [
    pytest.param({"quaternion_xyzw": TURN.as_quat()}, id="x y z w"),
    pytest.param({"quaternion_wxyz": np.roll(TURN.as_quat(), 1)}, id="w x y z"),
    pytest.param({"roll_pitch_yaw_deg": [3.0, -2.0, 20.0]}, id="roll, pitch, yaw"),
    pytest.param({"rotation": TURN.as_matrix()}, id="matrix"),
]


@pytest.mark.parametrize("way", WAYS)
def test_a_rotation_may_be_said_in_four_ways(way):
    np.testing.assert_allclose(ldls.extrinsic(TRANSLATION, pose_of="lidar", **way), POSE, atol=1e-12)
    np.testing.assert_allclose(ldls.extrinsic(TRANSLATION, pose_of="camera", **way), np.linalg.inv(POSE), atol=1e-12)


def test_a_body_is_turned_to_the_optical_frame():
    ahead = ldls.extrinsic([0, 0, 0], pose_of="camera", quaternion_xyzw=[0, 0, 0, 1], optical=False)
    # x forward, y left, z up become z forward, -x, -y
    np.testing.assert_array_equal(ahead @ [7.0, 2, 1, 1], [-2, -1, 7, 1])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        pytest.param({}, "expected one of quaternion_wxyz, quaternion_xyzw, .*, got none", id="no rotation"),
        pytest.param(
            {"rotation": np.eye(3), "quaternion_wxyz": [1, 0, 0, 0]},
            "got quaternion_wxyz, rotation",
            id="two rotations",
        ),
        pytest.param(
            {"quaternion_xyzw": [0, 1, 0, 2]},
            r"_xyzw: quaternion \[0.0, 1.0, 0.0, 2.0\] .* \(x y z w\)",
            id="no unit, w last",
        ),
        pytest.param({"quaternion_wxyz": [1, 1, 0, 0]}, "quaternion_wxyz: .* length 1.41421, expected 1", id="no unit"),
        pytest.param({"rotation": np.diag([1.0, 1, -1])}, "rotation: the determinant is -1, a mirror", id="mirror"),
        pytest.param({"roll_pitch_yaw_deg": [1, 2]}, "roll_pitch_yaw_deg: expected shape", id="two angles"),
        pytest.param({"rotation": np.eye(3), "pose_of": "robot"}, "pose_of: got 'robot'", id="of what"),
    ],
)
def test_faults_are_named(arguments, message):
    with pytest.raises((ldls.CalibrationError, ldls.ParameterError), match=message):
        ldls.extrinsic([0, 0, 0], **{"pose_of": "camera", **arguments})
