import json

import numpy as np
import pytest

import ldls
from conftest import moved

RECORDS = ("calibrated_camera", "ego_pose_camera", "calibrated_lidar", "ego_pose_lidar")


def quaternion(rotation):
    """w x y z, by the eigenvector of Bar-Itzhack (2000), which shares nothing with the formula under test."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation
    matrix = [
        [xx - yy - zz, yx + xy, zx + xz, zy - yz],
        [yx + xy, yy - xx - zz, zy + yz, xz - zx],
        [zx + xz, zy + yz, zz - xx - yy, yx - xy],
        [zy - yz, xz - zx, yx - xy, xx + yy + zz],
    ]
    x, y, z, w = np.linalg.eigh(matrix)[1][:, -1]
    return [w, x, y, z]


def record(matrix, **more):
    matrix = np.asarray(matrix)
    return {"rotation": quaternion(matrix[:3, :3]), "translation": matrix[:3, 3].tolist(), **more}


def records(to_camera, lidar_to_ego, intrinsics, start, end):
    """Records of a car that stands at `start` for the sweep and at `end` for the image."""
    camera_to_ego = np.linalg.inv(end) @ start @ lidar_to_ego @ np.linalg.inv(to_camera)
    return {
        "calibrated_camera": record(camera_to_ego, camera_intrinsic=intrinsics),
        "ego_pose_camera": record(end),
        "calibrated_lidar": record(lidar_to_ego, camera_intrinsic=[]),
        "ego_pose_lidar": record(start),
    }


@pytest.fixture
def sample():
    to_camera = np.array([[0, -1, 0, 0.1], [0, 0, -1, -0.2], [1, 0, 0, -0.3], [0, 0, 0, 1]])
    return records(
        to_camera,
        moved(0.94, 0, 1.84, yaw=-1.57),
        [[1266.4, 0, 816.3], [0, 1266.4, 491.5], [0, 0, 1]],
        moved(411.3, 1180.9, yaw=-1.9),
        moved(411.4, 1181.2, yaw=-1.89),
    )


@pytest.mark.parametrize("name", ["CAM_FRONT", "CAM_FRONT_RIGHT", "CAM_FRONT_LEFT", "CAM_BACK", "CAM_BACK_LEFT"])
def test_the_cameras_of_a_real_frame(data_folder, name):
    frame = json.loads((data_folder / "nuscenes/frame.json").read_text())
    found = frame["cameras"][name]
    expected = np.array(found["lidar_to_camera"])
    made = records(
        expected,
        np.array(frame["lidar"]["lidar_to_ego"]),
        found["intrinsics"],
        moved(411, 1181, yaw=-1.9),
        moved(412, 1180, yaw=-1.88),
    )
    camera = ldls.Camera.from_nuscenes(*(made[key] for key in RECORDS), image_size=(900, 1600))
    np.testing.assert_allclose(camera.T_camera_lidar, expected, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(camera.projection[:, :3], found["intrinsics"])
    (path,) = (data_folder / "nuscenes").glob("*.pcd.bin")
    in_view, _ = ldls.stages.project(ldls.read_points(path), camera, image_size=camera.image_size)
    assert len(in_view) > 2000


def test_the_car_moves_between_sweep_and_image(sample):
    camera = ldls.Camera.from_nuscenes(**sample)
    still = ldls.Camera.from_nuscenes(**sample | {"ego_pose_camera": sample["ego_pose_lidar"]})
    np.testing.assert_allclose(camera.T_camera_lidar[:3, 3], [0.1, -0.2, -0.3], atol=1e-9)
    assert np.linalg.norm(camera.T_camera_lidar - still.T_camera_lidar) > 0.1


def test_a_quaternion_is_w_x_y_z():
    turn = {"rotation": [np.cos(0.5), 0, 0, np.sin(0.5)], "translation": [0, 0, 0]}
    still = {"rotation": [1, 0, 0, 0], "translation": [0, 0, 0]}
    camera = ldls.Camera.from_nuscenes(still | {"camera_intrinsic": np.eye(3).tolist()}, still, turn, still)
    np.testing.assert_allclose(camera.T_camera_lidar, moved(0, 0, yaw=1), atol=1e-15)


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        pytest.param("ego_pose_camera", {"rotation": None}, "ego_pose_camera: key 'rotation' missing", id="missing"),
        pytest.param(
            "calibrated_lidar", {"rotation": [1, 0, 0]}, r"calibrated_lidar: rotation: expected 4 numbers", id="three"
        ),
        pytest.param("ego_pose_lidar", {"rotation": [1, 1, 0, 0]}, "has length 1.41421, expected 1", id="length"),
        pytest.param("ego_pose_lidar", {"translation": [0, np.nan, 0]}, "translation: expected finite", id="NaN"),
        pytest.param(
            "calibrated_camera", {"camera_intrinsic": []}, "camera_intrinsic: expected 9 numbers", id="lidar's"
        ),
    ],
)
def test_faults_are_named(sample, name, change, message):
    with pytest.raises(ldls.CalibrationError, match=message):
        ldls.Camera.from_nuscenes(**sample | {name: sample[name] | change})
