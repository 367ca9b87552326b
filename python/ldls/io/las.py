"""LAS and LAZ with the labels as extra dimensions; ASPRS classification stays as it is."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ldls._optional import require
from ldls.errors import LimitError, NonFiniteError
from ldls.io.labeled_points import CHANNELS, colors, instances
from ldls.io.whole_file import whole_file

if TYPE_CHECKING:
    from ldls.segmentation import Segmentation

SCALE_M = 1e-4
"""Steps of the coordinates, in metres: they keep to half of it."""
MAX_STEPS = 2**31 - 1
COLOR_FORMAT = 7
"""Point format with time and colour, of LAS 1.4."""
DIMENSIONS = {"instance": np.uint32, "category": np.uint16, "confidence": np.float32}
MAX_CATEGORY = 2**16 - 1
MAX_COLOR = 257
"""A byte times this fills the sixteen bits that LAS has for a colour."""
MAX_INTENSITY = 2**16 - 1


def write(path: Path, result: Segmentation) -> None:
    """Write all points: x y z to 0.1 mm, intensity, colour, and `instance`, `category` and `confidence` of their own.

    `.laz` is packed. Intensities of 0 to 1 are spread over the 16 bits that LAS has; larger ones are rounded.
    Points out of view have instance and category 0, as the background has.

    Raises:
        NonFiniteError: A point is not finite, which LAS cannot say.
        LimitError: The cloud is wider than the coordinates of LAS, or a category id is above 65,535.
        ImportError: The extra `las` is not installed.
    """
    laspy = require("laspy", "las")
    require("lazrs", "las")
    xyz = result.points[:, :3].astype(np.float64)
    _check(path, xyz, result.categories)
    header = laspy.LasHeader(point_format=COLOR_FORMAT, version="1.4")
    header.scales, header.offsets = np.full(3, SCALE_M), _middle(xyz)
    header.add_extra_dims([laspy.ExtraBytesParams(name, kind) for name, kind in DIMENSIONS.items()])
    las = laspy.LasData(header, laspy.ScaleAwarePointRecord.zeros(len(xyz), header=header))
    _fill(las, xyz, result)
    with whole_file(path) as file:
        las.write(file, do_compress=path.suffix.lower() == ".laz")


def _fill(las: Any, xyz: NDArray[np.float64], result: Segmentation) -> None:  # noqa: ANN401
    las.x, las.y, las.z = xyz.T
    if result.points.shape[1] > 3:
        las.intensity = _sixteen_bits(result.points[:, 3])
    for channel, column in zip(CHANNELS, colors(result).T, strict=True):
        las[channel] = column.astype(np.uint16) * MAX_COLOR
    las["instance"] = instances(result)
    las["category"] = result.categories.astype(np.uint16)
    las["confidence"] = result.confidence


def _check(path: Path, xyz: NDArray[np.float64], categories: NDArray[np.int32]) -> None:
    finite = np.isfinite(xyz).all(axis=1)
    if not finite.all():
        raise NonFiniteError(
            f"{path}: {(~finite).sum()} of {len(xyz)} points are not finite, the first in row {np.argmin(finite)}; "
            "LAS has no such numbers, save .ply or .npz instead"
        )
    if len(xyz) and (np.ptp(xyz, axis=0) / 2 > MAX_STEPS * SCALE_M).any():
        raise LimitError(f"{path}: the cloud is {np.ptp(xyz, axis=0).max():.0f} m wide, expected at most 429,000 m")
    if len(categories) and not 0 <= categories.min() <= categories.max() <= MAX_CATEGORY:
        raise LimitError(
            f"{path}: category ids {categories.min()} to {categories.max()}, expected 0 to {MAX_CATEGORY}; "
            "save .ply or .npz instead"
        )


def _middle(xyz: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.round((xyz.min(axis=0) + xyz.max(axis=0)) / 2) if len(xyz) else np.zeros(3)


def _sixteen_bits(intensity: NDArray[np.floating]) -> NDArray[np.uint16]:
    known = np.nan_to_num(intensity.astype(np.float64), nan=0.0)
    spread = MAX_INTENSITY if known.max(initial=0.0) <= 1 else 1
    return np.round(known * spread).clip(0, MAX_INTENSITY).astype(np.uint16)
