import numpy as np
import pytest

from ldls.segmenters.yolo import suppress

NEAR = [[0, 0, 10, 10], [1, 0, 11, 10], [20, 0, 30, 10]]


def slow_suppress(boxes, scores, classes, max_iou, max_kept):
    kept = []
    for i in sorted(range(len(boxes)), key=lambda i: -scores[i]):
        if all(classes[i] != classes[k] or iou(boxes[i], boxes[k]) <= max_iou for k in kept):
            kept.append(i)
    return kept[:max_kept]


def iou(one, other):
    wide = max(min(one[2], other[2]) - max(one[0], other[0]), 0)
    tall = max(min(one[3], other[3]) - max(one[1], other[1]), 0)
    areas = [(b[2] - b[0]) * (b[3] - b[1]) for b in (one, other)]
    return wide * tall / (sum(areas) - wide * tall) if wide * tall else 0


def kept(boxes, scores, classes, max_iou=0.5, max_kept=300):
    boxes, scores = np.array(boxes, np.float32).reshape(-1, 4), np.array(scores, np.float32)
    return suppress(boxes, scores, np.array(classes, np.int64), max_iou=max_iou, max_kept=max_kept).tolist()


@pytest.mark.parametrize(
    ("boxes", "scores", "classes", "expected"),
    [
        pytest.param([], [], [], [], id="no boxes"),
        pytest.param(NEAR, [0.5, 0.9, 0.7], [0, 0, 0], [1, 2], id="the better of two"),
        pytest.param(NEAR, [0.5, 0.9, 0.7], [0, 1, 0], [1, 2, 0], id="classes do not meet"),
        pytest.param(NEAR[:1] * 3, [0.5] * 3, [0] * 3, [0], id="equal scores: the first"),
        pytest.param([[3, 3, 3, 3]] * 2, [0.5, 0.4], [0, 0], [0, 1], id="boxes without area hide nothing"),
    ],
)
def test_suppression(boxes, scores, classes, expected):
    assert kept(boxes, scores, classes) == expected


@pytest.mark.parametrize("max_kept", [300, 7])
def test_suppression_is_its_definition(max_kept):
    rng = np.random.default_rng(4)
    corners = rng.uniform(0, 60, (200, 2))
    boxes = np.hstack([corners, corners + rng.uniform(5, 30, (200, 2))]).astype(np.float32)
    scores, classes = rng.random(200).astype(np.float32), rng.integers(0, 3, 200)
    assert kept(boxes, scores, classes, 0.4, max_kept) == slow_suppress(boxes, scores, classes, 0.4, max_kept)


def test_suppression_is_that_of_torchvision():
    torch = pytest.importorskip("torch")
    ops = pytest.importorskip("torchvision.ops")
    rng = np.random.default_rng(6)
    corners = rng.uniform(0, 60, (300, 2))
    boxes = np.hstack([corners, corners + rng.uniform(5, 30, (300, 2))]).astype(np.float32)
    scores, classes = rng.random(300).astype(np.float32), rng.integers(0, 4, 300)
    theirs = ops.batched_nms(torch.tensor(boxes), torch.tensor(scores), torch.tensor(classes), 0.5)
    assert kept(boxes, scores, classes) == theirs.tolist()
