import pickle

import numpy as np
import pytest

import ldls

cv2 = pytest.importorskip("cv2", reason="opencv-python-headless is the oracle")

K = np.array([[720.0, 0.4, 640.0], [0, 715.0, 360.0], [0, 0, 1]])
LENSES = [
    pytest.param("plumb_bob", (-0.28, 0.07, 1e-3, -8e-4, 0.01), id="barrel"),
    pytest.param("plumb_bob", (0.12, -0.02, -5e-4, 3e-4), id="cushion, four coefficients"),
    pytest.param("rational_polynomial", (4.1, 2.2, 1e-4, -2e-4, 0.1, 4.4, 3.6, 0.5), id="rational"),
    pytest.param("plumb_bob", (-0.3, 0.1, 1e-3, -2e-3, 0.01, *[0.0] * 3, 1e-3, -2e-3, 3e-3, 1e-3), id="thin prism"),
    pytest.param(
        "rational_polynomial", (-0.3, 0.1, 0, 0, 0, 0.02, 0, 0, 1e-3, 0, 2e-3, 0, 0.05, -0.03), id="tilted sensor"
    ),
    pytest.param("equidistant", (-0.013, 0.0041, -0.0023, 3e-4), id="fisheye"),
]


def rays(n=4000, widest=0.9):
    generator = np.random.default_rng(5)
    angle, turn = generator.uniform(0, widest, n), generator.uniform(-np.pi, np.pi, n)
    depth = generator.uniform(0.5, 60, n)
    return np.stack([np.tan(angle) * np.cos(turn), np.tan(angle) * np.sin(turn), np.ones(n)], axis=1) * depth[:, None]


def cv_pixels(model, coefficients, points):
    if model == "equidistant":
        uv, _ = cv2.fisheye.projectPoints(
            points[:, None], np.zeros(3), np.zeros(3), K, np.array(coefficients), alpha=K[0, 1] / K[0, 0]
        )
        return uv[:, 0]
    skewless = K.copy()
    skewless[0, 1] = 0
    uv, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), skewless, np.array(coefficients))
    # OpenCV knows no skew outside the fisheye
    uv = uv[:, 0]
    return uv + np.stack([K[0, 1] * (uv[:, 1] - K[1, 2]) / K[1, 1], np.zeros(len(uv))], axis=1)


@pytest.mark.parametrize(("model", "coefficients"), LENSES)
def test_pixels_equal_those_of_opencv(model, coefficients):
    points = rays()
    camera = ldls.Camera(projection=K, distortion=ldls.Distortion(model, coefficients))
    in_view, uv = ldls.stages.project(points, camera, image_size=(720, 1280))
    assert len(in_view) > 1500
    np.testing.assert_allclose(uv, cv_pixels(model, coefficients, points[in_view]), rtol=0, atol=1e-6)


def test_points_beyond_the_fold_are_not_in_view():
    # r (1 - 0.28 r^2) grows until r = 1.09 and comes back to the image's middle at r = 1.89
    camera = ldls.Camera(projection=K, distortion=ldls.Distortion("plumb_bob", (-0.28, 0, 0, 0)))
    points = np.array([[1.0, 0, 1], [1.89, 0, 1], [1.8, 0.1, 1], [-1.89, 0, -1]])
    in_view, _ = ldls.stages.project(points, camera, image_size=(720, 1280))
    assert in_view.tolist() == [0]
    masks = ldls.InstanceMasks.from_array(np.ones((1, 720, 1280), bool))
    report = ldls.segment(points, masks, camera).report
    assert (report.n_outside, report.n_behind) == (2, 1)


@pytest.mark.parametrize(
    ("model", "coefficients", "known_as"),
    [
        pytest.param("radtan", (0.1, 0, 0, 0), "plumb_bob", id="Kalibr"),
        pytest.param("plumb_bob", (), "none", id="no coefficients"),
        pytest.param("plumb_bob", (0.1, 0, 0, 0, 0, 0, 0, 0), "rational_polynomial", id="eight"),
        pytest.param("Fisheye", (0.1, 0, 0, 0), "equidistant", id="fisheye"),
        pytest.param("rational_polynomial", (0.1,) * 8 + (0,) * 6, "rational_polynomial", id="fourteen, six zeros"),
    ],
)
def test_models_have_many_names(model, coefficients, known_as):
    assert ldls.Distortion(model, coefficients).model == known_as


@pytest.mark.parametrize(
    ("model", "coefficients", "message"),
    [
        pytest.param("omni", (1, 2), "'omni' is unknown, expected one of none, plumb_bob", id="unknown"),
        pytest.param(
            "", (-0.3, 0.1, 0, 0, 0), "model '' has no coefficients, got .* name one of plumb_bob", id="no name"
        ),
        pytest.param("pinhole", (-0.3, 0.1, 0, 0), "model 'pinhole' has no coefficients", id="pinhole"),
        pytest.param("plumb_bob", (1, 2, 3), "plumb_bob has 4 or 5 coefficients, got 3", id="three"),
        pytest.param("equidistant", (1, 2, 3, np.nan), "finite", id="NaN"),
        pytest.param("equidistant", ("a",), "expected a list of finite numbers", id="text"),
        pytest.param("rational_polynomial", (0.1,) * 9, "8 or 12 or 14 coefficients, got 9", id="nine"),
    ],
)
def test_distortions_that_cannot_be_used_are_named(model, coefficients, message):
    with pytest.raises(ldls.CalibrationError, match=message):
        ldls.Distortion(model, coefficients)


def test_a_distorted_camera_takes_the_matrix_of_the_raw_image():
    distortion = ldls.Distortion("plumb_bob", (0.1, 0, 0, 0))
    rectified = np.hstack([K, [[-380.0], [0], [0]]])
    with pytest.raises(ldls.CalibrationError, match="intrinsic matrix K of the raw image"):
        ldls.Camera(projection=rectified, distortion=distortion)
    with pytest.raises(ldls.CalibrationError, match="last row of K"):
        ldls.Camera(projection=[[720, 0, 640], [0, 720, 360], [0, 0, 2]], distortion=distortion)


def test_cameras_survive_pickling():
    camera = ldls.Camera(projection=K, distortion=ldls.Distortion("plumb_bob", (-0.2, 0.1, 0, 0)))
    again = pickle.loads(pickle.dumps(camera))
    points = rays(100)
    for one, other in zip(
        *(ldls.stages.project(points, c, image_size=(720, 1280)) for c in (camera, again)), strict=True
    ):
        np.testing.assert_array_equal(one, other)
