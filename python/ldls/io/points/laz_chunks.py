"""Chunks of a LAZ file, walked without unpacking: a size that lies would make the decoder ask for gigabytes.

Source: LASzip's item types and layered chunks, https://github.com/LASzip/LASzip.
"""

from __future__ import annotations

import struct

from ldls.errors import CorruptFileError, TruncatedFileError
from ldls.io.files import InputFile

VLR_HEADER = struct.Struct("<H16sHH32s")
LASZIP = b"laszip encoded"
TABLE_POINTER = struct.Struct("<q")
NOT_HERE = -1
TABLE_HEAD = struct.Struct("<4xI")
"""Version, number of chunks."""
ITEMS_AT = 32
ONE_CHUNK, LAYERED = 1, 3
"""Ways of packing; the first has no table."""
ITEM_BYTES = {6: 20, 7: 8, 8: 6, 9: 29, 10: 30, 11: 6, 12: 8, 13: 29}
"""Size of each item of a point: core, time, colour and wave packet of point formats 0 to 5; core, colour, colour with
infrared and wave packet of formats 6 to 10."""
EXTRA_BYTES = (0, 14)
"""Items of any size, of the older formats and of the newer."""
LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}
"""Layers of each item of formats 6 to 10; extra bytes have one a byte."""


def check_chunks(file: InputFile, laszip: bytes, offset: int, record_bytes: int, n_points: int) -> None:
    """Hold the chunks of a LAZ file against its size and its number of points.

    Only layered chunks, those of point formats 6 to 10, have sizes in them.

    Args:
        file: The file.
        laszip: Its record of LASzip.
        offset: Where its points begin.
        record_bytes: Size of a point, unpacked.
        n_points: How many there are.

    Raises:
        TruncatedFileError: The file ends before its chunks do.
        CorruptFileError: The chunks have another number of points, or end elsewhere than their table begins.
    """
    items = _items(laszip, record_bytes)
    (packing,) = struct.unpack_from("<H", laszip)
    if packing == ONE_CHUNK:
        return
    table = _table_offset(file, offset, record_bytes)
    if packing != LAYERED:
        return
    n_layers = sum(LAYERS.get(kind, size) for kind, size in items)
    head = struct.Struct(f"<{record_bytes}x{1 + n_layers}I")
    counted, end = _walk(file, head, offset + TABLE_POINTER.size, n_points)
    if counted != n_points:
        raise CorruptFileError(f"the header says {n_points} points, the chunks {counted}")
    if end != table:
        raise CorruptFileError(f"the chunks end at byte {end}, their table begins at {table}")


def _items(laszip: bytes, record_bytes: int) -> list[tuple[int, int]]:
    """Kind and size of each item of a point."""
    (n_items,) = struct.unpack_from("<H", laszip, ITEMS_AT)
    content = laszip[ITEMS_AT + 2 :][: 6 * n_items]
    items = [(kind, size) for kind, size, _ in struct.iter_unpack("<HHH", content[: len(content) // 6 * 6])]
    right = all(kind in EXTRA_BYTES or ITEM_BYTES.get(kind) == size for kind, size in items)
    if not right or sum(size for _, size in items) != record_bytes:
        raise CorruptFileError(
            f"LASzip's items are {items} (kind, bytes), expected known ones of {record_bytes} bytes together"
        )
    return items


def _walk(file: InputFile, head: struct.Struct, start: int, n_points: int) -> tuple[int, int]:
    """Return the number of points that the chunks hold, up to `n_points`, and where they end.

    A chunk is one whole point, a count, the size of each layer, and the layers.
    """
    counted = 0
    while counted < n_points:
        file.seek(start)
        content = file.read(head.size)
        count, *layer_bytes = head.unpack(content) if len(content) == head.size else (0,)
        start += head.size + sum(layer_bytes)
        if count == 0 or start > file.size:
            raise TruncatedFileError(
                f"a chunk of {count} points ends at byte {start}, the file at {file.size}; "
                f"{n_points - counted} points are missing"
            )
        counted += count
    return counted, start


def _table_offset(file: InputFile, offset: int, record_bytes: int) -> int:
    """Return the offset of the table of chunks, which stands before the points or, in streams, at the end."""
    table = _unpack(file, TABLE_POINTER, offset)
    if table == NOT_HERE:
        table = _unpack(file, TABLE_POINTER, file.size - TABLE_POINTER.size)
    if not offset + TABLE_POINTER.size <= table <= file.size - TABLE_HEAD.size:
        raise TruncatedFileError(f"the table of chunks begins at byte {table}, the file ends at {file.size}")
    n_chunks = _unpack(file, TABLE_HEAD, table)
    if n_chunks * record_bytes > table - offset:
        raise CorruptFileError(f"{n_chunks} chunks do not fit in {table - offset} bytes of points")
    return table


def _unpack(file: InputFile, layout: struct.Struct, at: int) -> int:
    file.seek(at)
    content = file.read(layout.size)
    if len(content) != layout.size:
        raise TruncatedFileError(f"ends at byte {at + len(content)}, in the place of its chunks")
    number: int = layout.unpack(content)[0]
    return number


def laszip_record(vlrs: bytes) -> bytes:
    """The record of LASzip among the bytes between header and points.

    Raises:
        CorruptFileError: There is none.
    """
    start = 0
    while start + VLR_HEADER.size <= len(vlrs):
        _, user, _, size, _ = VLR_HEADER.unpack_from(vlrs, start)
        start += VLR_HEADER.size
        if user.rstrip(b"\0") == LASZIP and start + size <= len(vlrs) and size >= ITEMS_AT + 2:
            return vlrs[start : start + size]
        start += size
    raise CorruptFileError("compressed points without a record of LASzip before them")
