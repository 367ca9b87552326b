"""PCD files of the Point Cloud Library: ascii, binary and binary_compressed.

Source: https://pointclouds.org/documentation/tutorials/pcd_file_format.html.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ldls._optional import require
from ldls.cloud import Points
from ldls.errors import CorruptFileError, TruncatedFileError, UnsupportedFormatError
from ldls.io.files import MAX_POINT_BYTES, open_file, whole_file
from ldls.io.labelled_points import Labelled, instances, packed_colors, positions
from ldls.io.points.named_columns import find_columns, stacked
from ldls.io.points.text_rows import Row, as_text, of_kinds, read_rows, split_header, text_rows, whole_number

ENCODINGS = ("ascii", "binary", "binary_compressed")
TYPES = {
    ("F", 4): "<f4", ("F", 8): "<f8", ("U", 1): "u1", ("U", 2): "<u2", ("U", 4): "<u4", ("U", 8): "<u8",
    ("I", 1): "i1", ("I", 2): "<i2", ("I", 4): "<i4", ("I", 8): "<i8",
}  # fmt: skip
COUNTS = ("POINTS", "WIDTH", "HEIGHT")
PAGE_BYTES = 4096
LZF_RATIO = 88
"""No stream of LZF unpacks to more than this many times its size: three bytes stand for at most 264."""


@dataclass(frozen=True)
class Field:
    """One field of a point: `count` values of a type."""

    name: str
    kind: np.dtype[np.number]
    count: int

    @property
    def n_bytes(self) -> int:
        """Bytes that it takes in a point."""
        return self.kind.itemsize * self.count


@dataclass(frozen=True)
class Header:
    """A header that does not contradict itself."""

    fields: list[Field]
    n_points: int
    encoding: str

    @property
    def point_bytes(self) -> int:
        """Bytes of a point in binary."""
        return sum(field.n_bytes for field in self.fields)


def read(path: Path) -> Points:
    """(N, 3 or 4) points: x y z and, where there is one, intensity; float32 unless more is needed.

    Doubles need more, and text with digits that single precision loses.

    Points of a cloud with rows stay in the order of the file; those that are NaN stay, too.

    Raises:
        TruncatedFileError: The file ends before the points that the header says, or, in ascii, with its last number,
            without a line end: that number may be cut short.
        CorruptFileError: The header contradicts itself or the bytes; the message names the field.
        UnsupportedFormatError: The encoding is unknown.
        ImportError: binary_compressed needs the extra `pcd`.
    """
    with open_file(path, "PCD file") as file:
        content = file.read()
        lines, body = split_header(content, "DATA")
        header = _parse(lines)
        columns = find_columns("FIELDS", [field.name for field in header.fields])
        for field in (header.fields[position] for position in columns[:3]):
            if field.count != 1:
                raise CorruptFileError(f"COUNT of {field.name} is {field.count}, expected 1")
        # several values are no intensity
        columns = tuple(at for at in columns if header.fields[at].count == 1)
        if header.encoding == "ascii":
            return _read_ascii(header, columns, as_text(body), len(lines))
        if header.encoding == "binary":
            return _read_binary(header, columns, _without_padding(header, body, len(content) - len(body)))
        return _read_compressed(header, columns, body)


def _read_ascii(header: Header, columns: Sequence[int], text: str, n_header_lines: int) -> Points:
    rows = text_rows(text, n_header_lines)
    _check_amount(header, "lines", header.n_points, len(rows), slack=0)
    first_cells = np.cumsum([0, *(field.count for field in header.fields)])
    delimiter = "," if rows and "," in rows[0][1] else None
    positions = [int(first_cells[position]) for position in columns]
    cells = read_rows(rows, positions, int(first_cells[-1]), delimiter)
    fields = [header.fields[position] for position in columns]
    return stacked(of_kinds([field.name for field in fields], cells, [field.kind for field in fields]))


def _without_padding(header: Header, body: bytes, n_header_bytes: int) -> bytes:
    """`body` without the zeros with which older writers of PCL fill as many bytes as make a page with the header."""
    size = header.n_points * header.point_bytes
    padding = body[size:]
    return body[:size] if (n_header_bytes + len(padding)) % PAGE_BYTES == 0 and not any(padding) else body


def _read_binary(header: Header, columns: Sequence[int], body: bytes) -> Points:
    size = header.point_bytes
    _check_amount(header, "bytes", header.n_points * size, len(body), slack=size - 1)
    starts = np.cumsum([0, *(field.n_bytes for field in header.fields)])
    point = np.dtype(
        {
            "names": [f"f{position}" for position in columns],
            "formats": [header.fields[position].kind for position in columns],
            "offsets": [int(starts[position]) for position in columns],
            "itemsize": size,
        }
    )
    points = np.frombuffer(body, point, header.n_points)
    return stacked([points[f"f{position}"] for position in columns])


def _read_compressed(header: Header, columns: Sequence[int], body: bytes) -> Points:
    """Fields lie one behind the other, each of all points, packed by LZF as one."""
    unpacked = _unpack(header, body)
    starts = np.cumsum([0, *(field.n_bytes * header.n_points for field in header.fields)])
    return stacked(
        [np.frombuffer(unpacked, header.fields[at].kind, header.n_points, int(starts[at])) for at in columns]
    )


def _unpack(header: Header, body: bytes) -> bytes:
    expected = header.n_points * header.point_bytes
    if expected == 0:
        return b""
    if len(body) < 8:
        raise TruncatedFileError(f"{len(body)} bytes after DATA, expected two sizes of 4 bytes each")
    packed_size, size = struct.unpack_from("<II", body)
    if size != expected:
        raise CorruptFileError(
            f"unpacked size {size}, expected {expected}: POINTS {header.n_points} of {header.point_bytes} bytes"
        )
    if packed_size > len(body) - 8:
        raise TruncatedFileError(f"packed size {packed_size}, the file has {len(body) - 8} bytes left")
    if size > packed_size * LZF_RATIO:
        raise CorruptFileError(f"{packed_size} packed bytes cannot hold {size}")
    lzf = require("lzf", "pcd")
    try:
        unpacked: bytes | None = lzf.decompress(body[8 : 8 + packed_size], size)
    except ValueError as error:
        raise CorruptFileError(f"{error}, expected LZF") from None
    if unpacked is None or len(unpacked) != size:
        unpacked_bytes = "more" if unpacked is None else str(len(unpacked))
        raise CorruptFileError(f"unpacks to {unpacked_bytes} bytes, the file says {size}")
    return unpacked


def _check_amount(header: Header, unit: str, needed: int, amount: int, slack: int) -> None:
    said = f"POINTS {header.n_points} need {needed} {unit} after DATA {header.encoding}, the file has {amount}"
    if amount < needed:
        raise TruncatedFileError(said)
    if amount > needed + slack:
        raise CorruptFileError(f"{said}; mend the header")


def _parse(lines: list[Row]) -> Header:
    entries: dict[str, list[str]] = {}
    for number, line in lines:
        words = line.partition("#")[0].split()
        if words and words[0] in entries:
            raise CorruptFileError(f"line {number}: {words[0]} stands there twice")
        entries |= {words[0]: words[1:]} if words else {}
    n_points = _n_points(entries)
    encoding = " ".join(entries["DATA"])
    if encoding not in ENCODINGS:
        raise UnsupportedFormatError(f"DATA {encoding[:40]!r}, expected one of {', '.join(ENCODINGS)}")
    header = Header(_fields(entries), n_points, encoding)
    if header.point_bytes > MAX_POINT_BYTES:
        raise CorruptFileError(
            f"SIZE and COUNT make {header.point_bytes} bytes a point, expected at most {MAX_POINT_BYTES}"
        )
    return header


def _n_points(entries: dict[str, list[str]]) -> int:
    numbers = {key: whole_number(key, " ".join(words)) for key, words in entries.items() if key in COUNTS}
    if not numbers.keys() & {"POINTS", "WIDTH"}:
        raise CorruptFileError(f"neither POINTS nor WIDTH in the header; found {' '.join(entries)}")
    if "WIDTH" not in numbers:
        return numbers["POINTS"]
    width, height = numbers["WIDTH"], numbers.get("HEIGHT", 1)
    points = numbers.get("POINTS", width * height)
    if points != width * height:
        raise CorruptFileError(f"POINTS {points}, WIDTH {width} x HEIGHT {height} is {width * height}")
    return points


def _fields(entries: dict[str, list[str]]) -> list[Field]:
    # early versions have COLUMNS, and PCL reads them still
    names = entries.get("FIELDS") or entries.get("COLUMNS", [])
    entries = {"SIZE": [], "TYPE": [], "COUNT": ["1"] * len(names)} | entries
    for key in ("SIZE", "TYPE", "COUNT"):
        if len(entries[key]) != len(names):
            raise CorruptFileError(f"{len(names)} FIELDS, {len(entries[key])} of {key}; expected as many")
    rows = zip(names, entries["TYPE"], entries["SIZE"], entries["COUNT"], strict=True)
    return [_field(*row) for row in rows]


def _field(name: str, kind: str, size: str, count: str) -> Field:
    place = f"field {name}"
    key = (kind, whole_number(f"{place}: SIZE", size))
    if key not in TYPES:
        known = ", ".join(f"{letter} {n}" for letter, n in TYPES)
        raise CorruptFileError(f"{place}: TYPE and SIZE {kind} {size}, expected one of {known}")
    n_values = whole_number(f"{place}: COUNT", count)
    if n_values == 0:
        raise CorruptFileError(f"{place}: COUNT 0, expected 1 or more")
    return Field(name, np.dtype(TYPES[key]), n_values)


def write(path: Path, result: Labelled) -> None:
    """Write all points: x y z (and intensity), `label` (category id), `instance`, `confidence` and `rgb`.

    Of a map or a tracked result, `instance` is the track. Points out of view have label and instance 0, as the
    background has.

    Raises:
        ImportError: The extra `pcd` is not installed.
    """
    pypcd4 = require("pypcd4", "pcd")
    columns = {name: np.ascontiguousarray(column) for name, column in positions(result).items()}
    columns |= {
        "label": result.categories.astype(np.uint32),
        "instance": instances(result),
        "confidence": result.confidence,
        "rgb": packed_colors(result),
    }
    cloud = pypcd4.PointCloud.from_points(
        list(columns.values()), list(columns), [column.dtype for column in columns.values()]
    )
    with whole_file(path) as file:
        cloud.save(file, pypcd4.Encoding.BINARY)
