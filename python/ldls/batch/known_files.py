"""What is known of the files of a run, so that changes are noticed: size, time of change and digest.

A folder, as of masks that are a file each, has the sum, the latest and the digest of those of its files.
"""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path

from ldls.io.files import digest_of
from ldls.io.names import is_hidden

LARGEST_DIGESTED_BYTES = 1 << 26
"""Larger inputs hold many frames, as bags do, and are known by size and time of change alone."""
DIGESTS_KEPT = 256
"""More than the frames on their way have files, so that what many share, as a model, is read once."""

Look = tuple[int, int] | None
"""Size and time of change of a file; None where there is none."""
State = list[int | str | None] | None
"""Size, time of change and digest of a file; None where there is none, and for the digest where it is not read."""


class KnownFiles:
    """The states of input files, of which digests are kept for a while."""

    def __init__(self) -> None:
        """Nothing is known yet."""
        self._digest = lru_cache(DIGESTS_KEPT)(_digest)

    def state(self, path: Path, seen: Look, *, read: bool = True) -> State:
        """State of a file that was seen so, for the journal."""
        if seen is None:
            return None
        known = read and seen[0] <= LARGEST_DIGESTED_BYTES
        return [*seen, self._digest(path, seen) if known else None]

    def is_same(self, path: Path, state: State) -> bool:
        """True for a file that is as it was in this state; of one whose digest is known the time may be another."""
        seen = look(path)
        if seen is None or state is None:
            return seen is None and state is None
        size, time, digest = state
        return seen[0] == size and (seen[1] == time if digest is None else self._digest(path, seen) == digest)


def look(path: Path) -> Look:
    """Size and time of change of a file."""
    try:
        found = [file.stat() for file in _files(path)]
    except (FileNotFoundError, ValueError):  # a name with a NUL, for one
        return None
    return sum(each.st_size for each in found), max((each.st_mtime_ns for each in found), default=0)


def written(path: Path) -> list[int | str]:
    """Size and digest of a result."""
    return [path.stat().st_size, digest_of(path)]


def is_written(path: Path, state: list[int | str]) -> bool:
    """True for a result that is there and has this size and digest."""
    return path.is_file() and path.stat().st_size == state[0] and digest_of(path) == state[1]


def _digest(path: Path, seen: Look) -> str:
    """Digest of a file; `seen` tells two states of it apart."""
    if not path.is_dir():
        return digest_of(path)
    lines = "".join(f"{digest_of(file)} {file.name}\n" for file in _files(path))
    return hashlib.sha256(lines.encode(errors="surrogateescape")).hexdigest()


def _files(path: Path) -> list[Path]:
    """The file, or those of the folder but what file managers leave in it."""
    if not path.is_dir():
        return [path]
    return sorted(file for file in path.iterdir() if file.is_file() and not is_hidden(file.name))
