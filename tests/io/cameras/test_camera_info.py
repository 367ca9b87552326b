from types import SimpleNamespace

import numpy as np
import pytest

import ldls

K = [500.0, 0, 320, 0, 510, 240, 0, 0, 1]
P = [480.0, 0, 310, -96, 0, 480, 230, 0, 0, 0, 1, 0]
D = [-0.28, 0.07, 0.001, -0.0008, 0.01]
TO_CAMERA = np.array([[0, -1, 0, 0.1], [0, 0, -1, -0.2], [1, 0, 0, -0.3], [0, 0, 0, 1]])
ANGLE = 0.02
R = [np.cos(ANGLE), 0, np.sin(ANGLE), 0, 1, 0, -np.sin(ANGLE), 0, np.cos(ANGLE)]
FULL = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}


def fields(**changes):
    return {
        "height": 480, "width": 640, "distortion_model": "plumb_bob", "D": D, "K": K, "R": R, "P": P,
        "binning_x": 0, "binning_y": 0, "roi": FULL,
    } | changes  # fmt: skip


def ros1(**changes):
    values = fields(**changes)
    return SimpleNamespace(**values | {"roi": SimpleNamespace(**values["roi"])})


def ros2(**changes):
    message = ros1(**changes)
    for name in "DKRP":
        setattr(message, name.lower(), np.array(getattr(message, name)))
        delattr(message, name)
    return message


@pytest.mark.parametrize("make", [ros1, ros2, fields])
def test_the_raw_image_takes_k_and_d(make):
    camera = ldls.Camera.from_camera_info(make(), TO_CAMERA)
    assert camera.projection[:, :3].ravel().tolist() == K
    assert camera.distortion == ldls.Distortion("plumb_bob", tuple(D))
    assert camera.image_size == (480, 640)
    np.testing.assert_array_equal(camera.T_camera_lidar, TO_CAMERA)


@pytest.mark.parametrize("make", [ros1, ros2, fields])
def test_the_rectified_image_takes_p_and_r(make):
    camera = ldls.Camera.from_camera_info(make(), TO_CAMERA, rectified=True)
    assert camera.projection.ravel().tolist() == P
    assert camera.distortion.is_none
    turn = np.eye(4)
    turn[:3, :3] = np.reshape(R, (3, 3))
    np.testing.assert_allclose(camera.T_camera_lidar, turn @ TO_CAMERA)


def test_raw_and_rectified_see_the_same():
    """A point's raw pixel, rectified by OpenCV with K, D, R and P, is its rectified pixel."""
    cv2 = pytest.importorskip("cv2", reason="opencv-python-headless is the oracle")
    message = ros2(P=[480.0, 0, 310, 0, 0, 480, 230, 0, 0, 0, 1, 0])
    points = np.random.default_rng(3).uniform([4, -2, -1.5], [20, 2, 1.5], (500, 3))
    size = {"image_size": (480, 640)}
    seen, raw = ldls.stages.project(points, ldls.Camera.from_camera_info(message, TO_CAMERA), **size)
    also, flat = ldls.stages.project(points, ldls.Camera.from_camera_info(message, TO_CAMERA, rectified=True), **size)
    both = np.intersect1d(seen, also)
    assert len(both) > 200
    pixels = raw[np.isin(seen, both)][:, None]
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-12)
    k, r, p = (np.reshape(values, (3, -1)).astype(float) for values in (K, R, message.p))
    expected = cv2.undistortPoints(pixels, k, np.array(D), R=r, P=p, criteria=criteria)[:, 0]
    np.testing.assert_allclose(flat[np.isin(also, both)], expected, rtol=0, atol=1e-3)


@pytest.mark.parametrize(
    ("changes", "expected", "size"),
    [
        pytest.param({}, P, (480, 640), id="whole"),
        pytest.param(
            {"roi": FULL | {"x_offset": 100, "y_offset": 50, "width": 200, "height": 120}},
            [480, 0, 210, -96, 0, 480, 180, 0, 0, 0, 1, 0],
            (120, 200),
            id="region",
        ),
        pytest.param(
            {"binning_x": 2, "binning_y": 4},
            [240, 0, 154.75, -48, 0, 120, 57.125, 0, 0, 0, 1, 0],
            (120, 320),
            id="binning",
        ),
        pytest.param(
            {"roi": FULL | {"x_offset": 100, "width": 200, "height": 120}, "binning_x": 2, "binning_y": 2},
            [240, 0, 104.75, -48, 0, 240, 114.75, 0, 0, 0, 1, 0],
            (60, 100),
            id="cut, then shrunk",
        ),
    ],
)
def test_regions_and_binning(changes, expected, size):
    camera = ldls.Camera.from_camera_info(ros2(**changes), TO_CAMERA, rectified=True)
    assert camera.projection.ravel().tolist() == expected
    assert camera.image_size == size
    raw = ldls.Camera.from_camera_info(ros2(P=[*K[:3], 0, *K[3:6], 0, *K[6:], 0], **changes), TO_CAMERA)
    full = ldls.Camera.from_camera_info(
        ros1(P=[*K[:3], 0, *K[3:6], 0, *K[6:], 0], **changes), TO_CAMERA, rectified=True
    )
    np.testing.assert_array_equal(raw.projection, full.projection)


def test_yaml_of_a_message(tmp_path):
    pytest.importorskip("yaml", reason="the extra yaml is not installed")
    path = tmp_path / "info.yaml"
    path.write_text(f"height: 480\nwidth: 640\ndistortion_model: plumb_bob\nD: {D}\nK: {K}\nP: {P}\n")
    assert (
        ldls.read_camera(path, format="camera-info", T_camera_lidar=TO_CAMERA).projection[:, :3].ravel().tolist() == K
    )
    camera = ldls.read_camera(path, format="camera-info", T_camera_lidar=TO_CAMERA, rectified=True)
    np.testing.assert_array_equal(camera.T_camera_lidar, TO_CAMERA)


@pytest.mark.parametrize(
    ("message", "rectified", "text"),
    [
        pytest.param(ros2(K=[0.0] * 9), False, "K: all zeros, expected focal lengths; calibrate the camera", id="K"),
        pytest.param(ros1(P=[0.0] * 12), True, "P: all zeros", id="P"),
        pytest.param(fields(R=[0.0] * 9), True, "R: R.T R deviates by 1", id="R all zeros"),
        pytest.param(fields(R=[-1.0, 0, 0, 0, 1, 0, 0, 0, 1]), True, "R: the determinant is -1", id="R a mirror"),
        pytest.param(fields(K=K[:8]), False, r"K: expected 9 numbers \(3 x 3\), got 8", id="eight numbers"),
        pytest.param(fields(K=[np.nan, *K[1:]]), False, "K: expected finite numbers", id="NaN"),
        pytest.param(fields(D=None), False, r"key 'D' missing; .*make it \[\]", id="no D"),
        pytest.param(fields(distortion_model=""), False, "distortion_model is missing beside D", id="no model"),
        pytest.param(
            fields(distortion_model="mei"), False, "camera_info: .*model 'mei' is unknown", id="unknown model"
        ),
        pytest.param(
            fields(roi=FULL | {"x_offset": 600, "width": 100, "height": 10}), False, "roi: .* is not inside", id="roi"
        ),
        pytest.param({"a": 1}, False, "key 'K' missing; found a", id="no message"),
        pytest.param(None, False, "key 'K' missing; found none", id="None"),
    ],
)
def test_faults_are_named(message, rectified, text):
    with pytest.raises(ldls.CalibrationError, match=text):
        ldls.Camera.from_camera_info(message, TO_CAMERA, rectified=rectified)


def test_no_distortion_needs_no_model():
    camera = ldls.Camera.from_camera_info(fields(D=[], distortion_model=""), TO_CAMERA)
    assert camera.distortion.is_none
