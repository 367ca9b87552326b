"""The point of a result that a word on the command line names."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.errors import InputError, ParameterError, within
from ldls.segmentation import Segmentation
from ldls.view import camera_names

FAR_SHARE = 0.015
"""Share of the image's width beyond which the nearest point is not the one that was meant: half the gap of 16 beams."""
FAR_M = 1.0
EXPECTED = "a row number as 12345, a pixel U,V as 610,180 or a place X,Y,Z in metres as 12.5,-3,0.2"


@dataclass(frozen=True, kw_only=True)
class ChosenPoint:
    """A point and how it was chosen.

    Attributes:
        row: Its row in the cloud.
        how: What it is nearest to and how near; empty where the row was given.
    """

    row: int
    how: str = ""


def chosen_point(
    word: str, result: Segmentation, camera: str | None = None, picture: Path | None = None
) -> ChosenPoint:
    """The point that `word` means: the row itself, the point in view nearest to a pixel, or nearest to a place.

    Args:
        word: A row number, U,V in pixels, or X,Y,Z in metres.
        result: What to look in.
        camera: Name or number of the view that a pixel belongs to; only a ring needs it.
        picture: The picture of the result that a pixel was read from; that of the camera without it.

    Raises:
        ParameterError: The word is none of these, or there is no such camera, or none is needed.
        InputError: No point can be nearest: there is no camera, none is in view, or none is finite; the nearest is
            too far off to be meant; or the picture is none of the result.
    """
    numbers = _numbers(word)
    if len(numbers) == 2 and picture is not None:
        if camera is not None:
            raise ParameterError(f"--camera: got {camera!r} beside --on, whose pixels tell their camera; leave it out")
        number, u, v = _on_picture(result, picture, (numbers[0], numbers[1]))
        return _nearest_to_pixel(result, number, np.array((u, v)), mend="")
    if picture is not None:
        raise ParameterError(f"--on: got {picture} beside {word!r}; only a pixel U,V lies on a picture")
    if len(numbers) == 2:
        drawn = "; a pixel of a picture that ldls drew needs --on PICTURE"
        return _nearest_to_pixel(result, _view_of(result, camera), np.array(numbers), mend=drawn)
    if camera is not None:
        _view_of(result, camera)
        if len(result.views) > 1:
            raise ParameterError(f"--camera: got {camera!r} beside {word!r}; only a pixel U,V belongs to a camera")
    if len(numbers) == 3:
        return _nearest_to_place(result, np.array(numbers))
    return ChosenPoint(row=_row(word))


def _numbers(word: str) -> tuple[float, ...]:
    try:
        numbers = tuple(float(part) for part in word.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) not in (1, 2, 3) or not all(map(math.isfinite, numbers)):
        raise ParameterError(f"POINT: got {word!r}, expected {EXPECTED}")
    return numbers


def _row(word: str) -> int:
    try:
        return int(word)
    except ValueError:
        raise ParameterError(f"POINT: got {word!r}, expected {EXPECTED}") from None


def _view_of(result: Segmentation, camera: str | None) -> int:
    if not result.views:
        raise InputError("POINT: got a pixel, and there is no camera; give a row number or X,Y,Z")
    names = camera_names(result.views)
    if camera is None and len(names) == 1:
        return 0
    listed = ", ".join(f"{number} ({name})" for number, name in enumerate(names))
    if camera is None:
        raise ParameterError(f"--camera: missing, and a pixel of which picture? Expected one of {listed}")
    if camera in names:
        return names.index(camera)
    if camera.isdecimal() and int(camera) < len(names):
        return int(camera)
    raise ParameterError(f"--camera: got {camera!r}, expected one of {listed}")


def _on_picture(result: Segmentation, picture: Path, at_px: tuple[float, float]) -> tuple[int, float, float]:
    from ldls.io.images import read_image_size
    from ldls.viewing.overlay import pixel_of

    with within(str(picture)):
        return pixel_of(result, read_image_size(picture), at_px)


def _nearest_to_pixel(result: Segmentation, number: int, uv_px: NDArray[np.float64], *, mend: str) -> ChosenPoint:
    seen = result.views[number]
    if not len(seen.in_view):
        raise InputError("POINT: no point is in view of the camera; give a row number or X,Y,Z")
    distances = np.linalg.norm(seen.pixels - uv_px, axis=1)
    # of points behind one another, the one that the camera would see
    ranges_m = np.linalg.norm(result.points[seen.in_view, :3], axis=1)
    nearest = int(np.lexsort((ranges_m, distances))[0])
    row = int(seen.in_view[nearest])
    u, v = uv_px.round(1).tolist()
    of_camera = f" of {camera_names(result.views)[number]}" if len(result.views) > 1 else ""
    how = (
        f"Point {row} is the one in view nearest to pixel {u:g},{v:g}{of_camera}: {distances[nearest]:.1f} pixels away."
    )
    if distances[nearest] > FAR_SHARE * seen.view.masks.width:
        raise InputError(f"POINT: no point is near. {how} Give {row} to have that one explained{mend}")
    return ChosenPoint(row=row, how=how)


def _nearest_to_place(result: Segmentation, xyz: NDArray[np.float64]) -> ChosenPoint:
    distances = np.linalg.norm(result.points[:, :3].astype(np.float64) - xyz, axis=1)
    if not np.isfinite(distances).any():
        raise InputError("POINT: no point of the cloud is finite; give a row number")
    row = int(np.nanargmin(distances))
    x, y, z = xyz.tolist()
    how = f"Point {row} is the one nearest to {x:g},{y:g},{z:g}: {distances[row]:.2f} m away."
    if distances[row] > FAR_M:
        raise InputError(f"POINT: no point is near. {how} Give {row} to have that one explained")
    return ChosenPoint(row=row, how=how)
