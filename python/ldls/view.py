"""Views: the masks of an image and the camera that took it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ldls.by_value import ByValue
from ldls.camera import Camera
from ldls.categories import class_id
from ldls.checks import checked
from ldls.errors import InputError, MaskError
from ldls.masks import InstanceMasks


@checked
@dataclass(frozen=True)
class View:
    """Instance masks of an image, and the camera that took it.

    Attributes:
        masks: Instance masks of the image.
        camera: The camera.
        name: What to call it, as "CAM_FRONT", other than the views beside it; "camera 0", "camera 1" and so on without
            one.

    Raises:
        InputError: One is of another type.
        MaskError: The masks are of an image of another size than the camera's.
    """

    masks: InstanceMasks
    camera: Camera
    name: str = ""

    def __post_init__(self) -> None:
        expected, size = self.camera.image_size, self.masks.image_size
        if expected is not None and size != tuple(expected):
            hint = "; swapped?" if size == tuple(expected)[::-1] else ""
            raise MaskError(f"masks: {size}, the camera's image is {expected}{hint}")


@dataclass(frozen=True, eq=False, kw_only=True)
class SeenView(ByValue):
    """A view, with the points that it sees and their labels.

    Attributes:
        view: Masks and camera.
        in_view: (n,) int64: indices of the points that the camera sees, ascending.
        pixels: (n, 2) float64: u (right) and v (down) of these points in pixels.
        labels: (M,) int32: label in the whole result of each of the M masks.
    """

    view: View
    in_view: NDArray[np.int64]
    pixels: NDArray[np.float64]
    labels: NDArray[np.int32]


def common_categories(views: Sequence[View]) -> tuple[list[list[int]], Mapping[int, str]]:
    """Category id of each mask of each view, and the name of each id.

    They are those of the masks, except that a class has one id in all views whose masks do not have the same names.
    """
    own = [view.masks.categories.tolist() for view in views]
    tables = [view.masks.names for view in views]
    if all(table == tables[0] for table in tables):
        return own, tables[0] if tables else {}
    known: dict[int, str] = {}
    common = []
    for categories, table in zip(own, tables, strict=True):
        ids = {each: class_id(each, table[each], known) for each in dict.fromkeys(categories)}
        common.append([ids[each] for each in categories])
    return common, known


def camera_names(views: Sequence[SeenView]) -> tuple[str, ...]:
    """Name of each view: its own, or "camera 0", "camera 1" and so on where it has none."""
    return _names([seen.view for seen in views])


def check_names(views: Sequence[View]) -> None:
    """Refuse views of one name, which pictures, recordings and files could not tell apart.

    Raises:
        InputError: Two have the same.
    """
    name, count = next(iter(Counter(_names(views)).most_common(1)), ("", 0))
    if count > 1:
        raise InputError(f"views: {count} have the name {name!r}, expected one each; give others by View(..., name=)")


def _names(views: Sequence[View]) -> tuple[str, ...]:
    return tuple(view.name or f"camera {number}" for number, view in enumerate(views))
