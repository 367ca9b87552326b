"""What is whole in a damaged bag, found by reading it from its beginning."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from ldls._optional import require


@dataclass(frozen=True)
class Found:
    """A whole message.

    Attributes:
        topic: Name of its topic.
        received_ns: When it was recorded, in nanoseconds.
        read: Reads its bytes.
    """

    topic: str
    received_ns: int
    read: Callable[[], bytes]


@dataclass
class Salvage:
    """What was found in the storage files of a bag.

    Attributes:
        ros2: Whether the messages are serialised as ROS 2 does.
        types: Type of the messages of each topic.
        messages: The whole messages in the order of the files.
        damage: Where and how the first damaged file ends; None if none is damaged.
    """

    ros2: bool = True
    types: dict[str, str] = field(default_factory=dict)
    messages: list[Found] = field(default_factory=list)
    damage: str | None = None


def salvage(files: Sequence[Path]) -> Salvage:
    """The whole messages of storage files, read one after the other."""
    from ldls.io.ros import salvage_db3, salvage_mcap, salvage_rosbag1

    scanners = {".bag": salvage_rosbag1.scan, ".db3": salvage_db3.scan, ".mcap": salvage_mcap.scan}
    found = Salvage(ros2=all(file.suffix != ".bag" for file in files))
    for file in files:
        try:
            damage = scanners[file.suffix](file, found)
        except (KeyError, IndexError, ValueError, struct.error) as error:
            damage = f"holds a record that makes no sense ({error})"
        if damage and found.damage is None:
            found.damage = f"{file.name}: {damage}" if len(files) > 1 else damage
    return found


@dataclass(frozen=True)
class Span:
    """Bytes of a file, perhaps compressed.

    Attributes:
        path: The file.
        start: Where they begin.
        size: How many there are in the file.
        compression: "" or "none", "bz2", "lz4" or "zstd".
    """

    path: Path
    start: int
    size: int
    compression: str = ""

    def read(self) -> bytes:
        """The bytes, decompressed.

        Raises:
            ValueError: They cannot be decompressed.
        """
        with self.path.open("rb") as file:
            file.seek(self.start)
            content = file.read(self.size)
        return decompressed(content, self.compression)

    def read_part(self, start: int, size: int) -> bytes:
        """`size` bytes from `start` on, both counted after decompression."""
        if self.compression in ("", "none"):
            return Span(self.path, self.start + start, size).read()
        return self.read()[start : start + size]


def decompressed(content: bytes, compression: str) -> bytes:
    """The bytes that were compressed.

    Raises:
        ValueError: They are not whole, or the compression is unknown.
    """
    if compression in ("", "none"):
        return content
    modules = {"bz2": "bz2", "lz4": "lz4.frame", "zstd": "rosbags.rosbag2.reader"}
    if compression not in modules:
        raise ValueError(f"compression {compression!r} is unknown")
    module = require(modules[compression], "ros")
    library = module.zstd if compression == "zstd" else module
    try:
        return bytes(library.decompress(content))
    except Exception as error:  # each library has errors of its own
        raise ValueError(f"{compression} data are damaged ({error})") from None
