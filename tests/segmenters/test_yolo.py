"""YOLO's outputs: layouts, metadata, and what they may not hold."""

import numpy as np
import pytest

from ldls.errors import CorruptFileError, FileFormatError, MaskError, ParameterError
from ldls.segmenters import OnnxSegmenter
from ldls.segmenters.yolo import Layout, layout_of

pytest.importorskip("onnx")
pytest.importorskip("onnxruntime")

from segmenters import graphs

IMAGE = np.zeros((64, 64, 3), np.uint8)
NAMES = {"names": "{0: 'cone', 1: 'person'}"}
PROTOTYPES = np.ones((1, 32, 16, 16), np.float32)


@pytest.mark.parametrize(
    ("sides", "n_classes", "expected"),
    [
        pytest.param((116, 8400), 80, ("yolov8", 80), id="YOLOv8"),
        pytest.param((116, 8400), None, ("yolov8", 80), id="YOLOv8 without names"),
        pytest.param((37, 8400), 1, ("yolov8", 1), id="YOLOv8 of one class"),
        pytest.param((116, 84), 80, ("yolov8", 80), id="YOLOv8 of few boxes"),
        pytest.param((25200, 117), 80, ("yolov5", 80), id="YOLOv5"),
        pytest.param((25200, 117), None, ("yolov5", 80), id="YOLOv5 without names"),
        pytest.param((25200, 38), 1, ("yolov5", 1), id="YOLOv5 of one class, as wide as end to end"),
        pytest.param((300, 38), 80, ("end-to-end", 80), id="end to end"),
        pytest.param((300, 38), None, ("end-to-end", None), id="end to end without names"),
        pytest.param((116, 8400), 3, None, id="other names"),
        pytest.param((30, 8400), None, None, id="no room for classes"),
    ],
)
def test_layouts(sides, n_classes, expected):
    assert layout_of(sides, 32, n_classes) == (None if expected is None else Layout(*expected))


def boxes(*rows, n_classes=2, padding=80):
    """YOLOv8's first output, of rows (u, v, width, height, scores, coefficient)."""
    output = np.zeros((1, 4 + n_classes + 32, padding), np.float32)
    for k, row in enumerate(rows):
        output[0, : 5 + n_classes, k] = row
    return output


def found(tmp_path, output, prototypes=PROTOTYPES, image=IMAGE, **options):
    notes = options.pop("notes", NAMES)
    model = graphs.constant_yolo(output, prototypes, notes=notes, sides=options.pop("sides", None))
    return OnnxSegmenter(graphs.save(model, tmp_path / "model.onnx"), threads=1, **options)(image)


PERSON, CONE = (20, 20, 10, 10, 0, 0.9, 1), (20, 20, 10, 10, 0.8, 0, 1)


def test_masks_are_cut_to_their_boxes(tmp_path):
    (mask,) = found(tmp_path, boxes((20.5, 20, 9, 10, 0, 0.9, 1)))
    assert (mask.category, mask.name, mask.score) == (1, "person", pytest.approx(0.9))
    assert mask.bounding_box == (15, 16, 10, 9)


def test_doubles_go_class_by_class(tmp_path):
    masks = found(tmp_path, boxes(CONE, PERSON, (21, 20, 10, 10, 0, 0.7, 1), (20, 20, 10, 10, 0, 0.2, 1)))
    assert [(mask.name, round(mask.score, 2)) for mask in masks] == [("person", 0.9), ("cone", 0.8)]
    assert masks.categories.tolist() == [1, 100]


def test_dimensions_may_be_unknown_until_the_model_runs(tmp_path):
    assert len(found(tmp_path, boxes(PERSON), sides=(1, "numbers", "boxes"))) == 1


def test_at_most_300(tmp_path):
    corners = [(5 * (k % 20), 5 * (k // 20), 4, 4, 0.9, 0, 1) for k in range(400)]
    masks = found(tmp_path, boxes(*corners, padding=400), image=np.zeros((64, 64, 3), np.uint8))
    assert 0 < len(masks) <= 300


@pytest.mark.parametrize(
    ("row", "count"),
    [
        pytest.param((20, 20, 0, 10, 0.9, 0, 1), 0, id="no width"),
        pytest.param((20, 20, -5, 10, 0.9, 0, 1), 0, id="negative width"),
        pytest.param((200, 20, 10, 10, 0.9, 0, 1), 0, id="off the image"),
        pytest.param((20, 20, 1e30, 1e30, 0.9, 0, 1), 1, id="huge"),
        pytest.param((20, 20, 10, 10, 0.9, 0, -1), 0, id="no logit above 0"),
    ],
)
def test_boxes_of_every_sort(row, count, tmp_path):
    assert len(found(tmp_path, boxes(row))) == count


def end_to_end(number):
    output = np.zeros((1, 5, 38), np.float32)
    output[0, 0, :7] = (10, 10, 20, 20, 0.9, number, 1)
    return output


@pytest.mark.parametrize(
    ("output", "prototypes", "error", "match"),
    [
        pytest.param(
            boxes((20, 20, 10, 10, np.nan, 0.9, 1)), PROTOTYPES, MaskError, "instance 0: score is nan", id="score NaN"
        ),
        pytest.param(boxes((20, 20, 10, 10, 0, 7, 1)), PROTOTYPES, MaskError, "instance 0: score is 7", id="score 7"),
        pytest.param(boxes((20, np.nan, 10, 10, 0, 0.9, 1)), PROTOTYPES, MaskError, "instance 0: box", id="box NaN"),
        pytest.param(
            boxes(CONE, (20, 20, 10, 10, 0, 0.9, np.nan)),
            PROTOTYPES,
            MaskError,
            "instance 1: mask coefficients",
            id="coefficient NaN",
        ),
        pytest.param(boxes(PERSON), PROTOTYPES * np.nan, FileFormatError, "output1: prototypes", id="prototypes NaN"),
        pytest.param(end_to_end(7), PROTOTYPES, MaskError, "instance 0: class 7 is unknown", id="class unknown"),
        pytest.param(end_to_end(np.nan), PROTOTYPES, MaskError, "instance 0: class -1", id="class NaN"),
        pytest.param(boxes(n_classes=5), PROTOTYPES, FileFormatError, "fits no version of YOLO", id="other classes"),
        pytest.param(boxes().repeat(2, 0), PROTOTYPES, FileFormatError, r"expected shape \(1, \*, \*\)", id="batch"),
    ],
)
def test_outputs_that_cannot_be(output, prototypes, error, match, tmp_path):
    with pytest.raises(error, match=match):
        found(tmp_path, output, prototypes)


@pytest.mark.parametrize(
    ("names", "error", "match"),
    [
        pytest.param("__import__('os').abort()", CorruptFileError, "no Python literal", id="code"),
        pytest.param("{0: 'cone'", CorruptFileError, "no Python literal", id="cut off"),
        pytest.param("((" * 9999, CorruptFileError, "no Python literal", id="nested deep"),
        pytest.param("{'a': 1}", CorruptFileError, "class numbers and names", id="no names"),
        pytest.param("{}", CorruptFileError, "class numbers and names", id="empty"),
        pytest.param(None, ParameterError, "the model has 2 classes and no names", id="missing"),
    ],
)
def test_names_that_cannot_be(names, error, match, tmp_path):
    with pytest.raises(error, match=match):
        found(tmp_path, boxes(PERSON), notes=None if names is None else {"names": names})


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        pytest.param({"notes": {"names": "['cone', 'dog']"}}, (18, "dog"), id="a list in the file"),
        pytest.param({"names": ["cone", "cat"]}, (17, "cat"), id="a list from the user, before the file's"),
        pytest.param({"notes": None, "names": {0: "a", 1: "b"}}, (101, "b"), id="a dict from the user"),
    ],
)
def test_names(options, expected, tmp_path):
    (mask,) = found(tmp_path, boxes(PERSON), **options)
    assert (mask.category, mask.name) == expected


def test_80_classes_are_coco_s(tmp_path):
    row = (20, 20, 10, 10, *np.eye(80)[79], 1)
    (mask,) = found(tmp_path, boxes(row, n_classes=80, padding=200), notes=None)
    assert (mask.category, mask.name) == (90, "toothbrush")
