"""YOLO models that segment: versions 5, 8 and 11, and exports that need no suppression of doubles."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls.cloud import Ints
from ldls.errors import CorruptFileError, FileFormatError, ParameterError, UnsupportedFormatError
from ldls.masks import InstanceMasks
from ldls.masks.letterbox import Letterbox
from ldls.masks.resampling import F32
from ldls.segmenters.classes import Classes, contiguous_coco_classes, named_classes
from ldls.segmenters.crops import Crop, assemble
from ldls.segmenters.onnx_graph import Signature, Value, image_input
from ldls.segmenters.outputs import check_finite, check_scores, expect_shape

N_COCO = 80
MAX_INSTANCES = 300
MAX_END_TO_END_ROWS = 1000
DEFAULT_SIDE = 640
STRIDE = 32


@dataclass(frozen=True, eq=False)
class Candidates:
    """Boxes before suppression: (n, 4) left, top, right, bottom in the input, (n,) scores, (n,) classes, (n, C)."""

    boxes: F32
    scores: F32
    classes: Ints
    coefficients: F32


@dataclass(frozen=True)
class Layout:
    """Layout of the first output.

    Attributes:
        name: `yolov8` (also 11): (1, 4 + classes + C, n); `yolov5`: (1, n, 5 + classes + C) with objectness;
            `end-to-end`: (1, n, 6 + C), done with suppression.
        n_classes: Number of classes; None where an end-to-end model does not say.
    """

    name: str
    n_classes: int | None

    @property
    def max_iou(self) -> float:
        """Largest overlap of two boxes of a class."""
        return {"yolov8": 0.7, "yolov5": 0.45, "end-to-end": 1.0}[self.name]

    def candidates(self, rows: F32) -> Candidates:
        """All that `rows`, the first output without its batch axis, holds."""
        if self.name == "end-to-end":
            return Candidates(rows[:, :4], check_scores(rows[:, 4]), _as_classes(rows[:, 5]), rows[:, 6:])
        n = self.n_classes or 0
        if self.name == "yolov5":
            of_classes, coefficients = rows[:, 5 : 5 + n] * rows[:, 4:5], rows[:, 5 + n :]
        else:
            rows = rows.T
            of_classes, coefficients = rows[:, 4 : 4 + n], rows[:, 4 + n :]
        # NaN is the largest for max, so none hides behind a good score
        scores = check_scores(of_classes.max(axis=1))
        return Candidates(_corners(rows[:, :4]), scores, of_classes.argmax(axis=1), coefficients)


@dataclass(frozen=True)
class YoloSeg:
    """A letterboxed image in; boxes with coefficients, and the prototypes that these weigh, out.

    Attributes:
        outputs: Names of the outputs: boxes, prototypes.
        classes: Its classes; None until the number of classes is known.
        n_named: How many classes are named, if they are.
        input_size: (height, width) of the network's input, or the most that it takes.
        stride: Multiple that its sides must be, where the input may vary.
    """

    outputs: tuple[str, ...]
    classes: Classes | None
    n_named: int | None
    input_size: tuple[int, int]
    stride: int | None

    @classmethod
    def of(cls, signature: Signature, names: Mapping[int, str] | None) -> YoloSeg:
        """The model of this signature.

        Raises:
            UnsupportedFormatError: Its outputs are of no known layout.
            CorruptFileError: Its metadata cannot be read.
            ParameterError: Its classes have no names; pass `names`.
        """
        first, second = segmentation_outputs(signature) or (None, None)
        if first is None or second is None:
            raise UnsupportedFormatError(f"{signature.source}: expected boxes and prototypes of YOLO, got {signature}")
        names = _names(signature) if names is None else names
        image = image_input(signature)
        fixed = all(isinstance(side, int) for side in (image.shape or ())[-2:])
        model = cls(
            outputs=(first.name, second.name),
            classes=None if names is None else named_classes(names),
            n_named=None if names is None else max(names, default=-1) + 1,
            input_size=_last_two(image) if fixed else _noted_size(signature),
            stride=None if fixed else STRIDE,
        )
        sizes = [side for side in (*(first.shape or ()), (second.shape or ())[1])[1:] if isinstance(side, int)]
        if len(sizes) == 3:  # what can be found out now need not wait for an image
            model._layout((sizes[0], sizes[1]), sizes[2])
        return model

    def tensor(self, image: NDArray[np.uint8]) -> F32:
        """(3, h, w) input for an image (H, W, 3)."""
        filled = self._letterbox((image.shape[0], image.shape[1])).fill(image)
        scaled: F32 = np.ascontiguousarray(filled.transpose(2, 0, 1), np.float32) / np.float32(255)
        return scaled

    def masks(self, outputs: list[NDArray[Any]], image_size: tuple[int, int], min_score: float) -> InstanceMasks:
        """Instances of at least `min_score`; a pixel counts where its logit is above 0."""
        expect_shape(self.outputs[0], outputs[0], (1, None, None))
        expect_shape(self.outputs[1], outputs[1], (1, None, None, None))
        rows, prototypes = (output[0].astype(np.float32) for output in outputs)
        layout, classes = self._layout(rows.shape, prototypes.shape[0])
        candidates = layout.candidates(rows)
        kept = _best(candidates, layout.max_iou, min_score)
        check_finite("mask coefficients", candidates.coefficients[kept], kept)
        _check_prototypes(self.outputs[1], prototypes)
        letterbox = self._letterbox(image_size)
        boxes = letterbox.boxes_in_image(candidates.boxes[kept])
        crops = _drawn(candidates, kept, boxes, prototypes, letterbox, classes)
        return assemble(crops, image_size, classes.names)

    def _letterbox(self, image_size: tuple[int, int]) -> Letterbox:
        return Letterbox.fit(image_size, self.input_size, stride=self.stride)

    def _layout(self, sides: tuple[int, ...], n_coefficients: int) -> tuple[Layout, Classes]:
        layout = layout_of((sides[0], sides[1]), n_coefficients, self.n_named)
        if layout is None:
            named = "" if self.n_named is None else f" and {self.n_named} classes"
            raise FileFormatError(
                f"output {self.outputs[0]}: (1, {sides[0]}, {sides[1]}) fits no version of YOLO with "
                f"{n_coefficients} prototypes{named}; check names"
            )
        if self.classes is not None:
            return layout, self.classes
        if layout.n_classes == N_COCO:
            return layout, contiguous_coco_classes(0)
        known = "an unknown number of" if layout.n_classes is None else str(layout.n_classes)
        raise ParameterError(f"names: needed, as the model has {known} classes and no names in its metadata")


def segmentation_outputs(signature: Signature) -> tuple[Value, Value] | None:
    """The outputs with boxes (1, a, b) and prototypes (1, C, h, w), if the model has just one of each."""
    boxes = [value for value in signature.outputs if value.is_float and value.rank == 3]
    prototypes = [value for value in signature.outputs if value.is_float and value.rank == 4]
    if len(boxes) != 1 or len(prototypes) != 1:
        return None
    return boxes[0], prototypes[0]


def layout_of(sides: tuple[int, int], n_coefficients: int, n_classes: int | None) -> Layout | None:
    """Layout of a first output of (1, *sides); None if it fits none."""
    first, second = sides
    if second == 6 + n_coefficients and first <= MAX_END_TO_END_ROWS:
        return Layout("end-to-end", n_classes)
    possible = [Layout("yolov8", first - 4 - n_coefficients), Layout("yolov5", second - 5 - n_coefficients)]
    if n_classes is None:  # there are more boxes than numbers to a box
        possible = possible[:1] if first < second else possible[1:]
    fits = (layout for layout in possible if n_classes in (None, layout.n_classes) and (layout.n_classes or 0) > 0)
    return next(fits, None)


def _best(candidates: Candidates, max_iou: float, min_score: float) -> Ints:
    sure = np.flatnonzero(candidates.scores >= np.float32(min_score))
    boxes, scores, classes = candidates.boxes[sure], candidates.scores[sure], candidates.classes[sure]
    check_finite("box", boxes, sure)
    if max_iou >= 1:
        return sure[:MAX_INSTANCES]
    return sure[suppress(boxes, scores, classes, max_iou=max_iou, max_kept=MAX_INSTANCES)]


def suppress(boxes: F32, scores: F32, classes: Ints, *, max_iou: float, max_kept: int) -> Ints:
    """Indices of the boxes that no better box of their class overlaps by more than `max_iou`, best first.

    Args:
        boxes: (N, 4) left, top, right, bottom.
        scores: (N,) scores; of equal ones the first is the better.
        classes: (N,) classes.
        max_iou: Largest overlap, as intersection over union, of two boxes that are both kept.
        max_kept: How many are kept at most.
    """
    left, top, right, bottom = boxes.T.astype(np.float64)  # areas of huge boxes overflow in single precision
    areas = (right - left) * (bottom - top)
    waiting = np.argsort(-scores, kind="stable")
    kept: list[int] = []
    while waiting.size and len(kept) < max_kept:
        best, waiting = waiting[0], waiting[1:]
        kept.append(int(best))
        wide = np.minimum(right[best], right[waiting]) - np.maximum(left[best], left[waiting])
        tall = np.minimum(bottom[best], bottom[waiting]) - np.maximum(top[best], top[waiting])
        shared = np.maximum(wide, 0) * np.maximum(tall, 0)
        # no division: boxes without area overlap nothing
        hidden = (shared > max_iou * (areas[best] + areas[waiting] - shared)) & (classes[waiting] == classes[best])
        waiting = waiting[~hidden]
    return np.array(kept, np.int64)


def _check_prototypes(name: str, prototypes: F32) -> None:
    if not np.isfinite(prototypes).all():
        raise FileFormatError(
            f"output {name}: prototypes hold NaN or infinity; the model may have lost precision when it was exported"
        )


def _drawn(
    candidates: Candidates, kept: Ints, boxes: F32, prototypes: F32, letterbox: Letterbox, classes: Classes
) -> Iterator[Crop]:
    """Masks within their boxes: a pixel belongs to a box from its first edge on and before its last."""
    if not len(kept):
        return
    grids = np.tensordot(candidates.coefficients[kept], prototypes, axes=1)
    rows, columns = letterbox.upsampling((prototypes.shape[1], prototypes.shape[2]))
    for i, box, grid in zip(kept.tolist(), np.ceil(boxes).astype(np.int64).tolist(), grids, strict=True):
        left, top, right, bottom = box
        with np.errstate(over="ignore", invalid="ignore"):  # finite, but too large to add: such pixels are left out
            logits = rows[top : max(top, bottom)] @ grid @ columns[left : max(left, right)].T
        category = classes.id(i, int(candidates.classes[i]))
        yield Crop(logits > 0, top, left, category, float(candidates.scores[i]))


def _corners(centred: F32) -> F32:
    middle, half = centred[:, :2], centred[:, 2:] / 2
    with np.errstate(over="ignore", invalid="ignore"):  # what is kept is held to be finite later
        return np.concatenate([middle - half, middle + half], axis=1)


def _as_classes(numbers: F32) -> Ints:
    return np.where(np.isfinite(numbers), numbers, -1).astype(np.int64)


def _names(signature: Signature) -> dict[int, str] | None:
    """Class names from the metadata, which hold them as Python writes a dict or list."""
    names = _literal(signature, "names")
    if isinstance(names, list | tuple):
        names = dict(enumerate(names))
    if names is None:
        return None
    sound = isinstance(names, dict) and all(isinstance(k, int) and isinstance(v, str) for k, v in names.items())
    if not sound or not names:
        raise CorruptFileError(f"{signature.source}: metadata names: expected class numbers and names, got {names!r}")
    return names  # type: ignore[no-any-return]


def _noted_size(signature: Signature) -> tuple[int, int]:
    """(height, width) that a model was exported for, where its input may vary."""
    size = _literal(signature, "imgsz")
    size = DEFAULT_SIDE if size is None else size
    sides = [size] * 2 if isinstance(size, int) else size
    sound = isinstance(sides, list | tuple) and len(sides) == 2 and all(isinstance(s, int) and s > 0 for s in sides)
    if not sound:
        raise CorruptFileError(f"{signature.source}: metadata imgsz: expected [height, width], got {size!r}")
    return sides[0], sides[1]


def _literal(signature: Signature, key: str) -> Any:  # noqa: ANN401
    text = signature.notes.get(key)
    if text is None:
        return None
    try:
        return ast.literal_eval(text)  # never eval: the file is not trusted
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        raise CorruptFileError(f"{signature.source}: metadata {key}: no Python literal: {text[:60]!r}") from None


def _last_two(image: Value) -> tuple[int, int]:
    height, width = (image.shape or ())[-2:]
    return int(height), int(width)
