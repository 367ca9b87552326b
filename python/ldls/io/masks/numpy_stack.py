"""Stacks of masks in `.npy` files: pixels, and nothing else."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from typing import Any

from numpy.lib.format import write_array_header_1_0
from numpy.typing import ArrayLike, NDArray

from ldls.errors import MaskError, within
from ldls.io.arrays import read_npy
from ldls.io.files import whole_file
from ldls.masks import InstanceMasks


def read(
    path: str | PathLike[str],
    *,
    image_size: tuple[int, int] | None = None,
    instance_axis: int | None = None,
    categories: ArrayLike | None = None,
    scores: ArrayLike | None = None,
    names: Mapping[int, str] | None = None,
) -> InstanceMasks:
    """The masks of an array of (M, H, W) or (H, W, M).

    Args:
        path: `.npy` file: bool, 0 and 1, 0 and 255, or probabilities.
        image_size: (height, width) in pixels, which tells the two layouts apart.
        instance_axis: 0 or -1, the axis that counts the masks. With neither it is the first, unless the last is
            shorter: then the file is refused.
        categories: (M,) category ids; without them all are category 1, "object".
        scores: (M,) scores from 0 to 1; all 1 without them.
        names: Name of each category id.

    Raises:
        MaskError: Either axis may count the masks, or the values are no masks.
        FileFormatError: It is not a whole `.npy` file, or holds Python objects.
    """
    stack = read_npy(path)
    if stack.ndim != 3:
        raise MaskError(
            f"{path}: expected (M, height, width) or (height, width, M), got shape {stack.shape}; "
            "InstanceMasks.from_instance_image takes an image of instance numbers"
        )
    axis = _instance_axis(path, stack, image_size) if instance_axis is None else instance_axis
    size = stack.shape[1:] if axis == 0 else stack.shape[:2]
    with within(path):
        return InstanceMasks.from_array(
            stack,
            categories=categories,
            scores=scores,
            names=names,
            image_size=(size[0], size[1]),
            instance_axis=axis,
        )


def write(path: str | PathLike[str], masks: InstanceMasks, *, pixels_only: bool = False) -> None:
    """Write an (M, H, W) array of bool, one mask at a time.

    Args:
        path: `.npy` file.
        masks: Masks.
        pixels_only: True if categories, scores and names may be lost.

    Raises:
        MaskError: They would be lost, for they are not those of masks that come from a `.npy` file.
    """
    plain = (masks.scores == 1).all() and (masks.categories == 1).all() and masks.names == {1: "object"}
    if not pixels_only and not plain:
        raise MaskError(
            f"{path}: .npy files keep pixels only; save as .npz, .json or .png to keep categories, scores and names, "
            "or pass pixels_only=True"
        )
    with whole_file(path) as file:
        shape = (len(masks), *masks.image_size)
        write_array_header_1_0(file, {"descr": "|b1", "fortran_order": False, "shape": shape})
        for mask in masks:
            file.write(mask.to_array().tobytes())


def _instance_axis(place: str | PathLike[str], stack: NDArray[Any], image_size: tuple[int, int] | None) -> int:
    first, middle, last = stack.shape
    sizes = {0: (middle, last), -1: (first, middle)}
    fitting = [axis for axis, size in sizes.items() if image_size is None or size == tuple(image_size)]
    if len(fitting) == 1:
        return fitting[0]
    if image_size is None and first <= last:
        return 0
    layouts = f"{first} masks of {middle} x {last} or {last} of {first} x {middle}"
    mend = "pass instance_axis=0 or instance_axis=-1" if fitting else f"the image is {tuple(image_size or ())}"
    raise MaskError(f"{place}: shape {stack.shape} holds {layouts} pixels; {mend}")
