"""The arguments that messages of the library name, as the options of a command."""

from __future__ import annotations

import re
from collections.abc import Mapping

OF_SOURCES = (
    "allow_outside", "camera", "drive", "image_topics", "info_topics", "lidar", "max_offset_s", "poses", "recover",
    "scene", "sequence", "split", "truth", "version", "world",
)  # fmt: skip
"""Arguments of sources, which --option takes."""
CONVERGED = "None for the converged solution"
"""What messages call the value that is an option of its own."""
WORDS: Mapping[str, Mapping[str, str]] = {
    CONVERGED: {"--converge": "--converge until nothing changes"},
    "T_camera_lidar": {"--extrinsic": "--extrinsic"},
    "format": {"--beside": "FORMAT:PATH"},
    "image_size": {"--image": "--image"},
    "instance_axis=-1": {"--instance-axis": "--instance-axis last"},
    "instance_axis=0": {"--instance-axis": "--instance-axis first"},
    "kind": {"--dataset": "--dataset"},
    "max_range_m": {"--max-range": "--max-range"},
    "names": {"--beside": "--categories", "--truth": "--categories"},
    "pixels_only": {"--variant": "--variant pixels"},
    "ranges_m": {"--points": "--points"},
    "resolve_overlaps": {"--resolve": "--resolve score"},
    "threads": {"--cores": "--cores"},
    "truth=annotations": {"--truth": "--truth annotations"},
    "truth=kitti-boxes": {"--truth": "--truth kitti-boxes"},
    "workers": {"--cores": "--cores"},
    **{name: {"--option": f"--option {name}"} for name in OF_SOURCES},
    "camera": {"--option": "--option camera", "--rig": "--rig"},
}
"""Words for arguments that go by another name on the command line, by the option that the command must have."""
PYTHON = "in Python"
ELSEWHERE = {"T_camera_lidar": f"{PYTHON} or ldls.toml", "columns": f"{PYTHON} or ldls.toml"}
"""Where arguments are given for which a command has no option; the others in Python."""
ARGUMENT = re.compile(r"(?<![\w/.=-])(?<!--option )(?![A-Z]+=)(\w+)(?:=(\([^)]*\)|\{[^}]*\}|[^\s,;()]*)|\(\))")


def by_options(message: str, options: Mapping[str, str]) -> str:
    """`message` with options of a command in place of the arguments that it begins with and those in what mends it.

    Args:
        message: Arguments, colon, fault, semicolon, mend; mends have arguments as `name=` and `name=value`.
        options: Options of the command by the names of its parameters.
    """
    fault, *mends = message.split("; ")
    argument, colon, rest = fault.partition(": ")
    if rest.startswith("no option of") and "--option" in options.values():
        argument = f"--option {argument}"
    named = [_words(each, options) for each in argument.split(", ")]
    if all(named):
        argument = ", ".join(map(str, named))
    rest = rest.replace(CONVERGED, _words(CONVERGED, options) or CONVERGED)
    return "; ".join([f"{argument}{colon}{rest}", *(_by_options(mend, options) for mend in mends)])


def _by_options(mend: str, options: Mapping[str, str]) -> str:
    """`mend` with options; as it is, but with the place where to do it, if there is none for an argument."""
    arguments = [found[1] for found in ARGUMENT.finditer(mend)]
    if all(_words(argument, options) for argument in arguments):
        return ARGUMENT.sub(lambda found: _with_value(found, options), mend)
    # of several places the one that takes all
    return f"{min(ELSEWHERE.get(argument, PYTHON) for argument in arguments)}, {mend}"


def _with_value(found: re.Match[str], options: Mapping[str, str]) -> str:
    if whole := _words(found[0], options):
        return whole
    words = _words(found[1], options) or found[1]
    value = (found[2] or "...").replace("True", "true")
    if words.startswith("--option"):
        return f"{words}={value}"
    # words say what a value means, but not a path or a number
    return f"{words} {value}" if value.isdecimal() or any(mark in value for mark in "/\\") else words


def _words(argument: str, options: Mapping[str, str]) -> str | None:
    """Words for an argument; None where the command has no option for it."""
    others = (words for option, words in WORDS.get(argument, {}).items() if option in options.values())
    # what --option takes first: errors of poses=maybe are not about --poses
    return next(others, None) or options.get(argument)
