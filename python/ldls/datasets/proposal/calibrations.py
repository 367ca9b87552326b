"""Cameras that calibration files of a folder may describe, and the one of several transforms that shows the points."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path, PurePosixPath
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera
from ldls.camera.extrinsic import extrinsic
from ldls.camera.fields import Fields
from ldls.camera.rigid import inverse, rigid
from ldls.cloud import Points, finite_rows
from ldls.errors import LdlsError, LimitError, SourceError
from ldls.io import read_camera
from ldls.io.cameras.extrinsic_file import SAME, as_extrinsic
from ldls.io.cameras.field_file import read_fields
from ldls.io.cameras.opencv import MATRIX, camera_of
from ldls.stages import project

NEARLY = 0.8
"""Share of the most points in view from which on a transform shows about as many."""
QUATERNIONS = ("quaternion_xyzw", "quaternion_wxyz")
TRANSLATIONS = ("translation", "t", "T", "position", "trans")
WAYS = ("rotation", *QUATERNIONS, "roll_pitch_yaw_deg")
ROTATIONS = ("R", "quaternion", "orientation", "rot", *WAYS)


@dataclass(frozen=True)
class FoundCamera:
    """A camera of a file.

    Attributes:
        camera: The camera; where the file does not know the lidar, as if it were at the camera.
        lines: Its keys for ldls.toml.
        knows_lidar: True where the file says where the lidar is.
        place: Where it stands, for comments.
    """

    camera: Camera
    lines: tuple[str, ...]
    knows_lidar: bool
    place: str


@dataclass(frozen=True)
class FoundTransform:
    """A transform of a file, read in one of the ways in which it can be.

    Attributes:
        matrix: (4, 4) `T_camera_lidar`.
        line: Its key for ldls.toml.
        file: The pattern of its file.
        how: Its place and how it was read, for comments.
        is_sure: True where the file says how it is to be read.
    """

    matrix: NDArray[np.float64]
    line: str
    file: str
    how: str
    is_sure: bool


def camera_in(path: Path, pattern: str, hint: str) -> FoundCamera | None:
    """The camera of a file; None where it has none.

    Args:
        path: The file.
        pattern: What ldls.toml is to call it.
        hint: Name of the folder of the camera's images, which may tell which of several cameras it is.
    """
    line = f"calibration = {quoted(pattern)}"
    for which in _which(hint):
        number = quoted(which) if isinstance(which, str) else which
        keys = () if which is None else (f"calibration_camera = {number}",)
        camera = _read(path, camera=which)
        if camera is not None:
            return FoundCamera(camera, (line, *keys), True, pattern)
        camera = _read(path, camera=which, T_camera_lidar=np.eye(4))
        if camera is not None:
            return FoundCamera(camera, (line, *keys), False, pattern)
    for name, table in _tables(path):
        fields = Fields(f"{path}: {name}", table)
        if fields.find(*MATRIX) is None:
            continue
        try:
            camera = camera_of(fields, T_camera_lidar=np.eye(4))
        except LdlsError:
            continue
        return FoundCamera(camera, _inline(camera), False, f"{name} of {pattern}")
    return None


def transforms_in(path: Path, pattern: str) -> list[FoundTransform]:
    """The transforms of a file, in all ways in which it can be read; none where it has none."""
    tables = _tables(path)
    try:
        matrix = as_extrinsic(path)
    except (LdlsError, ImportError, ValueError):
        return [each for name, table in tables for each in _of_table(name, table, pattern)]
    found = [FoundTransform(matrix, f"T_camera_lidar = {quoted(pattern)}", pattern, pattern, True)]
    # numbers alone do not say of what they are
    return found if tables else [*found, _found(inverse(matrix), pattern, f"{pattern}, turned round")]


def plausible_transforms(
    found: Iterable[FoundTransform], own: Collection[str], camera: Camera, points: Points, size: tuple[int, int]
) -> list[tuple[FoundTransform, float]]:
    """The transforms by which the lidar stands upright and about the most points are in view, and these shares.

    Those of the camera's `own` files go before all others, however many points these show. They come in the order in
    which they were found, the usual ways first; of equal ones there is the first.
    """
    placed = [(each, *view_of(replace(camera, T_camera_lidar=each.matrix), points, size)) for each in found]
    seen = [each for each in placed if each[2] > 0]
    upright = [each for each in seen if each[1]] or seen
    upright = [each for each in upright if each[0].file in own] or upright
    most = max((share for _, _, share in upright), default=0.0)
    different: list[tuple[FoundTransform, float]] = []
    for each, _, share in upright:
        known = (np.allclose(each.matrix, other.matrix, atol=SAME) for other, _ in different)
        if share >= NEARLY * most and not any(known):
            different.append((each, share))
    return different


def view_of(camera: Camera, points: Points, size: tuple[int, int]) -> tuple[bool, float]:
    """True where z of the lidar points up in the image, and the share of the points that the image sees."""
    x, y, _ = camera.T_camera_lidar[:3, 2]
    in_view, _ = project(points, camera, image_size=camera.image_size or size)
    return bool(-y > 0.5 * np.hypot(x, y)), len(in_view) / max(len(finite_rows(points)), 1)


def quoted(text: str) -> str:
    """A name in quotes, as ldls.toml has it.

    Raises:
        SourceError: It is that of a file whose bytes are no text.
    """
    try:
        text.encode()
    except UnicodeEncodeError:
        raise SourceError(f"{text!a}: a name that is not in UTF-8 cannot stand in ldls.toml; rename it") from None
    # what JSON escapes, TOML does in the same way, and DEL
    return json.dumps(text, ensure_ascii=False).replace("\x7f", r"\u007f")


def matrix_line(name: str, matrix: NDArray[np.float64]) -> str:
    """A matrix as a key of ldls.toml."""
    rows = ", ".join(f"[{', '.join(repr(float(value)) for value in row)}]" for row in matrix)
    return f"{name} = [{rows}]"


def _which(hint: str) -> list[int | str | None]:
    """Cameras that a folder's name may stand for: image_02 is KITTI's 2 and Kalibr's cam2."""
    digits = "".join(character for character in hint if character.isdigit())
    return [int(digits), f"cam{int(digits)}", None] if digits else [None]


def _read(path: Path, **options: Any) -> Camera | None:  # noqa: ANN401 - options of many types
    try:
        return read_camera(path, **{name: value for name, value in options.items() if value is not None})
    except (LdlsError, ImportError, ValueError):
        return None


def _tables(path: Path) -> list[tuple[str, Mapping[str, Any]]]:
    """The tables of a file of names and values, and those within them, by name."""
    try:
        return list(_within(path.name, read_fields(path).entries))
    except (LdlsError, ImportError, LimitError):
        return []


def _within(name: str, table: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    yield name, table
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _within(str(key), value)


def _inline(camera: Camera) -> tuple[str, ...]:
    distortion = camera.distortion
    lines = [matrix_line("K", camera.projection[:, :3])]
    if distortion.model != "none":
        numbers = ", ".join(repr(float(value)) for value in distortion.coefficients)
        lines.append(f'distortion = {{ model = "{distortion.model}", coefficients = [{numbers}] }}')
    if camera.image_size is not None:
        lines.append(f"image_size = {list(camera.image_size)}")
    return tuple(lines)


def _of_table(name: str, table: Mapping[str, Any], pattern: str) -> Iterator[FoundTransform]:
    fields = Fields(name, table)
    for key in table:
        matrix = _rigid(fields, str(key))
        if matrix is not None:
            for words, read in (("as it stands", matrix), ("turned round", inverse(matrix))):
                yield _found(read, pattern, f"{key} of {pattern}, {words}")
    shift = fields.find(*TRANSLATIONS)
    turn = fields.find(*ROTATIONS)
    if shift is None or turn is None:
        return
    poses: tuple[Literal["camera", "lidar"], ...] = ("camera", "lidar")
    # where axes are named there is one order
    ways = WAYS[1:2] if isinstance(turn, Mapping) else WAYS
    place = pattern if name == PurePosixPath(pattern).name else f"{name} of {pattern}"
    for pose_of, optical, way in product(poses, (True, False), ways):
        try:
            matrix = extrinsic(_values(shift), pose_of=pose_of, optical=optical, **{way: _values(turn)})
        except (LdlsError, TypeError, ValueError):
            continue
        frame = "" if optical else ", whose x looks ahead"
        yield _found(matrix, pattern, f"{place}, as the pose of the {pose_of}{frame}, {way}")


def _rigid(fields: Fields, key: str) -> NDArray[np.float64] | None:
    try:
        numbers = fields.numbers(key)
        if numbers.size not in (12, 16):
            return None
        matrix = np.eye(4)
        matrix.flat[: numbers.size] = numbers.ravel()
        return rigid(key, matrix)
    except LdlsError:
        return None


def _found(matrix: NDArray[np.float64], file: str, how: str) -> FoundTransform:
    return FoundTransform(matrix, matrix_line("T_camera_lidar", matrix), file, how, False)


def _values(value: Any) -> Any:  # noqa: ANN401 - whatever stands in a file
    """Numbers of a list, or of x, y, z and w by their names."""
    return [value[axis] for axis in "xyzw" if axis in value] if isinstance(value, Mapping) else value
