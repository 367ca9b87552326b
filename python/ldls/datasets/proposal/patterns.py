"""Files of a folder as patterns: names that differ in the name of a frame alone."""

from __future__ import annotations

import os
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from ldls.datasets.stored_masks import FRAME
from ldls.io.names import is_hidden

DEEPEST = 4
"""Folders within folders that are looked into."""
MOST_FILES = 200_000
NUMBER = re.compile(r"\d+")
LAST_NUMBER = re.compile(r"(.*?)(\d+)(\D*)")
NO_NUMBER = "/"
"""In the place of what follows the number, which has no separator."""


@dataclass(frozen=True, eq=False)
class Pattern:
    """Files of one kind, one a frame.

    Attributes:
        text: Their path below the folder, with {frame} in the place of the frame's name.
        files: The files by frame.
    """

    text: str
    files: Mapping[str, Path]

    @property
    def suffix(self) -> str:
        """Ending of the names, in small letters: .pcd."""
        return PurePosixPath(self.text).suffix.lower()

    @property
    def first(self) -> tuple[str, Path]:
        """Name and file of the first frame."""
        name = min(self.files)
        return name, self.files[name]

    @property
    def n_bytes(self) -> int:
        """Size of all files."""
        return sum(path.stat().st_size for path in self.files.values())

    def shared(self, other: Pattern) -> set[str]:
        """Names of the frames that both have."""
        return self.files.keys() & other.files.keys()


def patterns_of(folder: Path) -> list[Pattern]:
    """The patterns of the files below `folder`, hidden ones left out, by their text; a file on its own is one too."""
    places: defaultdict[tuple[str, str], list[Path]] = defaultdict(list)
    for path in _files(folder):
        places[str(path.parent), _suffix(path)].append(path)
    return sorted(
        (pattern for files in places.values() for pattern in _in_one_place(folder, files)),
        key=lambda pattern: pattern.text,
    )


def _files(folder: Path) -> Iterator[Path]:
    count = 0
    for place, folders, names in os.walk(folder):
        depth = len(Path(place).relative_to(folder).parts)
        folders[:] = sorted(name for name in folders if not is_hidden(name) and depth < DEEPEST)
        for name in sorted(names):
            if not is_hidden(name):
                yield Path(place, name)
                count += 1
        if count > MOST_FILES:
            return


def _suffix(path: Path) -> str:
    return ".pcd.bin" if path.name.lower().endswith(".pcd.bin") else path.suffix


def _in_one_place(folder: Path, files: Iterable[Path]) -> Iterator[Pattern]:
    """Patterns of files in one folder with one suffix: by the numbers in their names, or by the names."""
    groups: defaultdict[tuple[str, str], dict[str, Path]] = defaultdict(dict)
    for path in files:
        stem = path.name.removesuffix(_suffix(path))
        matched = LAST_NUMBER.fullmatch(stem)
        before, after = matched.group(1, 3) if matched else (stem, NO_NUMBER)
        groups[NUMBER.sub("#", before), after][stem] = path
    # names without a system, as random ones
    if len(groups) > 3 and all(len(group) == 1 for group in groups.values()):
        yield _pattern(folder, {stem: path for group in groups.values() for stem, path in group.items()}, "", "")
        return
    for (_, after), group in groups.items():
        if after == NO_NUMBER:
            yield from (Pattern(path.relative_to(folder).as_posix(), {stem: path}) for stem, path in group.items())
            continue
        # numbers before the last one, as the seconds of 1547131046.353, are part of the frame's name if they differ
        befores = {LAST_NUMBER.fullmatch(stem)[1] for stem in group}  # type: ignore[index]
        before = befores.pop() if len(befores) == 1 else NUMBER.split(min(befores))[0]
        names = {stem.removesuffix(after).removeprefix(before): path for stem, path in group.items()}
        yield _pattern(folder, names, before, after)


def _pattern(folder: Path, files: Mapping[str, Path], before: str, after: str) -> Pattern:
    path = next(iter(files.values()))
    place = path.parent.relative_to(folder) / f"{before}{FRAME}{after}{_suffix(path)}"
    return Pattern(place.as_posix(), files)
