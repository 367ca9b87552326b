"""Views: the masks of an image and the camera that took it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera
from ldls.checks import checked
from ldls.errors import MaskError
from ldls.masks import InstanceMasks


@checked
@dataclass(frozen=True, eq=False)
class View:
    """Instance masks of an image, and the camera that took it.

    Attributes:
        masks: Instance masks of the image.
        camera: The camera.
        name: What to call it, as "CAM_FRONT"; "camera 0", "camera 1" and so on without one.

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
class SeenView:
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


def camera_names(views: Sequence[SeenView]) -> tuple[str, ...]:
    """Name of each view: its own, or "camera 0", "camera 1" and so on where it has none."""
    return tuple(seen.view.name or f"camera {number}" for number, seen in enumerate(views))
