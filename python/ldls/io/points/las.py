"""LAS and LAZ files.

Source: https://www.asprs.org/wp-content/uploads/2019/07/LAS_1_4_r15.pdf. They are written by laspy, and read here:
libraries take a file that was cut short for a whole one, and some damaged files make them end the process.
"""

from __future__ import annotations

import struct
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import ldls._ldls as _ldls
from ldls._optional import require
from ldls.cloud import Points, is_finite
from ldls.errors import (
    CorruptFileError,
    LimitError,
    NonFiniteError,
    PrecisionWarning,
    TruncatedFileError,
    UnsupportedFormatError,
)
from ldls.io.files import InputFile, open_file, whole_file
from ldls.io.labelled_points import CHANNELS, Labelled, colors, instances
from ldls.io.points.laz_chunks import check_chunks, laszip_record

SIGNATURE = b"LASF"
HEADER_BYTES = {0: 227, 1: 227, 2: 227, 3: 235, 4: 375, 5: 393}
"""By minor version of LAS 1."""
VLR_BYTES = 54
POINT_BYTES = (20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67)
"""Least size of a record, by point format."""
COMPRESSED = 0x80
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
MOST_LOST = 0.01
"""What intensities may lose in whole numbers without a warning, as a part of the largest."""


@dataclass(frozen=True)
class Header:
    """The fields of a file's header that reading needs."""

    header_bytes: int
    offset: int
    n_vlrs: int
    point_format: int
    is_compressed: bool
    record_bytes: int
    n_points: int
    scales: tuple[float, ...]
    offsets_m: tuple[float, ...]


def read(path: Path) -> NDArray[np.float64]:
    """(N, 4) float64: x y z, as large as in the file, and intensity as stored, 0 to 65535.

    Raises:
        TruncatedFileError: The file ends before the points that the header says.
        CorruptFileError: The header contradicts itself or the file.
        UnsupportedFormatError: The version or the point format is unknown.
    """
    with open_file(path, "LAS or LAZ file") as file:
        header = _read_header(file)
        _check(header, file.size)
        if header.n_points == 0:
            return np.zeros((0, 4))
        steps, intensities = (_unpacked if header.is_compressed else _records)(file, header)
        points = np.empty((header.n_points, 4))
        with np.errstate(over="ignore", invalid="ignore"):
            points[:, :3] = steps * np.array(header.scales) + header.offsets_m
        points[:, 3] = intensities
        if not np.isfinite(points).all():
            raise CorruptFileError(
                f"scales {header.scales} and offsets {header.offsets_m} make coordinates that are not finite"
            )
        return points


def _records(file: InputFile, header: Header) -> tuple[NDArray[np.int32], NDArray[np.uint16]]:
    """Steps along x y z, (N, 3) int32, and intensities, (N,) uint16."""
    record = np.dtype({
        "names": ["steps", "intensity"],
        "formats": ["3<i4", "<u2"],
        "offsets": [0, 12],
        "itemsize": header.record_bytes,
    })  # fmt: skip
    file.seek(header.offset)
    records = np.frombuffer(file.read(header.n_points * header.record_bytes), record)
    return records["steps"], records["intensity"]


def _unpacked(file: InputFile, header: Header) -> tuple[NDArray[np.int32], NDArray[np.uint16]]:
    """The same, of packed points."""
    file.seek(header.header_bytes)
    laszip = laszip_record(file.read(header.offset - header.header_bytes))
    check_chunks(file, laszip, header.offset, header.record_bytes, header.n_points)
    file.seek(0)
    return _ldls.unpack_laz(file.read(), header.offset, laszip, header.n_points)


def _read_header(file: InputFile) -> Header:
    start = file.read(max(HEADER_BYTES.values()))
    if start[:4] != SIGNATURE:
        fault = TruncatedFileError if len(start) < len(SIGNATURE) else CorruptFileError
        raise fault(f"expected {SIGNATURE!r} in the first bytes, got {start[:4]!r}")
    if len(start) < min(HEADER_BYTES.values()):
        raise TruncatedFileError(f"the header ends after {len(start)} bytes, expected 227 or more")
    major, minor = start[24], start[25]
    if major != 1 or minor not in HEADER_BYTES:
        raise UnsupportedFormatError(f"LAS {major}.{minor}, expected 1.0 to 1.5")
    if len(start) < HEADER_BYTES[minor]:
        raise TruncatedFileError(f"the header ends after {len(start)} bytes, expected {HEADER_BYTES[minor]}")
    header_bytes, offset, n_vlrs, point_format, record_bytes, n_points = struct.unpack_from("<HIIBHI", start, 94)
    if minor >= 4:
        (n_points,) = struct.unpack_from("<Q", start, 247)
    return Header(
        header_bytes=header_bytes,
        offset=offset,
        n_vlrs=n_vlrs,
        point_format=point_format & 0x3F,
        is_compressed=bool(point_format & COMPRESSED),
        record_bytes=record_bytes,
        n_points=n_points,
        scales=struct.unpack_from("<3d", start, 131),
        offsets_m=struct.unpack_from("<3d", start, 155),
    )


def _check(header: Header, file_bytes: int) -> None:
    if header.point_format >= len(POINT_BYTES):
        raise UnsupportedFormatError(f"point format {header.point_format}, expected 0 to {len(POINT_BYTES) - 1}")
    if header.record_bytes < POINT_BYTES[header.point_format]:
        raise CorruptFileError(
            f"record length {header.record_bytes}, point format {header.point_format} needs "
            f"{POINT_BYTES[header.point_format]} bytes"
        )
    if not header.header_bytes <= header.offset <= file_bytes:
        raise TruncatedFileError(
            f"points begin at byte {header.offset}, expected {header.header_bytes} (after the header) to "
            f"{file_bytes} (where the file ends)"
        )
    if header.n_vlrs * VLR_BYTES > header.offset - header.header_bytes:
        raise CorruptFileError(f"{header.n_vlrs} variable length records do not fit before the points")
    if not (np.isfinite(header.scales).all() and all(header.scales) and np.isfinite(header.offsets_m).all()):
        raise CorruptFileError(
            f"scales {header.scales} and offsets {header.offsets_m}; expected finite ones, no scale 0"
        )
    present = file_bytes - header.offset
    if not header.is_compressed and header.n_points * header.record_bytes > present:
        raise TruncatedFileError(
            f"{header.n_points} points of {header.record_bytes} bytes need "
            f"{header.n_points * header.record_bytes} bytes from byte {header.offset} on, the file has {present}; "
            f"last whole point is {present // header.record_bytes}"
        )


def write(path: Path, result: Labelled) -> None:
    """Write all points: x y z to 0.1 mm, intensity, colour, and `instance`, `category` and `confidence` of their own.

    `.laz` is packed. Intensities of 0 to 1 are spread over the 16 bits that LAS has; where one is larger, all are
    rounded. NaN and negative ones are 0, those above 65,535 that; where such are lost, or fractions, there is a
    `PrecisionWarning`.
    Of a map or a tracked result, `instance` is the track. Points out of view have instance and category 0, as the
    background has.

    Raises:
        NonFiniteError: A point is not finite, which LAS cannot say.
        LimitError: The cloud is wider than the coordinates of LAS, or a category id is above 65,535.
        ImportError: The extra `las` is not installed.
    """
    laspy = require("laspy", "las")
    require("lazrs", "las")
    xyz = result.points[:, :3].astype(np.float64)
    _check_writable(path, xyz, result.categories)
    header = laspy.LasHeader(point_format=COLOR_FORMAT, version="1.4")
    header.scales, header.offsets = np.full(3, SCALE_M), _middle(xyz)
    header.add_extra_dims([laspy.ExtraBytesParams(name, kind) for name, kind in DIMENSIONS.items()])
    las = laspy.LasData(header, laspy.ScaleAwarePointRecord.zeros(len(xyz), header=header))
    las.intensity = _intensities(result.points)
    las.x, las.y, las.z = xyz.T
    for channel, column in zip(CHANNELS, colors(result).T, strict=True):
        las[channel] = column.astype(np.uint16) * MAX_COLOR
    las["instance"] = instances(result)
    las["category"] = result.categories.astype(np.uint16)
    las["confidence"] = result.confidence
    with whole_file(path) as file:
        las.write(file, do_compress=path.suffix.lower() == ".laz")


def _check_writable(path: Path, xyz: NDArray[np.float64], categories: NDArray[np.int32]) -> None:
    finite = is_finite(xyz)
    if not finite.all():
        raise NonFiniteError(
            f"{path}: {(~finite).sum()} of {len(xyz)} points are not finite, the first in row {np.argmin(finite)}; "
            "LAS has no such numbers, save .ply or .npz instead"
        )
    if len(xyz) and (np.abs(xyz - _middle(xyz)) >= MAX_STEPS * SCALE_M).any():
        raise LimitError(f"{path}: the cloud is {np.ptp(xyz, axis=0).max():.0f} m wide, expected at most 429,000 m")
    if len(categories) and not 0 <= categories.min() <= categories.max() <= MAX_CATEGORY:
        raise LimitError(
            f"{path}: category ids {categories.min()} to {categories.max()}, expected 0 to {MAX_CATEGORY}; "
            "save .ply or .npz instead"
        )


def _middle(xyz: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.round((xyz.min(axis=0) + xyz.max(axis=0)) / 2) if len(xyz) else np.zeros(3)


def _intensities(points: Points) -> NDArray[np.uint16]:
    if points.shape[1] == 3:
        return np.zeros(len(points), np.uint16)
    own = points[:, 3].astype(np.float64)
    high = own.max(initial=0, where=np.isfinite(own))
    numbers = np.nan_to_num(own)
    spread = MAX_INTENSITY if high <= 1 else 1
    held = numbers.clip(0, MAX_INTENSITY / spread) * spread
    whole = np.round(held)
    lost = {
        "NaN, which are 0": np.isnan(own).any(),
        "numbers below 0, which are 0": (numbers < 0).any(),
        f"numbers above {MAX_INTENSITY}, which are that": (numbers > MAX_INTENSITY).any(),
        "fractions, which are rounded": high > 1 and np.abs(whole - held).max() > MOST_LOST * high,
    }
    if any(lost.values()):
        what = "; ".join(each for each, is_so in lost.items() if is_so)
        # the same for all frames of a run, so that it is said once
        warnings.warn(
            f"intensities hold {what}, for LAS has whole numbers, 0 to {MAX_INTENSITY}; save .ply or .npz to keep "
            "them, or divide them by the largest, for those of 0 to 1 are spread over these",
            PrecisionWarning,
            stacklevel=5,
        )
    return whole.astype(np.uint16)
