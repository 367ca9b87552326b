"""Paths that a file names, kept from leading anywhere."""

from __future__ import annotations

from pathlib import Path, PurePosixPath, PureWindowsPath

from ldls.errors import UnsafePathError


def below(folder: Path, name: str, *, place: str) -> Path:
    """The path `name` below `folder`; links that lie there may lead on, for whoever put them there meant them to.

    Args:
        folder: Where it must lie.
        name: The relative path, with slashes.
        place: Where the name was read, for messages.

    Raises:
        UnsafePathError: The path is absolute, climbs out with `..`, or holds a NUL.
    """
    absolute = PurePosixPath(name).is_absolute() or PureWindowsPath(name).is_absolute() or PureWindowsPath(name).drive
    if absolute or ".." in PureWindowsPath(name).parts or "\0" in name or not name:
        raise UnsafePathError(f"{place}: path {name!r} leads out of {folder}; expected a path below it")
    return folder / name


def strictly_below(folder: Path, name: str, *, place: str) -> Path:
    """As `below`, and without links that lead out.

    Raises:
        UnsafePathError: The path, its links followed, does not lie below `folder`.
    """
    path = below(folder, name, place=place)
    if not path.resolve().is_relative_to(folder.resolve()):
        raise UnsafePathError(f"{place}: path {name!r} leads by a link to {path.resolve()}, out of {folder}")
    return path
