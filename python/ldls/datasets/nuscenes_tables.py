"""The tables of nuScenes: readings of sensors for each key frame, and poses of the car and its sensors.

Tables are read a row at a time; only rows of the key frames that are wanted are kept.
"""

from __future__ import annotations

import warnings
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import UnionType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Distortion
from ldls.camera.rigid import from_parts, from_quaternion
from ldls.datasets.file_source import check_folders, choose
from ldls.errors import CalibrationError, CorruptFileError, LeftOutWarning, SourceError, some, within
from ldls.io.files import parsing
from ldls.io.json_rows import read_json_rows
from ldls.io.labels.nuscenes_labels import NUSCENES
from ldls.labeling import MOST_CODES

T = TypeVar("T")
Number = int | float
Side = int | None
HUGE = 2**63
TABLES = ("scene", "sample", "sample_data", "calibrated_sensor", "ego_pose", "sensor")


@dataclass(frozen=True, slots=True)
class Reading:
    """Reading of one sensor for a key frame.

    Attributes:
        token: Its token in sample_data.
        filename: Its file, below the folder of the data set.
        stamp_us: Time at which it was taken, in microseconds since 1970.
        sensor: Token of its calibrated sensor.
        pose: Token of the car's pose then.
        size: (height, width) of an image in pixels.
    """

    token: str
    filename: str
    stamp_us: int
    sensor: str
    pose: str
    size: tuple[int, int]


@dataclass(frozen=True, slots=True, eq=False)
class CalibratedSensor:
    """A sensor on a car.

    Attributes:
        channel: Its name, as "CAM_FRONT".
        T_ego_sensor: (4, 4) from the sensor's frame to the car's.
        intrinsic: (3, 3) matrix K of a camera; empty for others.
        distortion: Of the camera's images; none in nuScenes, whose images are rectified.
    """

    channel: str
    T_ego_sensor: NDArray[np.float64]
    intrinsic: NDArray[np.float64]
    distortion: Distortion


def find_tables(path: Path, version: str | None) -> Path:
    """Folder of the tables.

    Raises:
        SourceError: There is none, there are several, or one lacks a table.
        FileNotFoundError: There is no folder `path`.
    """
    check_folders(path, ())
    versions = sorted(table.parent.name for table in path.glob("v1.0-*/sample_data.json"))
    if not versions:
        there = some(sorted(each.name for each in path.glob("*"))) or "nothing"
        raise SourceError(
            f"{path}: has no v1.0-*/sample_data.json, as nuScenes has beside samples and sweeps; found {there}"
        )
    tables = path / choose(path, "version", versions, version)
    missing = [name for name in TABLES if not (tables / f"{name}.json").is_file()]
    if missing:
        there = some(sorted(table.name for table in tables.glob("*.json")))
        raise SourceError(f"{tables}: has no {', '.join(f'{name}.json' for name in missing)}; found {there}")
    return tables


def read_sample_names(tables: Path, scene: str | None) -> dict[str, str]:
    """Names of the samples of a scene, or of all scenes, by token: scene and number, in the order of their time.

    Those of scenes that the table of scenes lacks, as that of a part of a data set does, are left out; with a warning
    where all scenes are wanted.

    Raises:
        SourceError: There is no such scene.
        CorruptFileError: A table is broken.
    """
    names = {row["token"]: row["name"] for row in _rows(tables, "scene", {"token": str, "name": str})}
    twice = [name for name, count in Counter(names.values()).items() if count > 1]
    if twice:
        raise CorruptFileError(f"{tables / 'scene.json'}: two scenes are named {twice[0]!r}, expected a name for each")
    if scene is not None:
        choose(tables, "scene", sorted(names.values()), scene)
    samples: dict[str, list[tuple[int, str]]] = defaultdict(list)
    strange: Counter[str] = Counter()
    for row in _rows(tables, "sample", {"token": str, "scene_token": str, "timestamp": Number}):
        name = names.get(row["scene_token"])
        if name is None:
            strange[row["scene_token"]] += 1
        elif scene in (None, name):
            samples[name].append((row["timestamp"], row["token"]))
    if strange and scene is None:
        message = (
            f"{tables / 'sample.json'}: {strange.total():,} key frames are left out, of scenes that scene.json lacks"
        )
        warnings.warn(f"{message}: {some(list(strange))}", LeftOutWarning, stacklevel=4)
    in_order = sorted((sorted(own), name) for name, own in samples.items())
    return {token: f"{name}_{number:03d}" for own, name in in_order for number, (_, token) in enumerate(own)}


def read_channels(tables: Path) -> dict[str, tuple[str, str]]:
    """Channel and modality, as "lidar" and "camera", of each sensor by token, in the order of the table.

    Raises:
        CorruptFileError: The table is broken.
    """
    rows = _rows(tables, "sensor", {"token": str, "channel": str, "modality": str})
    return {row["token"]: (row["channel"], row["modality"]) for row in rows}


def read_sensors(
    tables: Path, channels: Mapping[str, tuple[str, str]], wanted: Sequence[str]
) -> dict[str, CalibratedSensor | None]:
    """The calibrated sensors of the `wanted` of `channels`, by token; None for each of the others.

    Raises:
        CalibrationError: A pose is none, or a camera has no intrinsic matrix.
        CorruptFileError: A table is broken, or lacks a sensor.
    """
    columns = {"token": str, "sensor_token": str, "translation": list, "rotation": list, "camera_intrinsic": list}
    sensors: dict[str, CalibratedSensor | None] = {}
    for row in _rows(tables, "calibrated_sensor", columns):
        channel, modality = _named(tables, "calibrated_sensor", row, "sensor", channels)
        if channel not in wanted:
            sensors[row["token"]] = None
            continue
        place = f"{tables / 'calibrated_sensor.json'}, {row['token']}"
        intrinsic = _numbers(place, row["camera_intrinsic"])
        if modality == "camera" and intrinsic.shape not in ((3, 3), (3, 4)):
            raise CalibrationError(
                f"{place}: camera_intrinsic of {channel} has the shape {intrinsic.shape}, expected (3, 3)"
            )
        distortion = _distortion(place, row.get("camera_distortion") or [])
        sensors[row["token"]] = CalibratedSensor(channel, _transform(place, row), intrinsic, distortion)
    return sensors


def read_readings(
    tables: Path, samples: Mapping[str, str], sensors: Mapping[str, CalibratedSensor | None]
) -> dict[str, dict[str, Reading]]:
    """Readings of `sensors`, but for those that are None, for the key frames `samples`, by sample and channel.

    Raises:
        CorruptFileError: The table is broken, or has readings of a sensor that `sensors` lack.
    """
    readings: dict[str, dict[str, Reading]] = {token: {} for token in samples}
    sizes: dict[tuple[int, int], tuple[int, int]] = {}
    # one token for each sensor, where each row has one of its own
    own = {token: (token, sensor) for token, sensor in sensors.items()}
    columns: dict[str, type | UnionType] = {
        "token": str, "sample_token": str, "is_key_frame": Number, "calibrated_sensor_token": str,
        "ego_pose_token": str, "filename": str, "timestamp": Number, "height": Side, "width": Side,
    }  # fmt: skip
    for row in _rows(tables, "sample_data", columns):
        if not row["is_key_frame"] or row["sample_token"] not in readings:
            continue
        token, sensor = _named(tables, "sample_data", row, "calibrated_sensor", own)
        if sensor is None:
            continue
        size = (row["height"] or 0, row["width"] or 0)
        readings[row["sample_token"]][sensor.channel] = Reading(
            token=row["token"],
            filename=row["filename"],
            stamp_us=row["timestamp"],
            sensor=token,
            pose=row["ego_pose_token"],
            size=sizes.setdefault(size, size),
        )
    return readings


def read_poses(tables: Path, tokens: set[str]) -> dict[str, NDArray[np.float64]]:
    """(4, 4) T_global_ego of each pose that is wanted.

    Raises:
        CalibrationError: One is no pose.
        CorruptFileError: The table is broken, lacks one, or has two of one token.
    """
    rows = _rows(tables, "ego_pose", {"token": str, "translation": list, "rotation": list})
    path = tables / "ego_pose.json"
    poses: dict[str, NDArray[np.float64]] = {}
    for row in (row for row in rows if row["token"] in tokens):
        pose = _transform(f"{path}, {row['token']}", row)
        if not np.array_equal(poses.setdefault(row["token"], pose), pose):
            raise CorruptFileError(f"{path}, {row['token']}: two rows with this token have two poses, expected one")
    if len(poses) < len(tokens):
        raise CorruptFileError(f"{path}: lacks {len(tokens) - len(poses)} of {len(tokens)} poses of sample_data.json")
    return poses


def read_truth_files(tables: Path, name: str, tokens: set[str]) -> dict[str, str]:
    """Files of the table `name`, "lidarseg" or "panoptic", by the sweeps `tokens` that they label; empty without it.

    Raises:
        CorruptFileError: The table is broken.
    """
    if not tokens or not (tables / f"{name}.json").is_file():
        return {}
    rows = _rows(tables, name, {"sample_data_token": str, "filename": str})
    return {row["sample_data_token"]: row["filename"] for row in rows if row["sample_data_token"] in tokens}


def read_classes(tables: Path) -> dict[int, str]:
    """Names of the classes of truth by their numbers, where the table of categories has any, else nuScenes'.

    0 is nuScenes' noise where the table does not say.

    Raises:
        CorruptFileError: The table is broken, or two rows have one number.
    """
    if not (tables / "category.json").is_file():
        return NUSCENES
    own: dict[int, str] = {}
    for number, row in enumerate(_rows(tables, "category", {"name": str}), start=1):
        place, index = f"{tables / 'category.json'}, row {number}", row.get("index")
        if index is None:
            continue
        if not isinstance(index, int) or not 0 <= index <= MOST_CODES:
            raise CorruptFileError(f"{place}: index is {index!r}, expected 0 to {MOST_CODES}")
        if index in own:
            raise CorruptFileError(f"{place}: index is {index}, as in another row")
        own[index] = row["name"]
    return {0: NUSCENES[0]} | own if own else NUSCENES


def _named(tables: Path, name: str, row: Mapping[str, Any], other: str, rows: Mapping[str, T]) -> T:
    """The one of `rows`, those of the table `other` by token, that a row of the table `name` names."""
    token = row[f"{other}_token"]
    if token not in rows:
        raise CorruptFileError(
            f"{tables / name}.json, {row['token']}: {other}_token is {token!r}, which {other}.json has no row of"
        )
    return rows[token]


def _transform(place: str, row: Mapping[str, Any]) -> NDArray[np.float64]:
    translation = _numbers(place, row["translation"])
    if translation.shape != (3,) or not np.isfinite(translation).all():
        raise CalibrationError(f"{place}: translation {row['translation']}, expected three finite numbers")
    quaternion = _numbers(place, row["rotation"])
    if quaternion.shape != (4,):
        raise CalibrationError(f"{place}: rotation {row['rotation']}, expected a quaternion w x y z")
    return from_parts(from_quaternion(place, quaternion), translation)


def _distortion(place: str, coefficients: list[Any]) -> Distortion:
    with within(place):
        return Distortion.from_opencv(_numbers(place, coefficients))


def _numbers(place: str, values: list[Any]) -> NDArray[np.float64]:
    with within(place), parsing("row"):
        return np.array(values, np.float64)


def _rows(tables: Path, name: str, columns: Mapping[str, type | UnionType]) -> Iterator[dict[str, Any]]:
    """The rows of a table, each with all of `columns`, of their types."""
    path = tables / f"{name}.json"
    for number, row in enumerate(read_json_rows(path), start=1):
        missing = ", ".join(key for key in columns if key not in row)
        if missing:
            raise CorruptFileError(f"{path}, row {number}: lacks {missing}")
        for key, kind in columns.items():
            value = row[key]
            if not isinstance(value, kind) or (isinstance(value, Number) and not abs(value) < HUGE):
                raise CorruptFileError(f"{path}, row {number}: {key} is {str(value)[:80]!r}, expected {kind}")
        yield row
