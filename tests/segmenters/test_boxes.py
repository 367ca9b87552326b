"""Boxes as segmenters."""

import numpy as np
import pytest

import ldls
from ldls.errors import CorruptFileError, MaskError, ParameterError
from ldls.segmenters import BoxSegmenter
from ldls.segmenters.grabcut import cut, ellipse
from ldls.simulation import sample_frame

IMAGE = np.zeros((40, 60, 3), np.uint8)
LINE = "{name} 0.00 0 -1.5 {box} 1.5 1.6 3.9 1.0 1.7 20.0 -1.6{score}"


def slow_rectangle(box, size):
    pixels = np.zeros(size, bool)
    for v in range(size[0]):
        for u in range(size[1]):
            pixels[v, u] = box[0] <= u <= box[2] and box[1] <= v <= box[3]
    return pixels


@pytest.mark.parametrize(
    "box",
    [
        pytest.param((5, 6, 20, 30), id="whole pixels"),
        pytest.param((5.2, 6.7, 20.9, 30.5), id="between pixels"),
        pytest.param((-7.5, -3, 20, 30), id="off the top left"),
        pytest.param((30, 20, 99.5, 99), id="off the bottom right"),
        pytest.param((-1e9, -1e9, 1e9, 1e9), id="larger than the image"),
        pytest.param((0, 0, 59, 39), id="the image"),
        pytest.param((7, 7, 7.5, 7.5), id="one centre"),
    ],
)
def test_rectangles_hold_the_centres_within(box):
    (mask,) = BoxSegmenter([box])(IMAGE)
    np.testing.assert_array_equal(mask.to_array(), slow_rectangle(box, (40, 60)))
    assert (mask.name, mask.score) == ("object", 1)


@pytest.mark.parametrize(
    "box",
    [
        pytest.param((5.2, 6, 5.8, 30), id="no centre"),
        pytest.param((60, 6, 70, 30), id="beside the image"),
        pytest.param((5, -30, 20, -1), id="above the image"),
    ],
)
@pytest.mark.parametrize("grabcut", [False, True])
def test_boxes_that_show_nothing_are_left_out(box, grabcut):
    assert len(BoxSegmenter([box], grabcut=grabcut)(IMAGE)) == 0


def test_no_boxes():
    masks = BoxSegmenter([])(IMAGE)
    assert (len(masks), masks.image_size) == (0, (40, 60))


def test_categories_scores_and_names():
    boxes = [(1, 1, 9, 9)] * 3
    segmenter = BoxSegmenter(
        boxes, categories=[3, 101, 3], scores=[0.9, 0.8, 0.1], names={3: "car", 101: "Van"}, min_score=0.5
    )
    assert [(m.category, m.name, round(m.score, 3)) for m in segmenter(IMAGE)] == [(3, "car", 0.9), (101, "Van", 0.8)]


@pytest.mark.parametrize(
    ("boxes", "options", "error", "match"),
    [
        pytest.param(np.zeros((4, 2)), {}, MaskError, r"expected \(M, 4\).*got shape \(4, 2\)", id="two corners a row"),
        pytest.param([1, 2, 3, 4], {}, MaskError, r"got shape \(4,\)", id="one row"),
        pytest.param([[0, 0, 5, 5], [1, np.nan, 3, 4]], {}, MaskError, "box 1: .*nan", id="NaN"),
        pytest.param([[1, 2, 3, np.inf]], {}, MaskError, "box 0: .*inf", id="infinite"),
        pytest.param([[20, 6, 5, 30]], {}, MaskError, "box 0: .*left, top, width, height", id="width and height"),
        pytest.param([[1, 2, 3, 4]], {"scores": [1.5]}, MaskError, "score is 1.5", id="score"),
        pytest.param([[1, 2, 3, 4]], {"scores": [np.nan]}, MaskError, "score is nan", id="score NaN"),
        pytest.param([[1, 2, 3, 4]], {"scores": [1, 1]}, MaskError, "one for each of 1", id="two scores"),
        pytest.param([[1, 2, 3, 4]], {"categories": [101]}, MaskError, "category 101 is unknown", id="category"),
        pytest.param([[1, 2, 3, 4]], {"min_score": 2}, ParameterError, "min_score: got 2", id="min_score"),
    ],
)
def test_boxes_that_cannot_be(boxes, options, error, match):
    with pytest.raises(error, match=match):
        BoxSegmenter(boxes, **options)


def label_file(tmp_path, *rows):
    lines = [LINE.format(name=name, box="5 6 20 30", score=score) for name, score in rows]
    path = tmp_path / "000001.txt"
    path.write_text("".join(line + "\n" for line in lines))
    return path


def test_kitti_classes(tmp_path):
    known = ["Car", "Pedestrian", "Person_sitting", "Truck", "Tram", "Van", "Cyclist", "Misc"]
    path = label_file(tmp_path, *((name, "") for name in [*known, "DontCare", "Forklift", "dog"]))
    masks = BoxSegmenter.read_kitti(path, names={104: "Forklift"})(IMAGE)
    assert masks.categories.tolist() == [3, 1, 1, 8, 7, 101, 102, 103, 104, 18]
    assert [m.name for m in masks][5:] == ["Van", "Cyclist", "Misc", "Forklift", "dog"]
    with pytest.raises(MaskError, match="000001.txt: box 8: class 'Forklift' is none of"):
        BoxSegmenter.read_kitti(path)
    assert (masks.scores == 1).all()


def test_kitti_scores(tmp_path):
    path = label_file(tmp_path, ("Car", " 0.75"), ("Car", " 0.25"))
    assert BoxSegmenter.read_kitti(path, min_score=0.5)(IMAGE).scores.tolist() == [0.75]


@pytest.mark.parametrize(
    ("rows", "error", "match"),
    [
        pytest.param([("Car", ""), ("Car", " 17.2")], MaskError, "box 1: score is 17.2.*KITTI", id="score 17"),
        pytest.param([("Car", " nan")], CorruptFileError, "line 1: expected a finite number", id="score NaN"),
        pytest.param([("Car", " 1 2")], CorruptFileError, "got 17", id="17 columns"),
    ],
)
def test_kitti_files_that_cannot_be(rows, error, match, tmp_path):
    with pytest.raises(error, match=match):
        BoxSegmenter.read_kitti(label_file(tmp_path, *rows))


def test_kitti_file_without_objects(tmp_path):
    assert len(BoxSegmenter.read_kitti(label_file(tmp_path))(IMAGE)) == 0


def disc(seed=0):
    """A bright disc of radius 40 before a dark, noisy ground: (image, silhouette, box)."""
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[:200, :300]
    silhouette = (v - 100) ** 2 + (u - 150) ** 2 <= 40**2
    image = np.where(silhouette[:, :, None], (210, 180, 60), (40, 60, 90)) + rng.normal(0, 12, (200, 300, 3))
    return image.clip(0, 255).astype(np.uint8), silhouette, (110, 60, 190, 140)


def test_grabcut_finds_the_object_in_its_box():
    image, silhouette, box = disc()
    (mask,) = BoxSegmenter([box], grabcut=True)(image)
    found = mask.to_array()
    assert (found & silhouette).sum() / (found | silhouette).sum() > 0.97
    np.testing.assert_array_equal(BoxSegmenter([box], grabcut=True)(image).to_array()[0], found)


def test_grabcut_finds_a_large_object_too():
    image, silhouette, box = disc()
    image, silhouette = (np.kron(a, np.ones((5, 5, 1)[: a.ndim], a.dtype)) for a in (image, silhouette))
    (mask,) = BoxSegmenter([np.multiply(box, 5)], grabcut=True)(image)
    found = mask.to_array()
    assert (found & silhouette).sum() / (found | silhouette).sum() > 0.95


@pytest.mark.parametrize(
    ("image", "box"),
    [
        pytest.param(IMAGE, (10, 10, 30, 30), id="one colour"),
        pytest.param(IMAGE, (0, 0, 59, 39), id="the image"),
        pytest.param(IMAGE, (10, 10, 10.5, 10.5), id="a pixel"),
        pytest.param(IMAGE[:1], (10, -3, 30, 9), id="an image of a row"),
        pytest.param(IMAGE[:1, :1], (-3, -3, 9, 9), id="an image of a pixel"),
    ],
)
def test_grabcut_falls_back_to_an_ellipse(image, box):
    (mask,) = BoxSegmenter([box], grabcut=True)(image)
    _, _, height, width = mask.bounding_box
    share = mask.area / (height * width)
    assert share >= 0.2
    if (mask.area < height * width) and min(height, width) > 10:
        np.testing.assert_array_equal(mask.crop(), ellipse(height, width))


def test_ellipse_is_its_definition():
    expected = [
        [((v + 0.5) / 9 * 2 - 1) ** 2 + ((u + 0.5) / 14 * 2 - 1) ** 2 <= 1 for u in range(14)] for v in range(9)
    ]
    np.testing.assert_array_equal(ellipse(9, 14), expected)


def test_grabcut_does_not_touch_the_image():
    image, _, _ = disc()
    before = image.copy()
    cut(image, 60, 110, 81, 81)
    np.testing.assert_array_equal(image, before)


def test_boxes_label_points():
    frame = sample_frame()
    (image,) = frame.images
    boxes = []
    for mask in image.masks:
        top, left, height, width = mask.bounding_box
        boxes.append((left, top, left + width - 1, top + height - 1))
    masks = BoxSegmenter(boxes, categories=image.masks.categories)(image.read())
    labels = ldls.segment(frame.points, masks, image.camera).labels
    truth = frame.truth.instances
    largest = np.bincount(truth[labels >= 0])[1:].argmax() + 1
    assert np.mean(labels[(truth == largest) & (labels >= 0)] > 0) > 0.8
