"""All of a segmentation in one `.npz` file: what came out, and the points, masks and cameras that it came from."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ldls.camera.distortion import Distortion
from ldls.errors import CorruptFileError, LdlsError, UnsupportedFormatError
from ldls.io.cameras.found import FoundCamera
from ldls.io.masks.npz import mask_arrays, records_of
from ldls.io.masks.records import MaskRecords
from ldls.io.npz import read_npz, write_npz

if TYPE_CHECKING:
    from ldls.camera import Camera
    from ldls.segmentation import Segmentation, SegmentedObject

Arrays = Mapping[str, NDArray[Any]]
MASKS = "masks_"
"""How the names of the arrays begin that hold the masks of a view."""


@dataclass(frozen=True, eq=False, kw_only=True)
class StoredView:
    """A view of a file, before it is checked as a whole; fields are those of `SeenView` and `View`."""

    name: str
    camera: FoundCamera
    masks: MaskRecords
    in_view: NDArray[np.int64]
    pixels: NDArray[np.float64]
    labels: NDArray[np.int32]


@dataclass(frozen=True, eq=False, kw_only=True)
class StoredResult:
    """A segmentation of a file, before it is checked as a whole; fields are those of `Segmentation` and `Instance`."""

    labels: NDArray[np.int32]
    diffused_labels: NDArray[np.int32]
    confidence: NDArray[np.float32]
    in_view: NDArray[np.int64]
    points: NDArray[Any]
    views: tuple[StoredView, ...]
    categories: list[int]
    names: list[str]
    scores: list[float]
    params: dict[str, Any]
    report: dict[str, Any]
    timings: dict[str, float]


def write(path: str | PathLike[str], result: Segmentation) -> None:
    """Write the arrays of `result` under their names, its objects as `object_*`, the rest as JSON text.

    `view_names` has a name for each camera. With one, `pixels` belongs to `in_view`, `camera` is its calibration, and
    `masks_size`, `masks_runs` and so on are what `InstanceMasks.save` writes; with several, `view0_in_view`,
    `view0_pixels`, `view0_labels`, `view0_camera`, `view0_masks_size` and so on are those of each.
    `object_box` has a row for each object: x y z of the middle, length, width, height in metres, yaw in radians; NaN
    where the object has no point.
    """
    objects = result.objects
    write_npz(
        path,
        {
            "labels": result.labels,
            "diffused_labels": result.diffused_labels,
            "categories": result.categories,
            "confidence": result.confidence,
            "in_view": result.in_view,
            "points": result.points,
            **_views(result),
            "object_category": np.array([o.category for o in objects], np.int32),
            "object_name": np.array([o.name for o in objects], np.str_),
            "object_score": np.array([o.score for o in objects], np.float32),
            "object_n_points": np.array([o.n_points for o in objects], np.int64),
            "object_centroid": np.array([_centroid(o) for o in objects]).reshape(-1, 3),
            "object_box": np.array([_box(o) for o in objects]).reshape(-1, 7),
            "params": _json(asdict(result.params)),
            "report": _json(asdict(result.report)),
            "timings": _json(dict(result.timings)),
        },
    )


def read(path: str | PathLike[str]) -> StoredResult:
    """What `write` wrote.

    Raises:
        UnsupportedFormatError: It is not a result of ldls, or of a version that did not store the points.
        CorruptFileError: It is not a whole `.npz` file, or something is missing from it.
        FileNotFoundError: There is no such file.
    """
    arrays = read_npz(path)
    if not {"labels", "diffused_labels", "object_name"} <= arrays.keys():
        raise UnsupportedFormatError(f"{path}: found arrays {sorted(arrays)}, expected those of Segmentation.save")
    if "points" not in arrays:
        raise UnsupportedFormatError(f"{path}: holds no points, as earlier versions wrote it; segment the frame again")
    try:
        return _stored(str(path), arrays)
    except LdlsError as error:
        raise type(error)(f"{path}: {error}") from None
    except (KeyError, ValueError, TypeError, IndexError) as error:
        raise CorruptFileError(f"{path}: not a whole result ({error})") from None


def _views(result: Segmentation) -> dict[str, NDArray[Any]]:
    if len(result.views) == 1:
        (seen,) = result.views
        given = _given("", seen.view.camera, mask_arrays(seen.view.masks))
        return {"view_names": np.array([seen.view.name], np.str_), "pixels": result.pixels, **given}
    arrays: dict[str, NDArray[Any]] = {
        "view_names": np.array([seen.view.name or f"camera {i}" for i, seen in enumerate(result.views)], np.str_)
    }
    for i, seen in enumerate(result.views):
        arrays |= {f"view{i}_in_view": seen.in_view, f"view{i}_pixels": seen.pixels, f"view{i}_labels": seen.labels}
        arrays |= _given(f"view{i}_", seen.view.camera, mask_arrays(seen.view.masks))
    return arrays


def _given(prefix: str, camera: Camera, masks: Arrays) -> dict[str, NDArray[Any]]:
    parts = {
        "projection": camera.projection.tolist(),
        "T_camera_lidar": camera.T_camera_lidar.tolist(),
        "distortion": asdict(camera.distortion),
        "image_size": camera.image_size,
        "min_depth_m": camera.min_depth_m,
    }
    return {f"{prefix}camera": _json(parts), **{f"{prefix}{MASKS}{name}": array for name, array in masks.items()}}


def _stored(place: str, arrays: Arrays) -> StoredResult:
    return StoredResult(
        labels=arrays["labels"],
        diffused_labels=arrays["diffused_labels"],
        confidence=arrays["confidence"],
        in_view=arrays["in_view"],
        points=arrays["points"],
        views=_stored_views(place, arrays),
        categories=arrays["object_category"].tolist(),
        names=arrays["object_name"].tolist(),
        scores=arrays["object_score"].tolist(),
        params=json.loads(str(arrays["params"])),
        report=json.loads(str(arrays["report"])),
        timings=json.loads(str(arrays["timings"])),
    )


def _stored_views(place: str, arrays: Arrays) -> tuple[StoredView, ...]:
    names = arrays["view_names"].tolist()
    if len(names) != 1:
        return tuple(_stored_view(place, arrays, f"view{i}_", name) for i, name in enumerate(names))
    every_mask = {"labels": np.arange(1, len(arrays["object_name"]) + 1, dtype=np.int32)}
    return (_stored_view(place, {**arrays, **every_mask}, "", names[0]),)


def _stored_view(place: str, arrays: Arrays, prefix: str, name: str) -> StoredView:
    start = prefix + MASKS
    masks = {name.removeprefix(start): array for name, array in arrays.items() if name.startswith(start)}
    return StoredView(
        name=name,
        camera=_camera(place, json.loads(str(arrays[f"{prefix}camera"]))),
        masks=records_of(place, masks),
        in_view=arrays[f"{prefix}in_view"],
        pixels=arrays[f"{prefix}pixels"],
        labels=arrays[f"{prefix}labels"],
    )


def _camera(place: str, parts: dict[str, Any]) -> FoundCamera:
    size = parts["image_size"]
    return FoundCamera(
        place=place,
        projection=np.array(parts["projection"]),
        T_camera_lidar=np.array(parts["T_camera_lidar"]),
        distortion=Distortion(**parts["distortion"]),
        image_size=None if size is None else (int(size[0]), int(size[1])),
        min_depth_m=float(parts["min_depth_m"]),
    )


def _json(parts: Mapping[str, Any]) -> NDArray[np.str_]:
    return np.array(json.dumps(parts))


def _centroid(found: SegmentedObject) -> NDArray[np.float64]:
    return np.full(3, np.nan) if found.centroid is None else found.centroid


def _box(found: SegmentedObject) -> NDArray[np.float64]:
    if found.box is None:
        return np.full(7, np.nan)
    return np.concatenate([found.box.center, found.box.size, [found.box.yaw]])
