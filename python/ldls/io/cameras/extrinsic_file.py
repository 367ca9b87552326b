"""Extrinsics beside a camera file: the numbers of a matrix, or keys as of `ldls.extrinsic`."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls.camera.extrinsic import extrinsic
from ldls.camera.fields import Fields
from ldls.camera.rigid import as_transform, inverse, rigid
from ldls.checks.values import number_of
from ldls.errors import CalibrationError, within
from ldls.io.cameras.field_file import fields_of
from ldls.io.files import open_file

MAX_BYTES = 1 << 16
BETWEEN = str.maketrans("[],;", "    ")
"""What may stand between the numbers of a matrix, as JSON, NumPy and MATLAB write it."""
PARTS = ("translation", "pose_of", "quaternion_wxyz", "quaternion_xyzw", "roll_pitch_yaw_deg", "rotation", "optical")
WORDS = ("pose_of", "optical")
AXES = {"translation": "xyz", "quaternion_wxyz": "wxyz", "quaternion_xyzw": "xyzw", "rotation": "xyzw"}
"""Names of the numbers of parts, in their order."""
EXAMPLE = "name the parts, as translation: [0.1, 0.0, -0.2], quaternion_xyzw: [0.0, 0.0, 0.0, 1.0], pose_of: camera"
MATRICES = ("T_camera_lidar", "T_lidar_camera")
SAME = 1e-3
"""Largest difference between numbers of two matrices of one transform, which may be rounded."""

Extrinsic = ArrayLike | str | PathLike[str] | Mapping[str, Any]
"""A (4, 4) `T_camera_lidar`, a file of it, or a table of its parts."""


def as_extrinsic(given: Extrinsic, place: str = "T_camera_lidar") -> NDArray[np.float64]:
    """`T_camera_lidar`, (4, 4), as it is given.

    Args:
        given: A matrix; a table with `T_camera_lidar` or `T_lidar_camera`, or with the arguments of `ldls.extrinsic`;
            or a file with the 12 or 16 numbers of `T_camera_lidar` by rows, where # begins a comment and brackets,
            commas and semicolons count as blanks, or with such a table in YAML, JSON or TOML.
        place: What to call it in errors.

    Raises:
        CalibrationError: It is none of these, or no rigid transform.
        FileNotFoundError: There is no such file.
    """
    if isinstance(given, str | PathLike):
        return _read(Path(given))
    if isinstance(given, Mapping):
        return _from_table(Fields(place, given))
    return as_transform(place, given)


def _read(path: Path) -> NDArray[np.float64]:
    with open_file(path, "transform", limit=MAX_BYTES) as file:
        text = file.text()
        words = [word for line in text.splitlines() for word in line.partition("#")[0].translate(BETWEEN).split()]
        numbers = _numbers(words)
        if numbers is not None:
            return _from_numbers(str(path), numbers)
        if path.suffix.lower() == ".toml":
            return _from_table(Fields(str(path), tomllib.loads(text)))
        if text.lstrip().startswith("{"):
            return _from_table(Fields(str(path), json.loads(text, object_pairs_hook=_entries)))
        return _from_table(fields_of(text, str(path)))


def _entries(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """The entries of an object of JSON, which itself takes the last of those of one key."""
    entries = dict(pairs)
    if len(entries) < len(pairs):
        twice = next(key for i, (key, _) in enumerate(pairs) if key in dict(pairs[:i]))
        raise CalibrationError(f"key '{twice}' stands there twice")
    return entries


def _numbers(words: list[str]) -> NDArray[np.float64] | None:
    try:
        return np.array([number_of(word) for word in words])
    except ValueError:
        return None


def _from_numbers(place: str, numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    if numbers.size not in (12, 16):
        raise CalibrationError(
            f"{place}: expected the 12 or 16 numbers of T_camera_lidar by rows, got {numbers.size}"
            f"{f'; {EXAMPLE}' if numbers.size in (6, 7) else ''}"
        )
    if not np.isfinite(numbers).all():
        raise CalibrationError(f"{place}: expected finite numbers, got {numbers[~np.isfinite(numbers)][0]}")
    transform = np.eye(4)
    transform.flat[: numbers.size] = numbers
    return rigid(place, transform)


def _from_table(fields: Fields) -> NDArray[np.float64]:
    matrices = [_matrix(fields, name) for name in MATRICES if fields.find(name) is not None]
    if matrices:
        # a camera, a comment or names of frames may stand beside it
        part = next((name for name in PARTS if fields.find(name) is not None), None)
        if part is not None:
            raise CalibrationError(f"{fields.place}: found {part} beside a matrix; leave one of them out")
        if not np.allclose(matrices[0], matrices[-1], rtol=0, atol=SAME):
            raise CalibrationError(
                f"{fields.place}: {' and '.join(MATRICES)} contradict each other; leave one of them out"
            )
        return matrices[0]
    unknown = [str(key) for key in fields.entries if key not in PARTS]
    if unknown:
        raise CalibrationError(
            f"{fields.place}: unknown key {unknown[0]!r}, expected {' or '.join(MATRICES)}, or {', '.join(PARTS)}; "
            f"{EXAMPLE}"
        )
    if fields.find("pose_of") is None:
        raise CalibrationError(
            f"{fields.place}: pose_of is missing; write 'camera' where it is the pose of the camera in the lidar "
            "frame, as in a URDF or /tf, and 'lidar' where it maps lidar to camera coordinates"
        )
    # the one part that must be there
    fields.get("translation", mend=EXAMPLE)
    entries = {name: value for name, value in fields.entries.items() if value is not None}
    rotation = entries.get("rotation")
    if isinstance(rotation, Mapping) and rotation.keys() == set("xyzw") and "quaternion_xyzw" not in entries:
        entries["quaternion_xyzw"] = entries.pop("rotation")
    with within(fields.place):
        listed = Fields(fields.place, {name: _in_order(name, value) for name, value in entries.items()})
        # YAML takes 1e-05 for text, which `numbers` knows
        parts: dict[str, Any] = {name: v if name in WORDS else listed.numbers(name) for name, v in entries.items()}
        return extrinsic(**parts)


def _matrix(fields: Fields, name: str) -> NDArray[np.float64]:
    matrix = rigid(f"{fields.place}: {name}", fields.matrix((4, 4), name))
    return inverse(matrix) if name == "T_lidar_camera" else matrix


def _in_order(name: str, value: object) -> object:
    """The list of a part that has the names of its axes, as in ROS; any other value as it is."""
    axes = AXES.get(name)
    if axes is None or not isinstance(value, Mapping) or "data" in value:
        return value
    if value.keys() != set(axes):
        found = " ".join(map(str, value)) or "none"
        example = ", ".join(f"{axis}: {float(axis == 'w')}" for axis in axes)
        raise CalibrationError(f"{name}: found keys {found}, expected a list of numbers, or keys as {{{example}}}")
    return [value[axis] for axis in axes]
