"""PLY files, ascii and binary: the vertices.

Source: http://paulbourke.net/dataformats/ply/.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.cloud import Points
from ldls.errors import CorruptFileError, TruncatedFileError, UnsupportedFormatError
from ldls.io.files import open_file, whole_file
from ldls.io.labelled_points import CHANNELS, Labelled, colors, instances, positions
from ldls.io.points.named_columns import find_columns, stacked
from ldls.io.points.text_rows import Row, as_text, is_number, of_kinds, read_rows, split_header, text_rows, whole_number

BYTE_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
    "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "float32": "f4", "float64": "f8",
}  # fmt: skip
TYPE_NAMES = {"<f4": "float", "<f8": "double", "<i4": "int", "|u1": "uchar"}


@dataclass
class Element:
    """One element of a header: how many there are, and their properties."""

    name: str
    count: int
    properties: list[str] = field(default_factory=list)
    types: list[str] = field(default_factory=list)
    list_properties: list[str] = field(default_factory=list)

    def dtype(self, order: str) -> np.dtype[np.void]:
        """One of them in binary."""
        return np.dtype([(f"f{i}", order + kind) for i, kind in enumerate(self.types)])


@dataclass(frozen=True)
class Header:
    """The fields of a file's header."""

    encoding: str
    before: list[Element]
    vertex: Element
    after: list[Element]


def read(path: Path) -> Points:
    """(N, 3 or 4) points: x y z and, where there is one, intensity of the vertices; float32 unless more is needed.

    Doubles need more, and text with digits that single precision loses.

    Raises:
        TruncatedFileError: The file ends before the vertices that the header says, or, in ascii, with the last number
            of them, without a line end: that number may be cut short.
        CorruptFileError: The header contradicts itself or what follows it, or a number is none; the message names the
            line. What follows lists is not known, and nothing is said of it.
        UnsupportedFormatError: The vertices, or an element before them, have a list property.
    """
    with open_file(path, "PLY file") as file:
        return _read(file.read())


def _read(content: bytes) -> Points:
    lines, body = split_header(content, "end_header")
    header = _parse(lines)
    for element in (*header.before, header.vertex):
        if element.list_properties:
            raise UnsupportedFormatError(
                f"property list {element.list_properties[0]!r} of element {element.name}; expected numbers "
                "alone in the vertices and whatever stands before them; write it again without"
            )
    columns = find_columns("element vertex", header.vertex.properties)
    if header.encoding == "ascii":
        return _read_ascii(header, columns, as_text(body), len(lines))
    return _read_binary(header, columns, body)


def _read_binary(header: Header, columns: Sequence[int], body: bytes) -> Points:
    order = BYTE_ORDERS[header.encoding]
    start = sum(element.count * element.dtype(order).itemsize for element in header.before)
    kind, count = header.vertex.dtype(order), header.vertex.count
    needed = start + count * kind.itemsize
    if needed > len(body):
        raise TruncatedFileError(
            f"element vertex {count} needs {needed} bytes after the header, the file has {len(body)}; "
            f"last whole vertex is {max(0, len(body) - start) // kind.itemsize}"
        )
    _refuse_more(header, body, needed)
    vertices = np.frombuffer(body, kind, count, start)
    return stacked([vertices[f"f{position}"] for position in columns])


def _refuse_more(header: Header, body: bytes, needed: int) -> None:
    """Refuse a binary body with room for a further vertex behind what the header says, save white space."""
    if _has_lists(header.after):
        return
    order = BYTE_ORDERS[header.encoding]
    end = needed + sum(element.count * element.dtype(order).itemsize for element in header.after)
    if len(body) - end >= header.vertex.dtype(order).itemsize and body[end:].strip():
        raise CorruptFileError(
            f"the elements of the header need {end} bytes after it, the file has {len(body)}; mend the header"
        )


def _refuse_more_lines(header: Header, rows: Sequence[Row], needed: int) -> None:
    """Refuse further lines of numbers in ascii behind what the header says."""
    if _has_lists(header.after):
        return
    behind = [number for number, line in rows[needed:] if is_number(line.split()[0])]
    n_after = sum(element.count for element in header.after)
    if len(behind) > n_after:
        raise CorruptFileError(
            f"line {behind[n_after]}: the elements of the header have {needed + n_after} lines, the file has "
            f"{needed + len(behind)}; mend the header"
        )


def _has_lists(elements: Sequence[Element]) -> bool:
    """True where nobody knows how long elements are but who walks through them all."""
    return any(element.count and element.list_properties for element in elements)


def _read_ascii(header: Header, columns: Sequence[int], text: str, n_header_lines: int) -> Points:
    rows = text_rows(text, n_header_lines)
    vertex = header.vertex
    start, count = sum(element.count for element in header.before), vertex.count
    if start + count > len(rows):
        raise TruncatedFileError(
            f"element vertex {count} needs as many lines, the file ends after {max(0, len(rows) - start)}"
        )
    _refuse_more_lines(header, rows, start + count)
    cells = read_rows(rows[start : start + count], columns, len(vertex.properties))
    names, kinds = ([each[position] for position in columns] for each in (vertex.properties, vertex.types))
    return stacked(of_kinds(names, cells, [np.dtype(kind) for kind in kinds]))


def _parse(lines: list[Row]) -> Header:
    if lines[0][1] != "ply":
        raise CorruptFileError(f"expected 'ply' in the first line, got {lines[0][1][:40]!r}")
    encoding, elements = "", []
    for number, line in lines[1:]:
        place, words = f"line {number}", line.split()
        match words:
            case ["format", encoding, "1.0"] if encoding in BYTE_ORDERS:
                pass
            case ["element", name, count]:
                elements.append(Element(name, whole_number(f"{place}: element {name}", count)))
            case ["property", *rest] if elements:
                _add_property(place, elements[-1], rest)
            case [] | ["comment" | "obj_info" | "end_header", *_]:
                pass
            case _:
                raise CorruptFileError(f"{place}: expected a format, an element or a property, got {line[:80]!r}")
    if not encoding:
        raise CorruptFileError(f"the header names no format, expected one of {', '.join(BYTE_ORDERS)}")
    at = [i for i, element in enumerate(elements) if element.name == "vertex"]
    if len(at) != 1:
        raise CorruptFileError(f"expected one element vertex, found {len(at)}")
    return Header(encoding, elements[: at[0]], elements[at[0]], elements[at[0] + 1 :])


def _add_property(place: str, element: Element, words: list[str]) -> None:
    match words:
        case ["list", count, kind, name] if count in TYPES and kind in TYPES:
            element.list_properties.append(name)
        case [kind, name] if kind in TYPES:
            element.properties.append(name)
            element.types.append(TYPES[kind])
        case _:
            raise CorruptFileError(f"{place}: expected a type and a name, got {' '.join(words)[:80]!r}")


def write(path: Path, result: Labelled) -> None:
    """Write all points: x y z (and intensity), colour, `label` (category id), `instance` and `confidence`.

    Of a map or a tracked result, `instance` is the track. Points out of view have label and instance 0, as the
    background has.
    """
    position = positions(result)
    columns: dict[str, NDArray[np.number]] = {
        **position,
        **dict(zip(CHANNELS, colors(result).T, strict=True)),
        "label": result.categories,
        "instance": instances(result),
        "confidence": result.confidence,
    }
    real = "<f4" if result.points.dtype == np.float32 else "<f8"
    kinds = dict.fromkeys(position, real) | dict.fromkeys(CHANNELS, "|u1")
    # signed, for Open3D passes over unsigned properties of 32 bits
    kinds |= {"label": "<i4", "instance": "<i4", "confidence": "<f4"}
    vertices = np.empty(len(result.points), list(kinds.items()))
    for name, column in columns.items():
        vertices[name] = column
    header = ["ply", "format binary_little_endian 1.0", "comment written by ldls"]
    header += [f"element vertex {len(vertices)}"]
    header += [f"property {TYPE_NAMES[kind]} {name}" for name, kind in kinds.items()]
    with whole_file(path) as file:
        file.write("\n".join([*header, "end_header\n"]).encode("ascii"))
        file.write(vertices.tobytes())
