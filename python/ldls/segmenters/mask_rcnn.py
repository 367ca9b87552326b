"""Mask R-CNN as torchvision exports it and as the ONNX Model Zoo ships it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ldls.errors import FileFormatError, LimitError
from ldls.masks import InstanceMasks
from ldls.masks.resampling import F32
from ldls.segmenters.classes import Classes
from ldls.segmenters.crops import Crop, assemble
from ldls.segmenters.onnx_graph import Signature, Value
from ldls.segmenters.outputs import check_finite, check_scores, expect_shape
from ldls.segmenters.pasting import padded_paste, plain_paste

ROLES = ("boxes", "labels", "scores", "masks")
ZOO_CELLS = 28
ZOO_SHORT_SIDE = 800.0
ZOO_STRIDE = 32
ZOO_MAX_PIXELS = 1 << 25
ZOO_MEAN_BGR = np.array([102.9801, 115.9465, 122.7717], np.float32)
MAX_CELLS = 112
"""Masks up to this side are grids to be pasted; larger ones must be of the image's size."""
HALF = np.float32(0.5)
Paste = Callable[[F32, F32, tuple[int, int]], tuple[F32, int, int]]


@dataclass(frozen=True, eq=False)
class _Detection:
    """Instance `index` of the outputs: its box (left, top, right, bottom in pixels), category id and score."""

    index: int
    box: F32
    category: int
    score: float


@dataclass(frozen=True)
class MaskRcnn:
    """As torchvision exports it: RGB from 0 to 1; masks of the whole image, or grids for `padded_paste`."""

    outputs: tuple[str, ...]
    classes: Classes

    def tensor(self, image: NDArray[np.uint8]) -> F32:
        """(3, H, W) input for an image (H, W, 3)."""
        scaled: F32 = image.transpose(2, 0, 1).astype(np.float32) / np.float32(255)
        return scaled

    def masks(self, outputs: list[NDArray[Any]], image_size: tuple[int, int], min_score: float) -> InstanceMasks:
        """Instances of at least `min_score`; a pixel counts from probability 0.5."""
        detections = _detections(outputs, self.classes, min_score)
        crops: Iterable[Crop]
        if outputs[3].shape[2:] == image_size:
            crops = _whole(outputs[3], detections)
        else:
            grids = _small_grids(outputs[3], detections, image_size)
            crops = _pasted(padded_paste, detections, grids, image_size, HALF)
        return assemble(crops, image_size, self.classes.names)


@dataclass(frozen=True)
class ZooMaskRcnn:
    """As the ONNX Model Zoo ships it: BGR less its mean, the short side 800 pixels, padded to multiples of 32."""

    outputs: tuple[str, ...]
    classes: Classes

    def tensor(self, image: NDArray[np.uint8]) -> F32:
        """(3, h, w) input for an image (H, W, 3).

        Raises:
            LimitError: The image is so long and narrow that the input would have more than `ZOO_MAX_PIXELS`.
        """
        height, width = image.shape[:2]
        ratio = _zoo_ratio((height, width))
        size = (int(ratio * width), int(ratio * height))
        if size[0] * size[1] > ZOO_MAX_PIXELS:
            raise LimitError(
                f"image: {height} x {width} pixels make an input of {size[1]} x {size[0]}, "
                f"expected at most {ZOO_MAX_PIXELS} pixels; cut it into pieces"
            )
        resized = np.asarray(Image.fromarray(image).resize(size, Image.Resampling.BILINEAR))
        padded = np.zeros((3, *(math.ceil(side / ZOO_STRIDE) * ZOO_STRIDE for side in size[::-1])), np.float32)
        padded[:, : size[1], : size[0]] = (resized[:, :, ::-1] - ZOO_MEAN_BGR).transpose(2, 0, 1)
        return padded

    def masks(self, outputs: list[NDArray[Any]], image_size: tuple[int, int], min_score: float) -> InstanceMasks:
        """Instances of at least `min_score`; a pixel counts above probability 0.5."""
        ratio = np.float32(_zoo_ratio(image_size))
        detections = [replace(one, box=one.box / ratio) for one in _detections(outputs, self.classes, min_score)]
        grids = _small_grids(outputs[3], detections, image_size)
        crops = _pasted(plain_paste, detections, grids, image_size, np.nextafter(HALF, np.float32(1)))
        return assemble(crops, image_size, self.classes.names)


def detection_outputs(signature: Signature) -> tuple[str, ...] | None:
    """Names of the outputs that are boxes, labels, scores and masks; None if they are not these four.

    Outputs called so are taken by name, others by type and number of sides.
    """
    by_name = {value.name: value for value in signature.outputs}
    if len(signature.outputs) != 4:
        return None
    if set(ROLES) <= by_name.keys():
        return ROLES
    roles = {_role(value): value.name for value in signature.outputs}
    return tuple(roles[role] for role in ROLES) if set(ROLES) <= roles.keys() else None


def zoo_masks(signature: Signature) -> bool:
    """Return True if input and masks are those of the zoo: `image` (3, height, width) and grids of 28 x 28."""
    outputs = {value.name: value for value in signature.outputs}
    names = detection_outputs(signature)
    image = signature.image
    return (
        image is not None
        and names is not None
        and image.name == "image"
        and image.shape == (3, "height", "width")
        and (outputs[names[3]].shape or ())[2:] == (ZOO_CELLS, ZOO_CELLS)
    )


def _role(value: Value) -> str:
    if value.is_float and value.may_be(None):
        return "scores"
    if value.is_float and value.may_be(None, 4):
        return "boxes"
    if value.is_float and value.may_be(None, 1, None, None):
        return "masks"
    return "labels" if value.dtype.startswith("int") and value.may_be(None) else ""


def _detections(outputs: list[NDArray[Any]], classes: Classes, min_score: float) -> list[_Detection]:
    """Return the network's instances with at least `min_score`, in its order."""
    boxes, labels, scores, masks = outputs
    expect_shape("scores", scores, (None,))
    expect_shape("boxes", boxes, (len(scores), 4))
    expect_shape("labels", labels, (len(scores),))
    expect_shape("masks", masks, (len(scores), 1, None, None))
    sure = check_scores(scores)
    kept = np.flatnonzero(sure >= np.float32(min_score))
    check_finite("box", boxes[kept], kept)
    return [
        _Detection(i, boxes[i].astype(np.float32), classes.id(i, int(labels[i])), float(sure[i])) for i in kept.tolist()
    ]


def _whole(masks: NDArray[Any], detections: list[_Detection]) -> Iterator[Crop]:
    for one in detections:
        probabilities = masks[one.index]
        check_finite("mask", probabilities, np.array([one.index]))
        yield Crop(probabilities[0] >= HALF, 0, 0, one.category, one.score)


def _small_grids(masks: NDArray[Any], detections: list[_Detection], image_size: tuple[int, int]) -> F32:
    """(n, S, S) probabilities of what was found."""
    height, width = masks.shape[2:]
    if detections and (height != width or not 0 < height <= MAX_CELLS):
        raise FileFormatError(
            f"output masks: {height} x {width} cells, expected those of the image, {image_size[0]} x {image_size[1]}, "
            f"or squares of at most {MAX_CELLS}"
        )
    kept = np.array([one.index for one in detections], np.int64)
    grids: F32 = masks[kept, 0].astype(np.float32)
    check_finite("mask", grids, kept)
    return grids


def _pasted(
    paste: Paste, detections: list[_Detection], grids: F32, image_size: tuple[int, int], lowest: np.float32
) -> Iterator[Crop]:
    for one, grid in zip(detections, grids, strict=True):
        left, top, right, bottom = one.box
        if left < right and top < bottom:
            probabilities, row, column = paste(grid, one.box, image_size)
            yield Crop(probabilities >= lowest, row, column, one.category, one.score)


def _zoo_ratio(image_size: tuple[int, int]) -> float:
    return ZOO_SHORT_SIDE / min(image_size)
