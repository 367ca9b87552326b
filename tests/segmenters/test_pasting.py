"""Pasted masks against their definitions, pixel by pixel."""

import math

import numpy as np
import pytest

from ldls.segmenters.pasting import padded_paste, plain_paste

SIZE = (41, 57)
BOXES = [
    pytest.param((5.0, 4.0, 33.0, 30.0), id="whole pixels"),
    pytest.param((5.3, 4.6, 33.7, 30.1), id="between pixels"),
    pytest.param((-9.4, -6.2, 20.0, 12.0), id="off the top left"),
    pytest.param((40.2, 25.0, 90.8, 77.7), id="off the bottom right"),
    pytest.param((-30.0, -20.0, 90.0, 70.0), id="larger than the image"),
    pytest.param((12.2, 9.1, 12.4, 9.3), id="within a pixel"),
    pytest.param((0.0, 0.0, 57.0, 41.0), id="the image"),
    pytest.param((70.0, 3.0, 90.0, 30.0), id="beside the image"),
    pytest.param((-30.0, -30.0, -3.0, -3.0), id="before the image"),
]


@pytest.fixture(scope="module")
def grid():
    return np.random.default_rng(1).random((28, 28), np.float32)


def whole(paste, grid, box, size=SIZE):
    values, top, left = paste(grid, np.array(box, np.float32), size)
    image = np.zeros(size, np.float32)
    image[top : top + values.shape[0], left : left + values.shape[1]] = values
    return image


def slow_resize(grid, height, width):
    """Bilinear, cell by cell: centres at half coordinates, no place before the first centre or after the last."""
    resized = np.zeros((height, width))
    for row in range(height):
        for column in range(width):
            y = min(max((row + 0.5) * grid.shape[0] / height - 0.5, 0), grid.shape[0] - 1)
            x = min(max((column + 0.5) * grid.shape[1] / width - 0.5, 0), grid.shape[1] - 1)
            below, right = min(int(y) + 1, grid.shape[0] - 1), min(int(x) + 1, grid.shape[1] - 1)
            v, u = y - int(y), x - int(x)
            resized[row, column] = (1 - v) * ((1 - u) * grid[int(y), int(x)] + u * grid[int(y), right]) + v * (
                (1 - u) * grid[below, int(x)] + u * grid[below, right]
            )
    return resized


def slow_paste(grid, left, top, right, bottom):
    resized = slow_resize(grid, max(bottom - top + 1, 1), max(right - left + 1, 1))
    image = np.zeros(SIZE)
    for row in range(SIZE[0]):
        for column in range(SIZE[1]):
            if top <= row <= bottom and left <= column <= right:
                image[row, column] = resized[row - top, column - left]
    return image


def slow_padded_paste(grid, box):
    padded = np.zeros((grid.shape[0] + 2, grid.shape[1] + 2))
    padded[1:-1, 1:-1] = grid
    left, top, right, bottom = box
    wide, tall = (right - left) * 30 / 28 / 2, (bottom - top) * 30 / 28 / 2
    u, v = (left + right) / 2, (top + bottom) / 2
    return slow_paste(padded, *(math.trunc(edge) for edge in (u - wide, v - tall, u + wide, v + tall)))


def slow_plain_paste(grid, box):
    return slow_paste(grid, *(math.trunc(edge) for edge in box))


@pytest.mark.parametrize("box", BOXES)
@pytest.mark.parametrize(
    ("fast", "slow"),
    [
        pytest.param(padded_paste, slow_padded_paste, id="torchvision"),
        pytest.param(plain_paste, slow_plain_paste, id="zoo"),
    ],
)
def test_paste_is_its_definition(fast, slow, box, grid):
    pasted, expected = whole(fast, grid, box), slow(grid, box)
    np.testing.assert_allclose(pasted, expected, atol=2e-5)
    np.testing.assert_array_equal(pasted >= 0.5, expected >= 0.5)


@pytest.mark.parametrize("box", BOXES[:7])  # torchvision clips boxes, and fails on those off the image
def test_paste_is_that_of_torchvision(box, grid):
    torch = pytest.importorskip("torch")
    roi_heads = pytest.importorskip("torchvision.models.detection.roi_heads")
    theirs = roi_heads.paste_masks_in_image(torch.tensor(grid)[None, None], torch.tensor([box]), SIZE)[0, 0].numpy()
    pasted = whole(padded_paste, grid, box)
    np.testing.assert_allclose(pasted, theirs, atol=2e-5)
    np.testing.assert_array_equal(pasted >= 0.5, theirs >= 0.5)


@pytest.mark.parametrize("box", BOXES[:7])
def test_plain_paste_is_that_of_opencv(box, grid):
    cv2 = pytest.importorskip("cv2")
    left, top, right, bottom = (math.trunc(edge) for edge in box)
    resized = cv2.resize(grid, (right - left + 1, bottom - top + 1), interpolation=cv2.INTER_LINEAR)
    expected = np.zeros(SIZE, np.float32)
    inside = (slice(max(top, 0), min(bottom + 1, SIZE[0])), slice(max(left, 0), min(right + 1, SIZE[1])))
    expected[inside] = resized[
        inside[0].start - top : inside[0].stop - top, inside[1].start - left : inside[1].stop - left
    ]
    np.testing.assert_allclose(whole(plain_paste, grid, box), expected, atol=1e-4)


def test_a_huge_box_takes_little_memory(grid):
    assert whole(plain_paste, grid, (-3e8, -3e8, 3e8, 3e8)).shape == SIZE
