import numpy as np
import pytest

import ldls

KITTI = "P2: 700 0 600 45 0 700 170 0.2 0 0 1 0.003\nR0_rect: {R}\nTr_velo_to_cam: {T}\n"
K = [[700.0, 0.0, 600.0], [0.0, 710.0, 170.0], [0.0, 0.0, 1.0]]
OPENCV = "%YAML:1.0\n---\nK: [[700.0, 0, 600], [0, 710.0, 170], [0, 0, 1]]\nD: [0.1, 0.01, 0, 0]\n"
ROSTOPIC = "header: {}\nheight: 4\nwidth: 6\ndistortion_model: plumb_bob\nD: []\nK: [5, 0, 3, 0, 5, 2, 0, 0, 1]\n"
KALIBR = (
    "cam0:\n  camera_model: pinhole\n  intrinsics: [700, 710, 600, 170]\n  distortion_model: none\n"
    "  distortion_coeffs: []\n  resolution: [1242, 375]\n"
)


def turn(axis, degrees):
    cos, sin = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    rows = {"x": [[1, 0, 0], [0, cos, -sin], [0, sin, cos]], "z": [[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]}
    return np.array(rows[axis])


def test_kitti_rectifies_after_the_lidar_has_been_moved(tmp_path):
    rectification, rotation, translation = turn("x", 20), turn("z", 30), np.array([0.1, -0.2, 0.3])
    lines = KITTI.format(
        R=" ".join(map(repr, rectification.ravel().tolist())),
        T=" ".join(map(repr, np.column_stack([rotation, translation]).ravel().tolist())),
    )
    (tmp_path / "calib.txt").write_text(lines)
    camera = ldls.read_camera(tmp_path / "calib.txt")
    point = np.array([3.0, -1.0, 12.0])
    rectified = rectification @ (rotation @ point + translation)
    np.testing.assert_allclose((camera.T_camera_lidar @ [*point, 1])[:3], rectified, atol=1e-12)
    homogeneous = camera.projection @ [*rectified, 1]
    np.testing.assert_allclose(camera.core.project(*point)[:2], homogeneous[:2] / homogeneous[2], atol=1e-9)


@pytest.mark.parametrize(
    ("name", "text", "options"),
    [
        pytest.param("a.yml", OPENCV, {"T_camera_lidar": np.eye(4)}, id="opencv"),
        pytest.param("a.txt.yaml", KALIBR, {"T_camera_lidar": np.eye(4)}, id="kalibr"),
        pytest.param("info.yaml", ROSTOPIC, {"T_camera_lidar": np.eye(4)}, id="camera info"),
        pytest.param("a.dat", OPENCV, {"T_camera_lidar": np.eye(4)}, id="yaml under another name"),
        pytest.param("a.dat", KITTI.format(R="1 0 0 0 1 0 0 0 1", T="1 0 0 0 0 1 0 0 0 0 1 0"), {}, id="kitti"),
    ],
)
def test_the_content_tells_the_format(tmp_path, name, text, options):
    pytest.importorskip("yaml", reason="the extra yaml is not installed")
    (tmp_path / name).write_text(text)
    camera = ldls.read_camera(tmp_path / name, **options)
    np.testing.assert_array_equal(camera.T_camera_lidar, np.eye(4))


@pytest.mark.parametrize(
    ("text", "options", "error", "message"),
    [
        pytest.param(OPENCV, {}, ldls.CalibrationError, "as T_camera_lidar=", id="no lidar"),
        pytest.param("names: 3\n", {}, ldls.UnsupportedFormatError, "found names; expected camera_matrix", id="other"),
        pytest.param(
            OPENCV,
            {"camera": 3, "T_camera_lidar": np.eye(4)},
            ldls.ParameterError,
            "is of one camera",
            id="of one camera",
        ),
        pytest.param(OPENCV, {"T_imu_lidar": np.eye(4)}, ldls.ParameterError, "no option of opencv", id="no option"),
        pytest.param(OPENCV, {"format": "xml"}, ldls.ParameterError, "expected one of kitti, kitti-raw", id="format"),
    ],
)
def test_faults_are_named(tmp_path, text, options, error, message):
    pytest.importorskip("yaml", reason="the extra yaml is not installed")
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(error, match=message):
        ldls.read_camera(tmp_path / "a.yaml", **options)


def test_the_matrices_of_opencv_in_memory():
    R, t = turn("x", 10), [0.5, 0.0, -0.2]
    camera = ldls.Camera.from_opencv(
        K, [0.1, 0.01, 0.001, 0.002, 0.0], R, np.reshape(t, (3, 1)), image_size=(375, 1242)
    )
    np.testing.assert_array_equal(camera.T_camera_lidar[:3], np.column_stack([R, t]))
    assert camera.distortion == ldls.Distortion("plumb_bob", (0.1, 0.01, 0.001, 0.002, 0.0))
    assert camera.image_size == (375, 1242)
    with pytest.raises(ldls.CalibrationError, match="R: expected shape"):
        ldls.Camera.from_opencv(K, R=[0, 0, 1])
