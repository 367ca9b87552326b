"""Letterboxes against their definitions, pixel by pixel, and against OpenCV."""

import numpy as np
import pytest

from ldls.masks.letterbox import Letterbox
from ldls.masks.resampling import resize
from segmenters.test_pasting import slow_resize

SIZES = [
    pytest.param((37, 124), (64, 64), id="wide"),
    pytest.param((124, 37), (64, 64), id="tall"),
    pytest.param((30, 21), (64, 96), id="enlarged"),
    pytest.param((64, 64), (64, 64), id="of the very size"),
    pytest.param((33, 64), (64, 64), id="odd padding"),
    pytest.param((1, 300), (64, 64), id="a line"),
]
GENERATOR = np.random.default_rng(2)


def random_image(size):
    return GENERATOR.integers(0, 256, (*size, 3), np.uint8)


@pytest.mark.parametrize(("image_size", "input_size"), SIZES)
def test_fill_is_its_definition(image_size, input_size):
    image = random_image(image_size)
    ratio = min(input_size[0] / image_size[0], input_size[1] / image_size[1])
    height, width = (max(round(side * ratio), 1) for side in image_size)
    top, left = round((input_size[0] - height) / 2 - 0.1), round((input_size[1] - width) / 2 - 0.1)
    expected = np.full((*input_size, 3), 114, np.uint8)
    for channel in range(3):
        expected[top : top + height, left : left + width, channel] = (
            image[:, :, channel]
            if (height, width) == image_size
            else slow_whole_resize(image[:, :, channel].tolist(), height, width)
        )
    np.testing.assert_array_equal(Letterbox.fit(image_size, input_size).fill(image), expected)
    exact = slow_resize(image[:, :, 0].astype(float), height, width)
    assert np.abs(resize(image, height, width)[:, :, 0] - exact).max() < 1.1


def slow_whole_resize(levels, height, width):
    """Bilinear in whole numbers, cell by cell."""
    rows, columns = len(levels), len(levels[0])
    resized = np.zeros((height, width), np.uint8)
    for v in range(height):
        y, down = whole_place(v, rows, height)
        for u in range(width):
            x, across = whole_place(u, columns, width)
            if x < 0 or x >= columns - 1:
                x, across = min(max(x, 0), columns - 1), 0
            sums = []
            for row in (min(max(y, 0), rows - 1), min(max(y + 1, 0), rows - 1)):
                right = levels[row][min(x + 1, columns - 1)]
                sums.append((levels[row][x] * (2048 - across) + right * across) >> 4)
            resized[v, u] = (((2048 - down) * sums[0] >> 16) + (down * sums[1] >> 16) + 2) >> 2
    return resized


def whole_place(cell, source, target):
    place = np.float32((cell + 0.5) * (source / target) - 0.5)
    return int(np.floor(place)), int(np.rint((place - np.floor(place)) * np.float32(2048)))


@pytest.mark.parametrize(("image_size", "input_size"), SIZES)
def test_fill_is_that_of_opencv(image_size, input_size):
    cv2 = pytest.importorskip("cv2")
    image = random_image(image_size)
    box = Letterbox.fit(image_size, input_size)
    resized = cv2.resize(image, box.scaled_size[::-1], interpolation=cv2.INTER_LINEAR)
    spare = np.subtract(input_size, box.scaled_size)
    above, before = (round(s / 2 - 0.1) for s in spare.tolist())
    below, after = (round(s / 2 + 0.1) for s in spare.tolist())
    expected = cv2.copyMakeBorder(resized, above, below, before, after, cv2.BORDER_CONSTANT, value=(114, 114, 114))
    same_as_opencv(box.fill(image), expected)


def same_as_opencv(image, expected):
    # builds of OpenCV for other processors may round otherwise
    assert np.abs(image.astype(int) - expected).max() <= 1
    assert np.mean(image != expected) < 0.2


@pytest.mark.parametrize(("image_size", "input_size"), SIZES)
def test_upsampling_is_its_definition(image_size, input_size):
    cells = (input_size[0] // 4, input_size[1] // 4)
    grid = GENERATOR.normal(size=cells).astype(np.float32)
    rows, columns = Letterbox.fit(image_size, input_size).upsampling(cells)
    np.testing.assert_allclose(rows @ grid @ columns.T, slow_upsampling(grid, image_size), atol=2e-5)


def slow_upsampling(grid, image_size):
    """The grid made finer until the grey ends between cells, the grey cut off, the rest resampled."""
    ratio = min(4 * grid.shape[0] / image_size[0], 4 * grid.shape[1] / image_size[1])
    spare = [4 * n - max(round(side * ratio), 1) for n, side in zip(grid.shape, image_size, strict=True)]
    finer = next(f for f in (1, 2, 4) if all(s * f % 4 == 0 and s // 2 * f % 4 == 0 for s in spare))
    fine = slow_resize(grid, finer * grid.shape[0], finer * grid.shape[1])
    ratio = min(fine.shape[0] / image_size[0], fine.shape[1] / image_size[1])
    height, width = (max(round(side * ratio), 1) for side in image_size)
    top, left = round((fine.shape[0] - height) / 2 - 0.1), round((fine.shape[1] - width) / 2 - 0.1)
    return slow_resize(fine[top : top + height, left : left + width], *image_size)


def test_an_input_that_may_vary_is_as_small_as_the_stride_allows():
    box = Letterbox.fit((375, 1242), (640, 640), stride=32)
    assert (box.input_size, box.scaled_size, box.top, box.left) == ((224, 640), (193, 640), 15, 0)


def test_boxes_come_back_to_the_image():
    box = Letterbox.fit((375, 1242), (640, 640))
    corners = np.array([[0, box.top, 640, box.top + 193], [320, 0, 700, 640]], np.float32)
    np.testing.assert_allclose(box.boxes_in_image(corners), [[0, 0, 1242, 375], [621, 0, 1242, 375]], rtol=1e-6)


@pytest.mark.parametrize("size", [(193, 640), (377, 1248), (600, 1987), (100, 100), (375, 640), (188, 621), (1, 1)])
def test_resize_is_that_of_opencv(size):
    cv2 = pytest.importorskip("cv2")
    image = random_image((375, 1242))
    expected = cv2.resize(image, size[::-1], interpolation=cv2.INTER_LINEAR)
    same_as_opencv(resize(image, *size), expected)


def test_resize_keeps_an_image_of_the_size():
    image = random_image((5, 6))
    assert resize(image, 5, 6) is image
