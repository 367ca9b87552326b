import numpy as np
import pytest

import ldls

pytest.importorskip("yaml", reason="the extra yaml is not installed")

CHAIN = """cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.28, 0.07, 0.001, -0.0008]
  distortion_model: radtan
  intrinsics: [458.6, 457.3, 367.2, 248.4]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
  T_cam_imu:
  - [0.0, -1.0, 0.0, 0.1]
  - [0.0, 0.0, -1.0, 0.2]
  - [1.0, 0.0, 0.0, 0.3]
  - [0.0, 0.0, 0.0, 1.0]
cam1:
  camera_model: pinhole
  distortion_coeffs: [0.01, 0.02, 0.03, 0.04]
  distortion_model: equidistant
  intrinsics: [457.5, 456.1, 379.9, 255.2]
  resolution: [752, 480]
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.11]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
"""
TO_IMU = [[0, -1, 0, 0.1], [0, 0, -1, 0.2], [1, 0, 0, 0.3], [0, 0, 0, 1]]
LIDAR = "  T_cam_lidar: [[1, 0, 0, 0.5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n"


def shift(x, y=0, z=0):
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


@pytest.fixture
def write(tmp_path):
    def write_text(text):
        path = tmp_path / "camchain.yaml"
        path.write_text(text)
        return path

    return write_text


def test_the_camera_of_a_chain(write):
    camera = ldls.read_camera(write(CHAIN), T_camera_lidar=TO_IMU)
    assert camera.projection[:, :3].tolist() == [[458.6, 0, 367.2], [0, 457.3, 248.4], [0, 0, 1]]
    assert camera.distortion == ldls.Distortion("plumb_bob", (-0.28, 0.07, 0.001, -0.0008))
    assert camera.image_size == (480, 752)
    np.testing.assert_array_equal(camera.T_camera_lidar, TO_IMU)
    other = ldls.read_camera(write(CHAIN), camera="cam1", T_camera_lidar=np.eye(4))
    assert other.distortion == ldls.Distortion("equidistant", (0.01, 0.02, 0.03, 0.04))


@pytest.mark.parametrize(
    ("text", "camera", "options", "expected"),
    [
        pytest.param(CHAIN.replace("cam1:\n", LIDAR + "cam1:\n"), "cam0", {}, shift(0.5), id="lidar in the file"),
        pytest.param(CHAIN.replace("cam1:\n", LIDAR + "cam1:\n"), "cam1", {}, shift(0.39), id="by the camera before"),
        pytest.param(CHAIN, "cam0", {"T_imu_lidar": shift(1)}, TO_IMU @ shift(1), id="by the IMU"),
        pytest.param(
            CHAIN, "cam1", {"T_imu_lidar": shift(1)}, shift(-0.11) @ TO_IMU @ shift(1), id="by camera and IMU"
        ),
        pytest.param(CHAIN + LIDAR, "cam1", {"T_camera_lidar": np.eye(4)}, np.eye(4), id="the caller knows better"),
    ],
)
def test_ways_to_the_lidar(write, text, camera, options, expected):
    found = ldls.read_camera(write(text), camera=camera, **options)
    np.testing.assert_allclose(found.T_camera_lidar, expected, rtol=0, atol=1e-12)


def test_no_distortion(write):
    text = CHAIN.replace("radtan", "none").replace("  distortion_coeffs: [-0.28, 0.07, 0.001, -0.0008]\n", "")
    assert ldls.read_camera(write(text), T_camera_lidar=np.eye(4)).distortion.is_none


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        pytest.param(CHAIN, {"camera": "cam2"}, "key 'cam2' missing; found cam0 cam1", id="no such camera"),
        pytest.param("cam0: 3", {}, "cam0 is 3, expected keys with values", id="no section"),
        pytest.param(
            CHAIN.replace("pinhole", "omni"), {}, "cam0: camera_model is 'omni', expected 'pinhole'", id="omni"
        ),
        pytest.param(CHAIN.replace("radtan", "fov"), {}, "model 'fov' is unknown", id="fov"),
        pytest.param(CHAIN.replace("radtan", "null"), {}, "key 'distortion_model' missing", id="no model"),
        pytest.param(CHAIN.replace("[458.6, ", "["), {}, r"intrinsics: expected 4 numbers \(4\), got 3", id="three"),
        pytest.param(CHAIN.replace("[458.6, ", "[.nan, "), {}, "intrinsics: expected finite numbers", id="NaN"),
        pytest.param(CHAIN.replace("-0.0008]", "-0.0008, 1, 2]"), {}, "4 or 5 coefficients, got 6", id="six"),
        pytest.param(CHAIN.replace("[752,", "[0,"), {}, "resolution: expected whole numbers", id="resolution"),
        pytest.param(CHAIN, {"T_camera_lidar": None}, "no T_cam_lidar.* pass T_camera_lidar=", id="no lidar"),
        pytest.param(
            CHAIN.replace("cam1:\n", LIDAR.replace("[1, 0, 0, 0.5]", "[2, 0, 0, 0]") + "cam1:\n"),
            {"T_camera_lidar": None},
            "cam0: T_cam_lidar: R.T R deviates by 3",
            id="no rotation",
        ),
        pytest.param(
            CHAIN.replace("cam1:\n", LIDAR.replace("[1, 0, 0, 0.5]", "[-1, 0, 0, 0]") + "cam1:\n"),
            {"T_camera_lidar": None},
            "determinant is -1",
            id="mirror",
        ),
        pytest.param(
            CHAIN, {"T_camera_lidar": None, "T_imu_lidar": shift(1).T}, "T_imu_lidar: the last row", id="transposed"
        ),
        pytest.param(
            CHAIN, {"T_camera_lidar": None, "T_imu_lidar": np.eye(3)}, "T_imu_lidar: expected shape", id="3x3"
        ),
    ],
)
def test_faults_are_named(write, text, options, message):
    with pytest.raises(ldls.CalibrationError, match=message):
        ldls.read_camera(write(text), **{"T_camera_lidar": np.eye(4)} | options)
