"""Images of instance numbers: the value of a pixel says whose it is, 0 is background."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import ldls._ldls as _ldls
from ldls.categories import is_object
from ldls.checks import as_array
from ldls.errors import MaskError, ParameterError
from ldls.masks.pixels import check_pixels

CITYSCAPES_DIVISOR = 1000


def arguments(
    image: ArrayLike,
    *,
    categories: ArrayLike | None = None,
    scores: ArrayLike | None = None,
    names: Mapping[int, str] | None = None,
    class_divisor: int | None = None,
) -> dict[str, Any]:
    """Arguments of `InstanceMasks` from an image of instance numbers, in ascending order of the numbers.

    Args:
        image: (H, W) whole numbers, 0 where there is no instance.
        categories: One for all, or one for each number found; without them all are category 1, "object".
        scores: As `categories`; all 1 without them.
        names: Name of each category id.
        class_divisor: Where numbers hold the class as well, what to divide them by: the quotient is the category, and
            a remainder of 0 is background. KITTI's images have 256, KITTI-360's 1000, below which is background.
            Cityscapes' numbers begin at 0, as 26000, which only `read_masks` of its files knows.

    Raises:
        MaskError: Another shape, or values that are no instance numbers.
        ParameterError: Both `categories` and `class_divisor`, or a divisor below 2.
    """
    numbers, rles = split(image)
    if class_divisor is not None:
        if categories is not None or class_divisor < 2:
            raise ParameterError(
                f"class_divisor: got {class_divisor}, expected 2 or more, and no categories beside it; "
                "the quotient is the category"
            )
        # below 1000 there are stuff and groups
        least = 1 if class_divisor == CITYSCAPES_DIVISOR else 0
        pairs = [divmod(int(number), class_divisor) for number in numbers]
        given = names or {}
        things = [
            category >= least and instance > 0 and is_object(given.get(category, "")) for category, instance in pairs
        ]
        rles = [rle for rle, is_thing in zip(rles, things, strict=True) if is_thing]
        categories = [category for (category, _), is_thing in zip(pairs, things, strict=True) if is_thing]
        names = {category: f"class {category}" for category in categories} | dict(given)
    height, width = np.shape(image)
    size = (height, width)
    return {"rles": rles, "image_size": size, "categories": categories, "scores": scores, "names": names}


def split(image: ArrayLike) -> tuple[NDArray[Any], list[_ldls.Rle]]:
    """The values of `image` that are not 0, in ascending order, and the pixels of each.

    Args:
        image: (H, W) whole numbers, 0 where there is no instance.

    Raises:
        MaskError: Another shape, or values that are no instance numbers.
    """
    values = as_array("instance image", image, MaskError)
    if values.dtype.kind not in "biu":
        raise MaskError(f"instance image: expected whole numbers, got {values.dtype}")
    if values.ndim != 2 or values.size == 0:
        raise MaskError(f"instance image: expected (height, width), got shape {values.shape}")
    check_pixels(*values.shape)
    if values.min() < 0:
        row, column = np.argwhere(values < 0)[0]
        raise MaskError(f"instance image: pixel ({row}, {column}) is {values[row, column]}, expected 0 or more")
    height, width = values.shape
    columns = values.ravel(order="F")
    starts = np.concatenate([[0], np.flatnonzero(columns[1:] != columns[:-1]) + 1])
    ends = np.append(starts[1:], columns.size)
    order = np.argsort(columns[starts], kind="stable")
    values_in_image, first = np.unique(columns[starts][order], return_index=True)
    spans = np.split(np.column_stack([starts, ends])[order], first[1:])
    rles = [_from_spans(s, height, width) for value, s in zip(values_in_image, spans, strict=True) if value]
    return values_in_image[values_in_image != 0], rles


def join(rles: Sequence[_ldls.Rle], image_size: tuple[int, int]) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """(H, W) numbers, m + 1 on the pixels of mask m and 0 elsewhere: uint8 up to 255 masks, else uint16.

    There are never more masks than 16 bits count.

    Raises:
        MaskError: Two masks share a pixel.
    """
    height, width = image_size
    spans = [_spans(rle) for rle in rles]
    owners = np.repeat(np.arange(len(rles)), [len(s) for s in spans])
    joined = np.concatenate([np.zeros((0, 2), np.int64), *spans])
    order = np.argsort(joined[:, 0], kind="stable")
    joined, owners = joined[order], owners[order]
    _refuse_overlaps(joined, owners, height)
    edges = np.concatenate([[0], joined.ravel(), [height * width]])
    values = np.zeros(len(edges) - 1, np.uint8 if len(rles) < 256 else np.uint16)
    values[1::2] = owners + 1
    return np.ascontiguousarray(np.repeat(values, np.diff(edges)).reshape(width, height).T)


def _spans(rle: _ldls.Rle) -> NDArray[np.int64]:
    """(S, 2) first pixel and end of each run of ones, counted column by column."""
    edges = np.cumsum(rle.runs(), dtype=np.int64)
    return edges[: len(edges) // 2 * 2].reshape(-1, 2)


def _from_spans(spans: NDArray[np.int64], height: int, width: int) -> _ldls.Rle:
    edges = np.concatenate([[0], spans.ravel(), [height * width]])
    return _ldls.Rle.from_runs(height, width, np.diff(edges).astype(np.uint32))


def _refuse_overlaps(spans: NDArray[np.int64], owners: NDArray[np.int64], height: int) -> None:
    overlap = spans[1:, 0] < spans[:-1, 1]
    if overlap.any():
        at = int(overlap.argmax())
        column, row = divmod(int(spans[at + 1, 0]), height)
        first, second = sorted((owners[at : at + 2] + 1).tolist())
        raise MaskError(
            f"masks of labels {first} and {second} share pixel ({row}, {column}), and an instance image gives each to "
            "one; .json and .npz hold masks that overlap; resolve_overlaps() leaves it to one"
        )
