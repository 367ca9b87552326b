"""Instance masks in `.npz` files: this package's run lengths, and the dense arrays of the LDLS research code."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

import ldls._ldls as _ldls
from ldls.categories import COCO_NAMES, CONTIGUOUS_IDS, folded
from ldls.checks import choice
from ldls.errors import MaskError, UnsupportedFormatError
from ldls.io.arrays import open_npz, write_npz
from ldls.masks import InstanceMasks
from ldls.masks.pixels import checked_size, encode

OWN_ARRAYS = {"size", "runs", "run_counts", "categories", "scores", "category_ids", "category_names"}
"""Arrays of this package's files."""


def read(path: str | PathLike[str]) -> InstanceMasks:
    """The masks of a file of either kind.

    Raises:
        UnsupportedFormatError: The arrays are of neither kind.
        MaskError: They do not fit one another.
        FileFormatError: It is not a whole `.npz` file, or holds Python objects.
    """
    with open_npz(path) as arrays:
        if arrays.keys() >= OWN_ARRAYS:
            return masks_of(arrays)
        if arrays.keys() >= {"masks", "class_ids", "scores"}:
            return _of_research_code(arrays)
        raise UnsupportedFormatError(
            f"found arrays {arrays.listed()}, expected those of ldls.save, "
            "or masks, class_ids and scores of the LDLS research code"
        )


def write(path: str | PathLike[str], masks: InstanceMasks, *, layout: Literal["runs", "research"] = "runs") -> None:
    """Write categories, scores, names and run lengths.

    Args:
        path: `.npz` file.
        masks: Masks.
        layout: "runs", or "research" for the dense arrays that the LDLS research code reads; it knows COCO's
            categories and no others.

    Raises:
        MaskError: The research code does not know a category.
    """
    layouts = {"runs": mask_arrays, "research": _research_arrays}
    write_npz(path, layouts[choice("layout", layout, layouts)](masks))


def mask_arrays(masks: InstanceMasks) -> dict[str, NDArray[Any]]:
    """Categories, scores, names and run lengths, each array by its name in the file."""
    runs = [mask.rle.runs() for mask in masks]
    return {
        "size": np.array(masks.image_size, np.int64),
        "runs": np.concatenate([np.zeros(0, np.uint32), *runs]),
        "run_counts": np.array([len(r) for r in runs], np.int64),
        "categories": masks.categories,
        "scores": masks.scores,
        "category_ids": np.array(list(masks.names), np.int64),
        "category_names": np.array(list(masks.names.values()), np.str_),
    }


def masks_of(arrays: Mapping[str, NDArray[Any]]) -> InstanceMasks:
    """The masks of arrays that `mask_arrays` made.

    Raises:
        MaskError: They do not fit one another.
        KeyError: One is missing.
    """
    height, width = checked_size(arrays["size"].tolist())
    runs, counts = arrays["runs"], arrays["run_counts"]
    if runs.dtype != np.uint32 or runs.ndim != 1 or counts.dtype.kind not in "iu" or counts.ndim != 1:
        raise MaskError(
            f"runs and run_counts: expected (R,) uint32 and (M,) whole numbers, "
            f"got {runs.shape} {runs.dtype} and {counts.shape} {counts.dtype}"
        )
    ends = np.cumsum(counts)
    if ends.size and (counts.min() < 0 or ends[-1] != runs.size):
        raise MaskError(f"run_counts sum to {ends[-1]}, runs holds {runs.size}")
    split = np.split(runs, ends[:-1]) if ends.size else []
    ids, words = arrays["category_ids"], arrays["category_names"]
    if ids.dtype.kind not in "iu" or ids.ndim != 1 or words.shape != ids.shape:
        raise MaskError(
            f"category_ids and category_names: expected (C,) whole numbers and a name for each, "
            f"got {ids.shape} {ids.dtype} and {words.shape}"
        )
    return InstanceMasks(
        [_ldls.Rle.from_runs(height, width, np.ascontiguousarray(runs)) for runs in split],
        (height, width),
        categories=arrays["categories"],
        scores=arrays["scores"],
        names={category: str(name) for category, name in zip(ids.tolist(), words.tolist(), strict=True)},
    )


def _research_arrays(masks: InstanceMasks) -> dict[str, NDArray[Any]]:
    for i, mask in enumerate(masks):
        if COCO_NAMES.get(mask.category) != folded(mask.name):
            raise MaskError(
                f"mask {i}: category {mask.category} {mask.name!r} is not COCO's, and the research code knows no "
                "others; filter it out or write the other layout"
            )
    height, width = masks.image_size
    pixels = np.zeros((height, width, len(masks)), np.bool_)
    for i, mask in enumerate(masks):
        pixels[:, :, i] = mask.to_array()
    boxes = np.array([mask.bounding_box for mask in masks], np.int32).reshape(-1, 4)
    boxes[:, 2:] += boxes[:, :2]  # top, left, bottom, right
    return {
        "shape": np.array(masks.image_size, np.int64),
        "rois": boxes,
        "masks": pixels,
        "class_ids": np.array([CONTIGUOUS_IDS.index(c) + 1 for c in masks.categories.tolist()], np.int32),
        "scores": masks.scores,
    }


def _of_research_code(arrays: Mapping[str, NDArray[Any]]) -> InstanceMasks:
    masks, classes = arrays["masks"], arrays["class_ids"]
    if masks.ndim != 3 or classes.shape != masks.shape[2:]:
        raise MaskError(f"masks: expected (height, width, {classes.size}), got {masks.shape}; one mask a class id")
    wrong = ~((classes >= 1) & (classes <= len(CONTIGUOUS_IDS)))
    if wrong.any():
        raise MaskError(f"class_ids: {classes[wrong][0]} at {wrong.argmax()}, expected 1 to 80")
    return InstanceMasks(
        [encode(m, masks[:, :, m]) for m in range(classes.size)],
        checked_size(masks.shape[:2]),
        categories=np.array(CONTIGUOUS_IDS, np.int32)[classes - 1],
        scores=arrays["scores"],
        names=COCO_NAMES,
    )
