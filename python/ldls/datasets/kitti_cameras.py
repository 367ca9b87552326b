"""KITTI's cameras: 0 and 1 grey, 2 and 3 in colour; images of one number lie in one folder."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from ldls.camera import Camera
from ldls.datasets.frame import CameraImage
from ldls.errors import ParameterError
from ldls.io.images import read_image, read_image_size


def camera_numbers(camera: int | Sequence[int]) -> tuple[int, ...]:
    """The numbers of one camera or several.

    Raises:
        ParameterError: There is none, one stands there twice, or one is not 0 to 3.
    """
    numbers = (camera,) if isinstance(camera, int) else tuple(camera)
    if not numbers or len(set(numbers)) != len(numbers) or not set(numbers) <= set(range(4)):
        raise ParameterError(f"camera: got {camera!r}, expected a number from 0 to 3, or several different ones")
    return numbers


def image_from_file(
    name: str, path: Path, make: Callable[[tuple[int, int]], Camera], *, stamp: float | None = None
) -> CameraImage:
    """An image whose camera `make` makes from its size (height, width)."""
    return CameraImage(
        name=name, camera=make(read_image_size(path)), read=partial(read_image, path), stamp=stamp, path=path
    )
