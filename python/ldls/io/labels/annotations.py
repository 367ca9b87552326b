"""The paper's point annotations: text, a line `instance class` for each point of the whole cloud.

Classes are KITTI's, DontCare or background; the instance is -1 or 0 where there is none.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np

from ldls.errors import CorruptFileError
from ldls.io.files import read_lines, whole_file
from ldls.labeling import BACKGROUND, MAX_LABEL, Labeling

DONT_CARE = "DontCare"


def is_annotation(line: str) -> bool:
    """True for a line of such a file, which begins with a whole number."""
    return line.partition(" ")[0].removeprefix("-").isdecimal()


def read_annotations(path: str | PathLike[str]) -> Labeling:
    """The labels of a file, one a line.

    Raises:
        CorruptFileError: A line is not a whole number and a class; the message names the line.
        FileNotFoundError: There is no such file.
    """
    path = Path(path)
    lines = read_lines(path)
    # a cloud has 100,000 points and a few dozen different lines: only those are parsed
    different: dict[str, int] = {}
    rows = np.array([different.setdefault(line, len(different)) for line in lines], np.int64)
    parsed = [_parse(path, line, lines) for line in different]
    names = tuple(dict.fromkeys([BACKGROUND, *(name for _, name in parsed)]))
    classes = np.array([names.index(name) for _, name in parsed], np.int32)
    instances = np.array([instance for instance, _ in parsed], np.int32)
    return Labeling(classes[rows], instances[rows], np.zeros(len(lines), bool), names)


def write_annotations(path: str | PathLike[str], labeling: Labeling) -> None:
    """Write the labels, one a line; ignored points as DontCare."""
    names = [DONT_CARE if ignored else name for ignored in (False, True) for name in labeling.names]
    column = labeling.classes + len(labeling.names) * labeling.ignored
    instances = np.where(labeling.ignored, 0, labeling.instances)
    lines = (f"{i} {names[c]}\n" for i, c in zip(instances.tolist(), column.tolist(), strict=True))
    with whole_file(path) as file:
        file.write("".join(lines).encode())


def _parse(path: Path, line: str, lines: list[str]) -> tuple[int, str]:
    """Instance, 0 for none, and class of a line."""
    instance, _, name = line.strip().partition(" ")
    name = name.strip()
    try:
        number = int(instance)
    except ValueError:
        number = -2
    if not name or not -1 <= number <= MAX_LABEL:
        place = f"{path}, line {lines.index(line) + 1}"
        raise CorruptFileError(f"{place}: expected 'instance class' such as '3 Car' or '0 background', got {line!r}")
    return max(number, 0), name
