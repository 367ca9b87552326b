"""Which files a source has, and which frames they make."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ldls.errors import LeftOutWarning, SourceError

POINT_SUFFIXES = (".bin", ".npy")
IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg")
LISTED = 8
"""How many names an error lists."""


@dataclass(frozen=True, kw_only=True)
class WholeFrames:
    """The frames of which every file is there.

    Attributes:
        names: Their names, sorted.
        left_out: What the others lack, by their names.
    """

    names: tuple[str, ...]
    left_out: Mapping[str, str]


def find_files(folder: Path, suffixes: Sequence[str]) -> dict[str, Path]:
    """Files of `folder` with one of the suffixes, by their names without it; hidden ones left out.

    Raises:
        SourceError: There is no such folder; the message says what is there.
    """
    check_folders(folder.parent, [folder.name])
    found = (path for path in folder.iterdir() if path.suffix in suffixes and not path.name.startswith("."))
    return {path.name.removesuffix(path.suffix): path for path in sorted(found)}


def whole_frames(path: Path, parts: Mapping[str, Mapping[str, Path]]) -> WholeFrames:
    """The frames that have a file of each part; warns of sweeps that lack one.

    Args:
        path: The source, for messages.
        parts: Files by frame of each part, as "velodyne" and "image_2"; the first are the sweeps.

    Raises:
        SourceError: No frame is whole.
    """
    everything = sorted(set().union(*parts.values()))
    lacks = {name: [part for part, files in parts.items() if name not in files] for name in everything}
    names = tuple(name for name in everything if not lacks[name])
    if not names:
        counts = ", ".join(f"{part} {len(files)}" for part, files in parts.items())
        raise SourceError(f"{path}: no frame has a file in each of these, found {counts}; names must agree")
    left_out = {name: f"no {' and no '.join(missing)}" for name, missing in lacks.items() if missing}
    sweeps = next(iter(parts.values()))
    warn_left_out(path, [why for name, why in left_out.items() if name in sweeps], len(sweeps))
    return WholeFrames(names=names, left_out=left_out)


def warn_left_out(path: Path, reasons: Iterable[str], n_sweeps: int) -> None:
    """Warn of sweeps that are left out, if there are any, by what they lack."""
    counted = Counter(reasons)
    if counted:
        message = f"{path}: {counted.total()} of {n_sweeps} sweeps are left out: {counts_of(counted)}"
        warnings.warn(message, LeftOutWarning, stacklevel=4)


def counts_of(reasons: Iterable[str]) -> str:
    """How often each reason occurs, the most frequent first."""
    return ", ".join(f"{count:,} {reason}" for reason, count in Counter(reasons).most_common())


def check_folders(path: Path, names: Iterable[str]) -> None:
    """Refuse a source that lacks a folder.

    Raises:
        SourceError: One is missing; the message says what is there.
        FileNotFoundError: There is no such source.
    """
    if not path.exists():
        raise FileNotFoundError(f"{path}: there is no such folder")
    missing = [name for name in names if not (path / name).is_dir()]
    if missing:
        raise SourceError(f"{path}: has no folder {', '.join(missing)}; found {listing(path)}")


def choose(path: Path, what: str, found: Sequence[str], wanted: str | None) -> str:
    """The one of `found` that is wanted, or the only one there is.

    Raises:
        SourceError: It is not there, or there are several and none is wanted.
    """
    if wanted is None and len(found) == 1:
        return found[0]
    if wanted is not None and wanted in found:
        return wanted
    there = some(found) or "none"
    if wanted is None:
        raise SourceError(f"{path}: holds {len(found)} {what}s ({there}); say which by {what}=")
    raise SourceError(f"{path}: has no {what} {wanted!r}; found {there}")


def listing(path: Path) -> str:
    """What a folder holds, in a few words."""
    return some(sorted(child.name for child in path.iterdir())) or "nothing"


def some(names: Sequence[str]) -> str:
    """The first of `names`, and how many more there are."""
    listed = ", ".join(names[:LISTED])
    return listed if len(names) <= LISTED else f"{listed} and {len(names) - LISTED} more"
