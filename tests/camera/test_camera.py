import pickle

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import ldls
from conftest import pinhole
from ldls.camera.rigid import from_parts

CALIBRATION = {
    "P0": "100 0 50 0 0 100 40 0 0 0 1 0",
    "P2": "100 0 50 4 0 100 40 -1 0 0 1 0.01",
    "R0_rect": "1 0 0 0 1 0 0 0 1",
    "Tr_velo_to_cam": "0 -1 0 0.1 0 0 -1 -0.2 1 0 0 -0.3",
}


def calibration(**changes):
    lines = CALIBRATION | changes
    return "".join(f"{key}: {value}\n" for key, value in lines.items() if value is not None)


@pytest.fixture
def write(tmp_path):
    def write_text(text):
        path = tmp_path / "calib.txt"
        path.write_bytes(text.encode())
        return path

    return write_text


def test_kitti_calibration_composes_projection_and_transform(write):
    camera = ldls.read_camera(write(calibration()))
    assert camera.projection.tolist() == [[100, 0, 50, 4], [0, 100, 40, -1], [0, 0, 1, 0.01]]
    assert camera.T_camera_lidar[0].tolist() == [0, -1, 0, 0.1]
    assert ldls.read_camera(write(calibration()), camera=0).projection[0, 3] == 0


@pytest.mark.parametrize(
    "text",
    [
        pytest.param(calibration().replace("\n", "\r\n"), id="windows line ends"),
        pytest.param("\ufeff" + calibration(), id="byte order mark"),
        pytest.param(calibration().replace(" ", "\t") + "\n\n# end\n", id="tabs, blank lines, comment"),
        pytest.param(
            calibration().replace("Tr_velo_to_cam:", "Tr_velo_cam").replace("R0_rect:", "R_rect"),
            id="spelt as in KITTI tracking",
        ),
        pytest.param(calibration().replace("\n", " \t \n"), id="blanks at the ends of lines"),
        pytest.param(calibration(R0_rect=None).replace("Tr_velo_to_cam", "Tr"), id="KITTI odometry"),
        pytest.param(calibration() + "calib_time: 09-Jan-2012 13:57:47\n", id="other keys"),
    ],
)
def test_spellings_of_a_calibration_that_are_understood(write, text):
    camera = ldls.read_camera(write(text))
    assert camera.T_camera_lidar[2].tolist() == [1, 0, 0, -0.3]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        pytest.param(
            calibration(Tr_velo_to_cam=None),
            "key 'Tr_velo_to_cam' missing; found P0 P2 R0_rect; did you unpack data_object_calib",
            id="missing key",
        ),
        pytest.param(calibration(P2=None), "key 'P2' missing", id="no such camera"),
        pytest.param(calibration(P2="1 2 3"), "line 2: expected 12 numbers, got 3", id="too few"),
        pytest.param(calibration(P2="1 " * 11), "line 2: expected 12 numbers, got 11", id="11 numbers"),
        pytest.param(calibration(P2="1 " * 13), "line 2: expected 12 numbers, got 13", id="13 numbers"),
        pytest.param(calibration(R0_rect="1 " * 10), "line 3: expected 9 numbers, got 10", id="many"),
        pytest.param(calibration(P2="nan " * 12), "line 2: expected finite numbers", id="nan"),
        pytest.param(calibration(P2="1,5 " * 12), "line 2: expected numbers with a decimal", id="comma"),
        pytest.param(calibration(P2="7_21.5 " * 12), "line 2: expected numbers with a decimal", id="underscore"),
        pytest.param(calibration(P2="\u0663 " * 12), "line 2: expected numbers with a decimal", id="digits of Arabic"),
        pytest.param(calibration() + "P2: " + CALIBRATION["P2"], "line 5: .* twice", id="doubled key"),
        pytest.param(calibration(P2="0 " * 12), "focal lengths that are not zero", id="all zero"),
        pytest.param(calibration(R0_rect="2 0 0 0 1 0 0 0 1"), "deviates", id="no rotation"),
        pytest.param(calibration(R0_rect="-1 0 0 0 1 0 0 0 1"), "determinant -1", id="mirror"),
        pytest.param("", "key 'P2' missing; found none", id="empty file"),
    ],
)
def test_faults_of_a_calibration_are_named_with_their_place(write, text, message):
    with pytest.raises(ldls.CalibrationError, match=message) as caught:
        ldls.read_camera(write(text))
    assert "calib.txt" in str(caught.value)


def test_a_missing_calibration_stays_file_not_found(tmp_path):
    with pytest.raises(FileNotFoundError):
        ldls.read_camera(tmp_path / "none.txt")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        pytest.param({"projection": np.eye(5)}, "projection: expected shape", id="shape"),
        pytest.param({"projection": np.eye(4)}, "is it the extrinsic\\? Pass T_camera_lidar=", id="extrinsic"),
        pytest.param({"projection": "abc"}, "projection: expected numbers, got 'abc'", id="text"),
        pytest.param({"projection": np.zeros((3, 3))}, "rank below 3", id="zeros"),
        pytest.param({"projection": np.eye(3), "T_camera_lidar": np.eye(3)}, "T_camera_lidar: exp", id="3x3"),
        pytest.param(
            {"projection": np.eye(3), "T_camera_lidar": np.eye(4) + np.eye(4, k=-3)},
            "last row",
            id="transposed",
        ),
        pytest.param(
            {"projection": np.eye(3), "T_camera_lidar": np.diag([np.nan, 1, 1, 1])},
            "is NaN",
            id="nan",
        ),
    ],
)
def test_matrices_that_cannot_be_a_camera_are_refused(arguments, message):
    with pytest.raises(ldls.CalibrationError, match=message):
        ldls.Camera(**arguments)


def test_an_intrinsic_matrix_stands_for_a_projection():
    camera = ldls.Camera(projection=[[100, 0, 50], [0, 100, 40], [0, 0, 1]])
    assert camera.projection.shape == (3, 4)
    assert not camera.projection.flags.writeable


def test_points_behind_the_camera_are_never_projected():
    points = np.array([[0, 0, -10], [0, 0, 0.05], [0, 0, 1e-30], [0, 0, 5]], np.float32)
    in_view, pixels = ldls.stages.project(points, pinhole(), image_size=(60, 80))
    assert in_view.tolist() == [3]
    assert pixels.tolist() == [[40, 30]]


def test_a_scaled_projection_sees_the_same():
    matrix = pinhole().projection
    points = np.random.default_rng(0).normal(size=(200, 3)) * [2, 2, 3]
    one = ldls.stages.project(points, ldls.Camera(projection=matrix), image_size=(60, 80))
    other = ldls.stages.project(points, ldls.Camera(projection=4 * matrix), image_size=(60, 80))
    assert one[0].tolist() == other[0].tolist()
    np.testing.assert_allclose(one[1], other[1])


def test_a_projection_of_negative_sign_is_its_negative():
    K = pinhole().projection
    points = np.random.default_rng(0).normal(size=(500, 3))
    expected = ldls.stages.project(points, ldls.Camera(projection=K), image_size=(60, 80))
    found = ldls.stages.project(points, ldls.Camera(projection=-K), image_size=(60, 80))
    assert len(expected[0]) > 5
    np.testing.assert_array_equal(found[0], expected[0])
    np.testing.assert_array_equal(found[1], expected[1])


TO_OPTICAL = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])


@pytest.mark.parametrize(
    ("mirror", "to_optical"),
    [
        pytest.param(np.diag([1.0, 1, 1]), TO_OPTICAL, id="forward, left, up"),
        pytest.param(np.diag([1.0, 1, 1]), TO_OPTICAL * [1, -1, 1], id="forward, right, up"),
        pytest.param([[-1.0, 0, 80], [0, 1, 0], [0, 0, 1]], TO_OPTICAL, id="mirrored image"),
    ],
)
def test_an_extrinsic_in_the_projection_may_be_of_any_hand(mirror, to_optical):
    projection = mirror @ pinhole().projection[:, :3] @ to_optical
    camera = ldls.Camera(projection=np.column_stack([projection, np.zeros(3)]))
    in_view, _ = ldls.stages.project(np.array([[5.0, 0.2, 0.1], [-5, 0.2, 0.1]]), camera, image_size=(60, 80))
    assert in_view.tolist() == [0]


@pytest.mark.parametrize(
    "mirror",
    [pytest.param(np.eye(3), id="as it is"), pytest.param([[-1.0, 0, 80], [0, 1, 0], [0, 0, 1]], id="mirrored")],
)
@pytest.mark.parametrize(
    "rotation",
    [
        pytest.param(Rotation.from_rotvec([0.1, -0.05, 0.2]).as_matrix() @ TO_OPTICAL, id="from the lidar"),
        pytest.param(Rotation.from_rotvec([0, 0, np.pi / 2]).as_matrix(), id="about the axis"),
    ],
)
def test_an_extrinsic_in_the_projection_is_that_of_the_camera(mirror, rotation):
    turn = from_parts(rotation, np.array([0.3, -2, 0.1]))
    intrinsic = mirror @ np.array([[100, 1.5, 40], [0, 90, 30], [0, 0, 1]])
    earlier = from_parts(Rotation.from_rotvec([0, 0, 0.3]).as_matrix(), np.array([1.0, 2, 3]))
    camera = ldls.Camera(projection=2 * intrinsic @ turn[:3], T_camera_lidar=earlier, image_size=(60, 80))
    np.testing.assert_allclose(camera.projection, 2 * np.column_stack([intrinsic, np.zeros(3)]), atol=1e-12)
    np.testing.assert_allclose(camera.T_camera_lidar, turn @ earlier, atol=1e-12)
    assert pickle.loads(pickle.dumps(camera)).T_camera_lidar.tolist() == camera.T_camera_lidar.tolist()


@pytest.mark.parametrize("turn", [(-1.0, -1, 1), (1, -1, -1), (-1, 1, -1)])
def test_half_a_turn_in_the_projection_is_that_of_the_camera(turn):
    camera = ldls.Camera(projection=pinhole().projection[:, :3] @ np.diag(turn))
    np.testing.assert_allclose(camera.projection, pinhole().projection, atol=1e-12)
    np.testing.assert_allclose(camera.T_camera_lidar, np.diag([*turn, 1]), atol=1e-12)


def test_up_is_the_same_for_a_camera_of_one_matrix():
    points = np.random.default_rng(7).uniform([3, -4, -1.8], [30, 4, 1], (400, 3))
    points[:300, 2] = -1.8
    extrinsic = from_parts(TO_OPTICAL, np.array([0.0, -0.1, 0]))
    apart = ldls.Camera(projection=pinhole().projection, T_camera_lidar=extrinsic)
    whole = ldls.Camera(projection=pinhole().projection @ extrinsic)
    heights = [ldls.stages.ground(points, camera) for camera in (apart, whole)]
    assert np.isfinite(heights[0]).sum() > 300
    np.testing.assert_allclose(*heights, atol=1e-9)


def test_the_camera_of_a_mirrored_image_looks_forward():
    mirrored = ldls.Camera(projection=np.diag([-1.0, 1, 1]) @ pinhole().projection + [[0, 0, 80, 0], [0] * 4, [0] * 4])
    in_view, pixels = ldls.stages.project(np.array([[1.0, 0, 5], [1, 0, -5]]), mirrored, image_size=(60, 80))
    assert in_view.tolist() == [0]
    assert pixels[0, 0] < 40


@pytest.mark.parametrize("columns", [3, 4])
def test_a_transposed_intrinsic_matrix_is_refused(columns):
    transposed = np.hstack([np.array([[720.0, 0, 620], [0, 720, 180], [0, 0, 1]]).T, np.zeros((3, 1))])
    with pytest.raises(ldls.CalibrationError, match="the last row is .*620.*, expected .0, 0, 1.; is K transposed"):
        ldls.Camera(projection=transposed[:, :columns])
