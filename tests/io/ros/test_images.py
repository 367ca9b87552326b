"""Image messages to RGB."""

import io
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("rosbags")

from datasets.ros_samples import image, picture
from ldls.errors import CorruptFileError, UnsupportedFormatError
from ldls.io.ros.images import decode_compressed, decode_image
from ldls.io.ros.messages import standard_types

TYPES = standard_types(ros2=True)
RGB = picture(size=(9, 11))
GREY = RGB[..., :1]
ALPHA = np.full_like(GREY, 200)


@pytest.mark.parametrize(
    ("encoding", "samples", "expected"),
    [
        pytest.param("rgb8", RGB, RGB, id="rgb8"),
        pytest.param("bgr8", RGB[..., ::-1], RGB, id="bgr8"),
        pytest.param("8UC3", RGB[..., ::-1], RGB, id="8UC3, in OpenCV's order"),
        pytest.param("rgba8", np.dstack([RGB, ALPHA]), RGB, id="rgba8"),
        pytest.param("bgra8", np.dstack([RGB[..., ::-1], ALPHA]), RGB, id="bgra8"),
        pytest.param("8UC4", np.dstack([RGB[..., ::-1], ALPHA]), RGB, id="8UC4, in OpenCV's order"),
        pytest.param("mono8", GREY, np.repeat(GREY, 3, axis=2), id="mono8"),
        pytest.param("mono16", GREY.astype("<u2") * 256 + 13, np.repeat(GREY, 3, axis=2), id="mono16"),
        pytest.param("rgb16", RGB.astype("<u2") * 256 + 13, RGB, id="rgb16"),
    ],
)
@pytest.mark.parametrize("padding", [0, 5])
def test_encodings(encoding, samples, expected, padding):
    np.testing.assert_array_equal(decode_image(image(TYPES, samples, encoding, padding=padding)), expected)


def test_big_endian_grey():
    samples = (GREY.astype(np.uint16) * 256 + 13).astype(">u2")
    found = decode_image(image(TYPES, samples, "mono16", big_endian=True))
    np.testing.assert_array_equal(found[..., :1], GREY)


@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
@pytest.mark.parametrize("depth", [8, 16])
def test_bayer_patterns_of_smooth_colours(pattern, depth):
    v, u = np.mgrid[:12, :14]
    smooth = np.stack([4 * u + 20, 5 * v + 30, 3 * u + 2 * v + 100], axis=-1).astype(np.uint8)
    mosaic = np.empty((12, 14), np.uint8)
    for place, colour in enumerate(pattern):
        corner = (slice(place // 2, None, 2), slice(place % 2, None, 2))
        mosaic[corner] = smooth[(*corner, "rgb".index(colour))]
    samples = mosaic if depth == 8 else mosaic.astype("<u2") * 256
    found = decode_image(image(TYPES, samples, f"bayer_{pattern}{depth}"))
    inner = (slice(1, -1), slice(1, -1))
    assert np.abs(found[inner].astype(int) - smooth[inner]).max() <= 1


@pytest.mark.parametrize(
    ("encoding", "conversion"),
    [("yuv422", "UYVY"), ("uyvy", "UYVY"), ("yuv422_yuy2", "YUY2"), ("yuyv", "YUY2")],
)
def test_brightness_with_half_the_colours_is_that_of_opencv(encoding, conversion):
    cv2 = pytest.importorskip("cv2")
    samples = np.random.default_rng(0).integers(0, 256, (20, 30, 2), np.uint8)
    expected = cv2.cvtColor(samples, getattr(cv2, f"COLOR_YUV2RGB_{conversion}"))
    found = decode_image(image(TYPES, samples, encoding, padding=3))
    assert np.abs(found.astype(int) - expected).max() <= 1


@pytest.mark.parametrize(("format", "tolerance"), [("PNG", 0), ("JPEG", 40)])
def test_compressed_images(format, tolerance):
    smooth = np.broadcast_to(np.arange(0, 240, 4, dtype=np.uint8)[:, None, None], (60, 80, 3))
    file = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(smooth)).save(file, format)
    compressed = SimpleNamespace(format=format.lower(), data=np.frombuffer(file.getvalue(), np.uint8))
    assert np.abs(decode_compressed(compressed).astype(int) - smooth).max() <= tolerance
    cut = SimpleNamespace(format=format.lower(), data=compressed.data[: len(compressed.data) // 2])
    with pytest.raises(CorruptFileError, match="not a whole"):
        decode_compressed(cut)


@pytest.mark.parametrize(
    ("broken", "error", "match"),
    [
        pytest.param({"encoding": "32FC1"}, UnsupportedFormatError, "'32FC1' is not read.*bayer_rggb8", id="depths"),
        pytest.param({"encoding": "16UC1"}, UnsupportedFormatError, "'16UC1'", id="depths in millimetres"),
        pytest.param({"encoding": "bayer_rgbg8"}, UnsupportedFormatError, "bayer_rgbg8", id="no such pattern"),
        pytest.param({"step": 20}, CorruptFileError, "rows of 20, expected 9 rows of 33", id="rows too short"),
        pytest.param({"height": 10}, CorruptFileError, "297 bytes in rows of 33, expected 10", id="rows missing"),
        pytest.param({"encoding": "yuyv", "step": 22}, CorruptFileError, "11 pixels a row.*even", id="half a pair"),
        pytest.param({"width": 0}, CorruptFileError, "9 x 0 pixels", id="no pixels"),
    ],
)
def test_what_makes_no_sense_is_refused(broken, error, match):
    message = image(TYPES, RGB)
    for name, value in broken.items():
        setattr(message, name, value)
    with pytest.raises(error, match=match):
        decode_image(message)


@pytest.mark.parametrize(
    ("format", "match"), [("16UC1; compressedDepth png", "holds depths"), ("theora", "expected a JPEG or PNG")]
)
def test_other_compressions_are_refused(format, match):
    with pytest.raises(UnsupportedFormatError, match=match):
        decode_compressed(SimpleNamespace(format=format, data=np.zeros(40, np.uint8)))
