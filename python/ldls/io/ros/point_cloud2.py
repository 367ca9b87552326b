"""PointCloud2 messages to arrays, and arrays to PointCloud2 messages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls.cloud import Points
from ldls.errors import CorruptFileError, FileFormatError, InputError, UnsupportedFormatError
from ldls.io.files import MAX_POINT_BYTES
from ldls.io.ros.messages import NANOSECONDS, POINTS, Header, Message, Types, make, make_header, nanoseconds

DATATYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""sensor_msgs/PointField: the number of each type."""
POSITION = ("x", "y", "z")
READ_FIELDS = (*POSITION, "intensity")
"""Columns of `PointCloud.points`, in this order."""
PADDING = "_"
"""What the Point Cloud Library calls the bytes between fields that hold nothing, however often there are some."""
RELATIVE_TIMES = ("time", "t", "offset_time", "time_offset")
"""Fields with the times of points after the header's stamp: seconds if they are real numbers, else nanoseconds."""
ABSOLUTE_TIMES = "timestamp"
"""Field with times by the clock of the header's stamp: seconds since 1970, or nanoseconds, as double precision."""
LEAST_NANOSECONDS = 1e14
"""As seconds, this lies three million years ahead; as nanoseconds, it was a day after 1970 began."""


@dataclass(frozen=True, eq=False)
class PointCloud:
    """The N points of a PointCloud2 message, in its order; those of missing returns stay.

    Attributes:
        header: Time and frame of the measurement.
        fields: (N,) structured array with every field of the message under its name, but for padding, in this machine's
            byte order.
    """

    header: Header
    fields: NDArray[np.void]

    def points(self, names: Mapping[str, str] | None = None) -> Points:
        """(N, 3) x y z in metres, or (N, 4) with intensity where there is one; float64 where x y z are.

        Args:
            names: The message's own names of x, y, z and intensity, where they differ.

        Raises:
            FileFormatError: x, y or z is missing or no real number; the message lists the fields there are.
        """
        called = {name: (names or {}).get(name, name) for name in READ_FIELDS}
        self._check_position([called[name] for name in POSITION])
        chosen = [name for name in called.values() if self._is_number(name)]
        wide = any(self.fields.dtype[called[name]] == np.float64 for name in POSITION)
        shape = (len(self.fields), len(chosen))
        points: Points = np.empty(shape, np.float64) if wide else np.empty(shape, np.float32)
        with np.errstate(over="ignore"):  # what is too large for single precision is infinite
            for column, name in enumerate(chosen):
                points[:, column] = self.fields[name]
        return points

    def times(self, name: str | None = None) -> NDArray[np.float64] | None:
        """(N,) when each point was measured, in seconds after the header's stamp, as far as the message says.

        Fields known by their names are `time` (Velodyne: seconds), `t` (Ouster: nanoseconds), `offset_time` and
        `time_offset` (Livox and others: nanoseconds), all after the header's stamp, and `timestamp` of double precision
        (Hesai, Robosense: seconds; Livox: nanoseconds), by the same clock as that. None where there is no such field.
        The values are not looked at.

        Args:
            name: The message's own name of the field of times after the stamp, or of `timestamp`s, if of float64
                and so called.
        """
        names = (*RELATIVE_TIMES, ABSOLUTE_TIMES) if name is None else (name,)
        found = next((one for one in names if self._is_number(one) and self._tells_time(one)), None)
        if found is None:
            return None
        values = self.fields[found].astype(np.float64)
        stamp_ns = self.header.stamp_ns
        if found != ABSOLUTE_TIMES:
            return values if self.fields.dtype[found].kind == "f" else values / NANOSECONDS
        with np.errstate(invalid="ignore", over="ignore"):
            if np.nanmax(np.abs(values), initial=0) >= LEAST_NANOSECONDS:
                return (values - stamp_ns) / NANOSECONDS
            return values - stamp_ns / NANOSECONDS

    def _tells_time(self, name: str) -> bool:
        """False for numbers too small for times."""
        kind = self.fields.dtype[name]
        return bool(kind == np.float64 if name == ABSOLUTE_TIMES else kind.itemsize >= 4)

    def _is_number(self, name: str) -> bool:
        return name in (self.fields.dtype.names or ()) and self.fields.dtype[name].shape == ()

    def _check_position(self, names: list[str]) -> None:
        for name in names:
            if not self._is_number(name) or self.fields.dtype[name].kind != "f":
                fields = ", ".join(f"{n} {self.fields.dtype[n]}" for n in self.fields.dtype.names or ())
                raise FileFormatError(
                    f"points: expected a field {name!r} of float32 or float64, found {fields or 'no fields'}; if it is "
                    f'called otherwise, pass fields={{"{name}": its name}}'
                )


def decode(message: Message) -> PointCloud:
    """The points of a message: `height` rows of `width` points, `row_step` and `point_step` bytes apart.

    Raises:
        CorruptFileError: Fields reach beyond the point, or the data are fewer than width and height say.
        UnsupportedFormatError: A field has a type that PointField does not know.
    """
    layout = _layout(message)
    width, height = message.width, message.height
    content = np.ascontiguousarray(message.data).view(np.uint8)
    needed = (height - 1) * message.row_step + width * message.point_step if width and height else 0
    if message.row_step < width * message.point_step and height > 1:
        raise CorruptFileError(
            f"points: row_step is {message.row_step}, expected {width} points of {message.point_step} bytes or more"
        )
    if len(content) < needed:
        raise CorruptFileError(
            f"points: {len(content)} bytes, expected {needed} for {height} rows of {width} points of "
            f"{message.point_step} bytes"
        )
    steps = (message.row_step, message.point_step)
    rows: NDArray[np.void] = np.ndarray((height if needed else 0, width), layout, content, strides=steps)
    header = Header(nanoseconds(message.header.stamp), message.header.frame_id)
    return PointCloud(header, rows.astype(layout.newbyteorder("=")).reshape(-1))


def _layout(message: Message) -> np.dtype[np.void]:
    order = ">" if message.is_bigendian else "<"
    fields = [field for field in message.fields if field.name != PADDING]
    names = [field.name for field in fields]
    if len(set(names)) != len(names):
        raise CorruptFileError(f"points: fields {', '.join(names)}, expected each name once")
    if message.point_step > MAX_POINT_BYTES:
        raise CorruptFileError(f"points: {message.point_step} bytes a point, expected at most {MAX_POINT_BYTES}")
    formats = [_format(field, order, message.point_step) for field in fields]
    offsets = [field.offset for field in fields]
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": message.point_step})


def _format(field: Message, order: str, point_bytes: int) -> str | tuple[str, tuple[int]]:
    if field.datatype not in DATATYPES:
        raise UnsupportedFormatError(f"points: field {field.name!r} has type {field.datatype}, expected 1 to 8")
    kind = order + DATATYPES[field.datatype]
    # some writers count 0 where they mean 1
    count = max(field.count, 1)
    if field.offset + count * np.dtype(kind).itemsize > point_bytes:
        raise CorruptFileError(
            f"points: field {field.name!r} at byte {field.offset} reaches beyond the point of {point_bytes} bytes"
        )
    return kind if count == 1 else (kind, (count,))


def encode(types: Types, columns: Mapping[str, NDArray[Any]], header: Header) -> Message:
    """A message with a field for each column (N,), one after the other without gaps, little-endian.

    Raises:
        InputError: Columns differ in length or have a type that PointField does not know.
    """
    known = {kind: number for number, kind in DATATYPES.items()}
    lengths = {len(column) for column in columns.values()}
    if len(lengths) != 1:
        raise InputError(f"columns: expected one length, got {sorted(lengths)}")
    fields, offset = [], 0
    for name, column in columns.items():
        kind = column.dtype.str[1:]
        if kind not in known or column.ndim != 1:
            raise InputError(f"columns: {name!r} is {column.dtype} {column.shape}, expected (N,) numbers")
        fields.append(
            make(types, "sensor_msgs/msg/PointField", name=name, offset=offset, datatype=known[kind], count=1)
        )
        offset += column.dtype.itemsize
    count = lengths.pop()
    packed = np.empty(count, [(name, "<" + column.dtype.str[1:]) for name, column in columns.items()])
    for name, column in columns.items():
        packed[name] = column
    return make(
        types,
        POINTS,
        header=make_header(types, header),
        height=1,
        width=count,
        fields=fields,
        is_bigendian=False,
        point_step=offset,
        row_step=offset * count,
        data=packed.view(np.uint8).reshape(-1) if count else np.zeros(0, np.uint8),
        is_dense=all(column.dtype.kind != "f" or bool(np.isfinite(column).all()) for column in columns.values()),
    )
