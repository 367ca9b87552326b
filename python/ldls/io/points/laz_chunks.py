"""Chunks of a LAZ file, walked without unpacking: a size that lies would make the decoder ask for gigabytes.

Source: LASzip's item types and layered chunks, https://github.com/LASzip/LASzip.
"""

from __future__ import annotations

import struct
from pathlib import Path

from ldls.errors import CorruptFileError, TruncatedFileError

VLR_HEADER = struct.Struct("<H16sHH32s")
LASZIP = b"laszip encoded"
TABLE_POINTER = struct.Struct("<q")
NOT_HERE = -1
TABLE_HEAD = struct.Struct("<4xI")
"""Version, number of chunks."""
ITEMS_AT = 32
LAYERED = 3
ITEM_BYTES = {6: 20, 7: 8, 8: 6, 9: 29, 10: 30, 11: 6, 12: 8, 13: 29}
"""Size of each item of a point: core, time, colour and wave packet of point formats 0 to 5; core, colour, colour with
infrared and wave packet of formats 6 to 10."""
EXTRA_BYTES = (0, 14)
"""Items of any size, of the older formats and of the newer."""
LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}
"""Layers of each item of formats 6 to 10; extra bytes have one a byte."""


def check_chunks(path: Path, vlrs: bytes, offset: int, record_bytes: int, n_points: int) -> None:
    """Hold the chunks of a LAZ file against its size and its number of points.

    Only layered chunks, those of point formats 6 to 10, have sizes in them.

    Args:
        path: The file.
        vlrs: Its bytes between header and points.
        offset: Where its points begin.
        record_bytes: Size of a point, unpacked.
        n_points: How many there are.

    Raises:
        TruncatedFileError: The file ends before its chunks do.
        CorruptFileError: The chunks have another number of points, or end elsewhere than their table begins, or there
            is no record of LASzip.
    """
    laszip = _laszip_record(path, vlrs)
    items = _items(path, laszip, record_bytes)
    table = _table_offset(path, offset, record_bytes)
    if struct.unpack_from("<H", laszip) != (LAYERED,):
        return
    n_layers = sum(LAYERS.get(kind, size) for kind, size in items)
    head = struct.Struct(f"<{record_bytes}x{1 + n_layers}I")
    counted, end = _walk(path, head, offset + TABLE_POINTER.size, n_points)
    if counted != n_points:
        raise CorruptFileError(f"{path}: the header says {n_points} points, the chunks {counted}")
    if end != table:
        raise CorruptFileError(f"{path}: the chunks end at byte {end}, their table begins at {table}")


def _items(path: Path, laszip: bytes, record_bytes: int) -> list[tuple[int, int]]:
    """Kind and size of each item of a point."""
    (n_items,) = struct.unpack_from("<H", laszip, ITEMS_AT)
    content = laszip[ITEMS_AT + 2 :][: 6 * n_items]
    items = [(kind, size) for kind, size, _ in struct.iter_unpack("<HHH", content[: len(content) // 6 * 6])]
    right = all(kind in EXTRA_BYTES or ITEM_BYTES.get(kind) == size for kind, size in items)
    if not right or sum(size for _, size in items) != record_bytes:
        raise CorruptFileError(
            f"{path}: LASzip's items are {items} (kind, bytes), expected known ones of {record_bytes} bytes together"
        )
    return items


def _walk(path: Path, head: struct.Struct, start: int, n_points: int) -> tuple[int, int]:
    """Return the number of points that the chunks hold, up to `n_points`, and where they end.

    A chunk is one whole point, a count, the size of each layer, and the layers.
    """
    counted, file_bytes = 0, path.stat().st_size
    with path.open("rb") as file:
        while counted < n_points:
            file.seek(start)
            content = file.read(head.size)
            count, *layer_bytes = head.unpack(content) if len(content) == head.size else (0,)
            start += head.size + sum(layer_bytes)
            if count == 0 or start > file_bytes:
                raise TruncatedFileError(
                    f"{path}: a chunk of {count} points ends at byte {start}, the file at {file_bytes}; "
                    f"{n_points - counted} points are missing"
                )
            counted += count
    return counted, start


def _table_offset(path: Path, offset: int, record_bytes: int) -> int:
    """Return the offset of the table of chunks, which stands before the points or, in streams, at the end."""
    file_bytes = path.stat().st_size
    table = _unpack(path, TABLE_POINTER, offset)
    if table == NOT_HERE:
        table = _unpack(path, TABLE_POINTER, file_bytes - TABLE_POINTER.size)
    if not offset + TABLE_POINTER.size <= table <= file_bytes - TABLE_HEAD.size:
        raise TruncatedFileError(f"{path}: the table of chunks begins at byte {table}, the file ends at {file_bytes}")
    n_chunks = _unpack(path, TABLE_HEAD, table)
    if n_chunks * record_bytes > table - offset:
        raise CorruptFileError(f"{path}: {n_chunks} chunks do not fit in {table - offset} bytes of points")
    return table


def _unpack(path: Path, layout: struct.Struct, at: int) -> int:
    with path.open("rb") as file:
        file.seek(at)
        content = file.read(layout.size)
    if len(content) != layout.size:
        raise TruncatedFileError(f"{path}: ends at byte {at + len(content)}, in the place of its chunks")
    number: int = layout.unpack(content)[0]
    return number


def _laszip_record(path: Path, vlrs: bytes) -> bytes:
    start = 0
    while start + VLR_HEADER.size <= len(vlrs):
        _, user, _, size, _ = VLR_HEADER.unpack_from(vlrs, start)
        start += VLR_HEADER.size
        if user.rstrip(b"\0") == LASZIP and start + size <= len(vlrs) and size >= ITEMS_AT + 2:
            return vlrs[start : start + size]
        start += size
    raise CorruptFileError(f"{path}: compressed points without a record of LASzip before them")
