import numpy as np
import pytest

import ldls

LIDAR = "calib_time: 15-Mar-2012 11:37:16\nR: 0 -1 0 0 0 -1 1 0 0\nT: 0.1 -0.2 -0.3\ndelta_f: 0 0\n"
CAMERAS = """calib_time: 09-Jan-2012 13:57:47
corner_dist: 9.95e-02
R_rect_00: 1 0 0 0 1 0 0 0 1
P_rect_00: 100 0 50 0 0 100 40 0 0 0 1 0
S_rect_02: 1.242e+03 3.75e+02
R_rect_02: 0 1 0 -1 0 0 0 0 1
P_rect_02: 100 0 50 4 0 100 40 -1 0 0 1 0.01
"""


@pytest.fixture
def write(tmp_path):
    def write_files(lidar=LIDAR, cameras=CAMERAS):
        (tmp_path / "calib_velo_to_cam.txt").write_bytes(lidar.encode())
        (tmp_path / "calib_cam_to_cam.txt").write_bytes(cameras.encode())
        return tmp_path

    return write_files


def test_a_camera_of_a_day(write):
    camera = ldls.read_camera(write())
    assert camera.projection.tolist() == [[100, 0, 50, 4], [0, 100, 40, -1], [0, 0, 1, 0.01]]
    np.testing.assert_array_equal(
        camera.T_camera_lidar, [[0, -1, 0, 0.1], [0, 0, -1, -0.2], [1, 0, 0, -0.3], [0, 0, 0, 1]]
    )
    assert camera.image_size == (375, 1242)
    first = ldls.read_camera(write(), camera=0)
    assert first.projection[0, 3] == 0
    assert first.image_size is None


@pytest.mark.parametrize("name", ["calib_velo_to_cam.txt", "calib_cam_to_cam.txt"])
def test_a_file_of_a_day_asks_for_the_folder_of_the_day(write, name):
    folder = write()
    with pytest.raises(
        ldls.CalibrationError, match=rf"{name}: half a calibration of KITTI raw; pass the folder"
    ) as caught:
        ldls.read_camera(folder / name)
    assert str(caught.value).endswith(f"of the day, {folder}")


def test_it_is_the_camera_of_the_object_file(write, data_folder):
    """The same numbers, spread over two files, make the same camera as in KITTI's object file."""
    path = data_folder / "kitti/training/calib/000571.txt"
    lines = dict(line.split(":", 1) for line in path.read_text().splitlines() if line)
    transform = np.array(lines["Tr_velo_to_cam"].split(), float).reshape(3, 4)

    def text(values):
        return " ".join(map(repr, values.ravel().tolist()))

    raw = ldls.read_camera(
        write(
            f"R: {text(transform[:, :3])}\nT: {text(transform[:, 3])}\n",
            f"R_rect_00: {lines['R0_rect']}\nP_rect_02: {lines['P2']}\n",
        )
    )
    camera = ldls.read_camera(path)
    np.testing.assert_array_equal(raw.projection, camera.projection)
    np.testing.assert_array_equal(raw.T_camera_lidar, camera.T_camera_lidar)


@pytest.mark.parametrize(
    ("lidar", "cameras", "message"),
    [
        pytest.param("R: 1 2 3", CAMERAS, "velo_to_cam.txt, line 1: expected 9 numbers, got 3", id="three numbers"),
        pytest.param(
            "R: 0 -1 0 0 0 -1 1 0 0", CAMERAS, "velo_to_cam.txt: key 'T' missing; found R; did you", id="no T"
        ),
        pytest.param(LIDAR + "T: 0 0 0", CAMERAS, "line 5: key 'T:' stands there twice", id="T twice"),
        pytest.param(
            LIDAR, CAMERAS.replace("P_rect_02", "P_rect_03"), "cam_to_cam.txt: key 'P_rect_02' missing", id="no P"
        ),
        pytest.param(LIDAR, CAMERAS.replace("R_rect_00: 1", "R_rect_00: nan"), "line 3: expected finite", id="NaN"),
        pytest.param(LIDAR, CAMERAS.replace("3.75e+02", "0.5"), "S_rect: expected width and height", id="size"),
        pytest.param(LIDAR, CAMERAS.replace("R_rect_00: 1", "R_rect_00: 2"), "deviates", id="no rotation"),
        pytest.param(
            LIDAR.replace("T: 0.1", "T: 1e10"),
            CAMERAS.replace("R_rect_00: 1", "R_rect_00: 1e300"),
            r"T_camera_lidar\[0, 3\] is inf",
            id="beyond float64",
        ),
    ],
)
def test_faults_are_named(write, lidar, cameras, message):
    with pytest.raises(ldls.CalibrationError, match=message):
        ldls.read_camera(write(lidar, cameras))


def test_cameras_and_files_that_are_not_there(write, tmp_path):
    with pytest.raises(ldls.ParameterError, match="camera: got 4, expected 0 to 3"):
        ldls.read_camera(write(), camera=4)
    with pytest.raises(FileNotFoundError):
        ldls.read_camera(tmp_path / "none")
