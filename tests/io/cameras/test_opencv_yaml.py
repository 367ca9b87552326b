import sys

import numpy as np
import pytest

import ldls

pytest.importorskip("yaml", reason="the extra yaml is not installed")

K = [[720.5, 0, 640.25], [0, 715.5, 360.75], [0, 0, 1]]
D = [-0.28, 0.07, 1e-3, -8e-4, 1e-5]
TURNED = [[0, -1, 0, 0.1], [0, 0, -1, -0.2], [1, 0, 0, -0.3], [0, 0, 0, 1]]

OPENCV = """%YAML:1.0
---
image_width: 1280
image_height: 720
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 720.5, 0., 640.25, 0., 715.5, 360.75,
       0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -0.28, 7.e-02, 1e-3, -8.0e-04, 1.0e-05 ]
"""
ROS = """image_width: 1280
image_height: 720
camera_name: front
camera_matrix:
  rows: 3
  cols: 3
  data: [720.5, 0, 640.25, 0, 715.5, 360.75, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.28, 0.07, 0.001, -0.0008, 0.00001]
"""


@pytest.fixture
def write(tmp_path):
    def write_text(text):
        path = tmp_path / "camera.yaml"
        path.write_bytes(text.encode())
        return path

    return write_text


@pytest.mark.parametrize(
    "text",
    [
        pytest.param(OPENCV, id="OpenCV"),
        pytest.param(ROS, id="ROS camera_calibration"),
        pytest.param(OPENCV.replace("camera_matrix", "K").replace("distortion_coefficients", "D"), id="K and D"),
        pytest.param(OPENCV.replace("%YAML:1.0", "%YAML 1.2"), id="OpenCV 5"),
        pytest.param(
            OPENCV + "seen: !!opencv-nd-matrix\n   sizes: [ 1, 1, 2 ]\n   dt: d\n   data: [ 1., 2. ]\n", id="n-D"
        ),
        pytest.param(
            OPENCV.replace("!!opencv-matrix\n   rows: 3\n   cols: 3", "!!opencv-nd-matrix\n   sizes: [ 3, 3 ]"),
            id="n-D K",
        ),
        pytest.param("\ufeff" + OPENCV.replace("\n", "\r\n"), id="byte order mark, CRLF"),
        pytest.param(f"image_width: 1280\nimage_height: 720\nK: {K}\nD: {D}\n\n# end\n", id="lists"),
        pytest.param(f'{{"image_width": 1280, "image_height": 720, "K": {K}, "D": {D}}}', id="JSON"),
    ],
)
def test_spellings_of_a_camera(write, text):
    camera = ldls.read_camera(write(text), format="opencv", T_camera_lidar=TURNED)
    np.testing.assert_array_equal(camera.projection[:, :3], K)
    np.testing.assert_array_equal(camera.T_camera_lidar, TURNED)
    assert camera.distortion == ldls.Distortion("plumb_bob", tuple(D))
    assert camera.image_size == (720, 1280)


def test_another_size_than_that_of_the_file_is_refused(write):
    path = write(OPENCV)
    assert ldls.read_camera(path, T_camera_lidar=TURNED, image_size=(720, 1280)).image_size == (720, 1280)
    with pytest.raises(ldls.CalibrationError, match=r"image_size: got \(100, 90\), the file says \(720, 1280\)"):
        ldls.read_camera(path, T_camera_lidar=TURNED, image_size=(100, 90))


def test_what_opencv_writes(tmp_path):
    cv2 = pytest.importorskip("cv2", reason="opencv-python-headless is the oracle")
    path = tmp_path / "camera.yml"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("camera_matrix", np.array(K))
    storage.write("distortion_coefficients", np.array([*D, 0.1, 0.2, 1e-9])[:, None])
    storage.release()
    camera = ldls.read_camera(path, format="opencv", T_camera_lidar=TURNED)
    np.testing.assert_array_equal(camera.projection[:, :3], K)
    assert camera.distortion == ldls.Distortion("rational_polynomial", (*D, 0.1, 0.2, 1e-9))
    assert camera.image_size is None


@pytest.mark.parametrize(
    ("entries", "options", "model"),
    [
        pytest.param("D: [0.1, 0.2, 0.3, 0.4]", {"fisheye": True}, "equidistant", id="fisheye, as the caller says"),
        pytest.param(
            "D: [0.1, 0, 0, 0]\ndistortion_model: equidistant", {}, "equidistant", id="fisheye, as the file says"
        ),
        pytest.param("D: []", {}, "none", id="no coefficients"),
        pytest.param("D: [0.1, 0, 0, 0]", {}, "plumb_bob", id="four"),
    ],
)
def test_models_of_distortion(write, entries, options, model):
    camera = ldls.read_camera(write(f"K: {K}\n{entries}\n"), format="opencv", T_camera_lidar=np.eye(4), **options)
    assert camera.distortion.model == model


@pytest.mark.parametrize(
    ("text", "message"),
    [
        # where the text ends is the next line to libyaml
        pytest.param(OPENCV + "a: [1, 2", "line 1[67]: not YAML", id="malformed"),
        pytest.param("%YAML:1.0\n---\nK: {a: b: c}", "line 3: not YAML", id="malformed, line"),
        pytest.param("1 2 3", "expected keys with values, got str", id="no keys"),
        pytest.param("", "expected keys with values, got NoneType", id="empty"),
        pytest.param("[" * 40, "line 1: not YAML .more than 32 levels", id="beyond the limit"),
        pytest.param("[" * 5000, "line 1: not YAML .more than 32 levels", id="deep"),
        pytest.param("{[1]: 2}", "line 1: not YAML", id="key that is a list"),
        pytest.param("a: &a [*a]", "not YAML", id="list in itself"),
        pytest.param("K: !!python/object/apply:os.system [ls]", "could not determine a constructor", id="code"),
        pytest.param("K: 1\nK: 2\n", "line 2: not YAML .key 'K' stands there twice", id="key twice"),
        pytest.param(
            ROS.replace("camera_matrix", "matrix"), "key 'camera_matrix' missing; found image_width .*or K", id="no K"
        ),
        pytest.param(
            ROS.replace("distortion_coefficients", "d_c"),
            r"key 'distortion_coefficients' missing; .*write \[\] where there is no distortion",
            id="no D",
        ),
        pytest.param(
            ROS.replace("  cols: 3\n", "  cols: 4\n"), "camera_matrix: 3 rows x 4 cols, got 9 numbers", id="cols"
        ),
        pytest.param(ROS.replace("0, 0, 1]", "0, 1]"), "3 rows x 3 cols, got 8 numbers", id="eight numbers"),
        pytest.param(
            f"K: [1, 2]\nD: {D}", r"K: expected 9 numbers \(3 x 3\), got 2|camera_matrix: expected 9", id="two"
        ),
        pytest.param(OPENCV.replace("720.5", ".nan"), "expected finite numbers", id="NaN"),
        pytest.param(OPENCV.replace("720.5", f"1{400 * '0'}"), "expected finite numbers, got", id="400 digits"),
        pytest.param(ROS.replace("1280", f"0x{5000 * 'f'}"), "width: expected finite numbers", id="5000 digits"),
        pytest.param(OPENCV.replace("720.5", ".Nan"), "expected numbers .*Nan", id="NaN as OpenCV writes it"),
        pytest.param(ROS.replace("720.5", "'720,5'"), "expected numbers with a decimal point", id="decimal comma"),
        pytest.param(ROS.replace("plumb_bob", "omni"), "model 'omni' is unknown, expected one of", id="unknown model"),
        pytest.param(ROS.replace("0.001, -0.0008, 0.00001", "0").replace("cols: 5", "cols: 3"), "got 3", id="three D"),
        pytest.param(ROS.replace("1280", "wide"), "image_width: expected numbers", id="width"),
        pytest.param(ROS.replace("1280", "12.5"), "expected a whole number", id="half a pixel"),
        pytest.param(f"K: {np.zeros((3, 3)).tolist()}\nD: []", "rank below 3|focal lengths", id="all zero"),
    ],
)
def test_faults_are_named_with_their_file(write, text, message):
    with pytest.raises(ldls.CalibrationError, match=f"camera.yaml.*({message})") as caught:
        ldls.read_camera(write(text), format="opencv", T_camera_lidar=np.eye(4))
    assert str(caught.value).count("camera.yaml") == 1


def test_files_that_are_no_yaml(tmp_path, monkeypatch):
    path = tmp_path / "camera.xml"
    path.write_text('<?xml version="1.0"?><plist/>')
    with pytest.raises(ldls.UnsupportedFormatError, match="expected OpenCV's <opencv_storage>"):
        ldls.read_camera(path, format="opencv", T_camera_lidar=np.eye(4))
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ldls.CorruptFileError, match=r"camera\.xml: not a text file"):
        ldls.read_camera(path, format="opencv", T_camera_lidar=np.eye(4))
    path.write_bytes(b"#" * (1 << 18) + b"\n")
    with pytest.raises(ldls.LimitError, match="262,145 bytes, expected at most 262,144 of a calibration"):
        ldls.read_camera(path, format="opencv", T_camera_lidar=np.eye(4))
    with pytest.raises(ldls.FileFormatError, match="got a folder"):
        ldls.read_camera(tmp_path, format="opencv", T_camera_lidar=np.eye(4))
    with pytest.raises(FileNotFoundError):
        ldls.read_camera(tmp_path / "none.yaml", format="opencv", T_camera_lidar=np.eye(4))
    path.write_text(OPENCV)
    monkeypatch.setitem(sys.modules, "yaml", None)
    with pytest.raises(ImportError, match=r"ldls\[yaml\]"):
        ldls.read_camera(path, format="opencv", T_camera_lidar=np.eye(4))


@pytest.mark.parametrize(
    ("transform", "message"),
    [
        pytest.param(np.eye(3), r"T_camera_lidar: expected shape \(4, 4\)", id="3x3"),
        pytest.param(np.diag([2, 1, 1, 1]), "deviates", id="no rotation"),
        pytest.param(np.diag([-1, 1, 1, 1]), "determinant", id="mirror"),
        pytest.param(np.transpose(TURNED), "last row", id="column by column"),
    ],
)
def test_transforms_that_are_none(write, transform, message):
    with pytest.raises(ldls.CalibrationError, match=message):
        ldls.read_camera(write(ROS), format="opencv", T_camera_lidar=transform)


def test_aliases_of_aliases_are_refused(write):
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 8)]
    with pytest.raises(ldls.CalibrationError, match="line 2: not YAML .aliases are not read; write the value out"):
        ldls.read_camera(write("\n".join([*lines, "K: *a7"])), T_camera_lidar=np.eye(4))


@pytest.mark.parametrize("tag", ["", "!!int ", "!!float "], ids=["plain", "int", "float"])
def test_digits_with_colons_are_no_number_to_the_base_60(write, tag):
    # as a number this would take the square of its length in time
    long = ":".join(["1"] * 100_000)
    with pytest.raises(ldls.CalibrationError, match=r"camera\.yaml: camera_matrix: expected numbers .*1:1"):
        ldls.read_camera(write(f"K: {tag}{long}"), format="opencv", T_camera_lidar=np.eye(4))
