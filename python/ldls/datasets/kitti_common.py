"""Cameras as all of KITTI's data sets number them."""

from __future__ import annotations

from collections.abc import Sequence

from ldls.errors import ParameterError


def camera_numbers(camera: int | Sequence[int]) -> tuple[int, ...]:
    """The numbers of one camera or several: 0 and 1 are grey, 2 and 3 in colour.

    Raises:
        ParameterError: There is none, one stands there twice, or one is not 0 to 3.
    """
    numbers = (camera,) if isinstance(camera, int) else tuple(camera)
    if not numbers or len(set(numbers)) != len(numbers) or not set(numbers) <= set(range(4)):
        raise ParameterError(f"camera: got {camera!r}, expected a number from 0 to 3, or several different ones")
    return numbers
