"""Instance masks in `.npz` files: this package's run lengths, and the dense arrays of the LDLS research code."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ldls import _ldls
from ldls.categories import COCO_NAMES, CONTIGUOUS_IDS
from ldls.errors import MaskError, UnsupportedFormatError
from ldls.io.masks.records import MaskRecords
from ldls.io.npz import read_npz, write_npz

if TYPE_CHECKING:
    from ldls.masks import InstanceMasks


def read(path: str | PathLike[str]) -> MaskRecords:
    """The masks of a file of either kind.

    Raises:
        UnsupportedFormatError: The arrays are of neither kind.
        MaskError: They do not fit one another.
    """
    arrays = read_npz(path)
    try:
        if {"size", "runs", "run_counts", "categories", "scores"} <= arrays.keys():
            return _from_runs(arrays)
        if {"masks", "class_ids", "scores"} <= arrays.keys():
            return _from_research_code(arrays)
    except (MaskError, IndexError, ValueError) as error:
        raise MaskError(f"{path}: {error}") from None
    raise UnsupportedFormatError(
        f"{path}: found arrays {sorted(arrays)}, expected those of InstanceMasks.save, "
        "or masks, class_ids and scores of the LDLS research code"
    )


def write(path: str | PathLike[str], masks: InstanceMasks) -> None:
    """Write run lengths, categories, scores and names."""
    runs = [mask.rle.runs() for mask in masks]
    write_npz(
        path,
        {
            "size": np.array(masks.image_size, np.int64),
            "runs": np.concatenate([np.zeros(0, np.uint32), *runs]),
            "run_counts": np.array([len(r) for r in runs], np.int64),
            "categories": masks.categories,
            "scores": masks.scores,
            "category_ids": np.array(list(masks.names), np.int64),
            "category_names": np.array(list(masks.names.values()), np.str_),
        },
    )


def _from_runs(arrays: dict[str, NDArray[Any]]) -> MaskRecords:
    height, width = (int(s) for s in arrays["size"])
    ends = np.cumsum(arrays["run_counts"])
    if ends.size and (arrays["run_counts"].min() < 0 or ends[-1] != arrays["runs"].size):
        raise MaskError(f"run_counts sum to {ends[-1]}, runs holds {arrays['runs'].size}")
    split = np.split(arrays["runs"].astype(np.uint32), ends[:-1]) if ends.size else []
    names = zip(arrays["category_ids"].tolist(), arrays["category_names"].tolist(), strict=True)
    return MaskRecords(
        size=(height, width),
        rles=[_ldls.Rle.from_runs(height, width, np.ascontiguousarray(runs)) for runs in split],
        categories=arrays["categories"],
        scores=arrays["scores"],
        names=dict(names),
    )


def _from_research_code(arrays: dict[str, NDArray[Any]]) -> MaskRecords:
    masks, classes = arrays["masks"], arrays["class_ids"]
    if masks.ndim != 3 or masks.shape[2] != classes.size:
        raise MaskError(f"masks: expected (height, width, {classes.size}), got {masks.shape}; one mask a class id")
    wrong = (classes < 1) | (classes > len(CONTIGUOUS_IDS))
    if wrong.any():
        raise MaskError(f"class_ids: {classes[wrong][0]} at {wrong.argmax()}, expected 1 to 80")
    pixels = (np.ascontiguousarray(masks[:, :, m] != 0) for m in range(classes.size))
    return MaskRecords(
        size=(masks.shape[0], masks.shape[1]),
        rles=[_ldls.Rle.from_pixels(mask) for mask in pixels],
        categories=np.array(CONTIGUOUS_IDS, np.int32)[classes - 1],
        scores=arrays["scores"].astype(np.float32),
        names=COCO_NAMES,
    )
