"""Cameras and stamps as all of KITTI's data sets number them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from ldls.errors import CorruptFileError, ParameterError, SourceError
from ldls.io.files import read_lines


def camera_numbers(camera: int | Sequence[int]) -> tuple[int, ...]:
    """The numbers of one camera or several: 0 and 1 are grey, 2 and 3 in colour.

    Raises:
        ParameterError: There is none, one stands there twice, or one is not 0 to 3.
    """
    numbers = (camera,) if isinstance(camera, int) else tuple(camera)
    if not numbers or len(set(numbers)) != len(numbers) or not set(numbers) <= set(range(4)):
        raise ParameterError(f"camera: got {camera!r}, expected a number from 0 to 3, or several different ones")
    return numbers


def read_stamps(
    path: Path, names: Sequence[str], seconds: Callable[[str], float | None], *, example: str
) -> tuple[float | None, ...]:
    """Time of each frame in seconds; a line of the file is that of the frame of its number. None without the file.

    Args:
        path: File of a time a line.
        names: Names of the frames.
        seconds: The time of a line.
        example: A line, for messages.

    Raises:
        SourceError: There are fewer lines than frames, or a name is no number.
        CorruptFileError: A line holds no time.
    """
    if not path.exists():
        return (None,) * len(names)
    lines = read_lines(path)
    stamps = []
    for name in names:
        if not name.isdecimal():
            raise SourceError(f"{path}: frame {name!r} is no number, which its line would be")
        if len(lines) <= int(name):
            raise SourceError(f"{path}: has {len(lines)} stamps, expected one for each frame up to {names[-1]}")
        try:
            stamps.append(seconds(lines[int(name)]))
        except (ValueError, OverflowError):
            line = lines[int(name)]
            raise CorruptFileError(
                f"{path}, line {int(name) + 1}: expected a time such as {example}, got {line[:80]!r}"
            ) from None
    return tuple(stamps)
