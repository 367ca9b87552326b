import numpy as np
import pytest

from ldls.errors import DtypeError, ShapeError
from ldls.segmenters.segmenter import check_image


@pytest.mark.parametrize(
    ("image", "error", "match"),
    [
        pytest.param(np.zeros((4, 5), np.uint8), ShapeError, "repeat a grey image", id="grey"),
        pytest.param(np.zeros((4, 5, 4), np.uint8), ShapeError, "leave the alpha channel out", id="alpha"),
        pytest.param(np.zeros((3, 4, 5), np.uint8), ShapeError, "channels come last", id="channels first"),
        pytest.param(np.zeros((0, 5, 3), np.uint8), ShapeError, r"got \(0, 5, 3\)", id="no pixels"),
        pytest.param(np.zeros((1, 4, 5, 3), np.uint8), ShapeError, "expected", id="a batch"),
        pytest.param(np.zeros((4, 5, 3), np.float32), DtypeError, "got float32", id="floats"),
        pytest.param(np.zeros((4, 5, 3), np.uint16), DtypeError, "got uint16", id="16 bits"),
        pytest.param([[["a"] * 3]], DtypeError, "got <U1", id="text"),
    ],
)
def test_images_that_are_none(image, error, match):
    with pytest.raises(error, match=match):
        check_image(image)


@pytest.mark.parametrize(
    "image",
    [
        pytest.param(np.zeros((4, 5, 3), np.uint8)[:, ::-1], id="mirrored view"),
        pytest.param(np.asfortranarray(np.zeros((4, 5, 3), np.uint8)), id="Fortran order"),
    ],
)
def test_images_become_contiguous(image):
    assert check_image(image).flags.c_contiguous
