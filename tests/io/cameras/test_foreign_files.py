"""Camera files of other projects, beside an independent reader where there is one."""

import numpy as np
import pytest

import ldls

cv2 = pytest.importorskip("cv2", reason="opencv-python-headless is the oracle")
pytest.importorskip("yaml", reason="the extra yaml is not installed")

PAIR = """%YAML:1.0
---
M1: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 700., 0., 320., 0., 710., 240., 0., 0., 1. ]
D1: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -0.3, 0.1, 0., 0., 0. ]
M2: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 720., 0., 330., 0., 730., 250., 0., 0., 1. ]
D2: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -0.2, 0.05, 0., 0., 0. ]
"""


def matrices(path, *keys):
    """What OpenCV reads."""
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    return [storage.getNode(key).mat() for key in keys]


@pytest.mark.parametrize("suffix", [".xml", ".yml"])
@pytest.mark.parametrize("key", ["distortion_coefficients", "dist_coeff", "D"])
def test_what_opencv_writes_is_what_is_read(tmp_path, suffix, key):
    K, D = np.array([[700.5, 0, 320], [0, 710, 240.25], [0, 0, 1]]), np.linspace(-0.3, 0.1, 14)[None]
    path = tmp_path / f"camera{suffix}"
    written = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in (("calibration_time", "Sun Nov  3"), ("image_width", 640), ("image_height", 480), ("flags", 6)):
        written.write(name, value)
    written.write("camera_matrix", K)
    written.write(key, D)
    written.release()
    camera = ldls.read_camera(path, T_camera_lidar=np.eye(4))
    np.testing.assert_array_equal(camera.projection[:, :3], K)
    assert camera.distortion.coefficients == tuple(D.ravel().tolist())
    assert camera.image_size == (480, 640)


@pytest.mark.parametrize("camera", [None, 1, 2])
def test_each_camera_of_a_pair(tmp_path, camera):
    path = tmp_path / "intrinsics.yml"
    path.write_text(PAIR)
    found = ldls.read_camera(path, camera=camera, T_camera_lidar=np.eye(4))
    K, D = matrices(path, f"M{camera or 1}", f"D{camera or 1}")
    np.testing.assert_array_equal(found.projection[:, :3], K)
    assert found.distortion.coefficients == tuple(D.ravel().tolist())
    with pytest.raises(ldls.ParameterError, match="camera: got 3, expected 1 or 2"):
        ldls.read_camera(path, camera=3, T_camera_lidar=np.eye(4))


def test_the_first_message_of_an_echo_counts(tmp_path):
    one = (
        "height: 60\nwidth: 80\ndistortion_model: plumb_bob\nd: [0.1, 0, 0, 0, 0]\n"
        "k: [{}, 0, 40, 0, 50, 30, 0, 0, 1]\nroi: {{}}\n---\n"
    )
    (tmp_path / "info.yaml").write_text(one.format(50) + one.format(60))
    assert ldls.read_camera(tmp_path / "info.yaml", T_camera_lidar=np.eye(4)).projection[0, 0] == 50


def test_a_chain_with_the_transform_from_the_camera_to_the_imu(tmp_path):
    T_imu_cam = np.array([[0.0, -1, 0, 0.1], [1, 0, 0, -0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]])
    (tmp_path / "chain.yaml").write_text(
        f"cam0:\n  T_imu_cam: {T_imu_cam.tolist()}\n  camera_model: pinhole\n  distortion_coeffs: [0, 0, 0, 0]\n"
        "  distortion_model: radtan\n  intrinsics: [458, 457, 367, 248]\n  resolution: [752, 480]\n"
    )
    camera = ldls.read_camera(tmp_path / "chain.yaml", camera=0, T_imu_lidar=np.eye(4))
    np.testing.assert_allclose(camera.T_camera_lidar, np.linalg.inv(T_imu_cam), atol=1e-15)


def test_xml_with_a_document_type_is_refused(tmp_path):
    (tmp_path / "a.xml").write_text('<!DOCTYPE a [<!ENTITY b "c">]><opencv_storage>&b;</opencv_storage>')
    with pytest.raises(ldls.UnsupportedFormatError, match=r"a\.xml: XML with a document type"):
        ldls.read_camera(tmp_path / "a.xml", T_camera_lidar=np.eye(4))
    (tmp_path / "a.xml").write_text("<opencv_storage>\n<K>")
    with pytest.raises(ldls.CalibrationError, match=r"a\.xml: line 2: not XML"):
        ldls.read_camera(tmp_path / "a.xml", T_camera_lidar=np.eye(4))


@pytest.mark.parametrize(
    ("name", "options", "keys"),
    [
        pytest.param("dist_coeff.yml", {}, ("camera_matrix", "dist_coeff"), id="dist_coeff"),
        pytest.param("out_camera_data.xml", {}, ("camera_matrix", "distortion_coefficients"), id="XML"),
        pytest.param("intrinsics.yml", {"camera": 1}, ("M1", "D1"), id="first of a pair"),
        pytest.param("intrinsics.yml", {"camera": 2}, ("M2", "D2"), id="second of a pair"),
    ],
)
def test_files_of_others_equal_what_opencv_reads(data_folder, name, options, keys):
    path = data_folder / "real/cameras" / name
    camera = ldls.read_camera(path, T_camera_lidar=np.eye(4), **options)
    K, D = matrices(path, *keys)
    np.testing.assert_array_equal(camera.projection[:, :3], K)
    assert camera.distortion.coefficients == tuple(D.ravel().tolist())


def test_a_message_and_a_chain_of_others(data_folder):
    folder = data_folder / "real/cameras"
    assert ldls.read_camera(folder / "topic_echo.yaml", T_camera_lidar=np.eye(4)).image_size == (250, 250)
    chain = ldls.read_camera(folder / "kalibr_T_imu_cam.yaml", camera="cam1", T_imu_lidar=np.eye(4))
    first_row = [0.0125552670891, -0.999755099723, 0.0182237714554, -0.0198435579556]
    np.testing.assert_allclose(np.linalg.inv(chain.T_camera_lidar)[0], first_row, atol=1e-9)
    with pytest.raises(ldls.UnsupportedFormatError, match=r"extrinsics\.yml: no calibration that is known, found R T"):
        ldls.read_camera(folder / "extrinsics.yml", T_camera_lidar=np.eye(4))
