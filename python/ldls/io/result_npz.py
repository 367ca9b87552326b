"""All of a segmentation in one `.npz` file: what came out, and the points, masks and cameras that it came from."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sized
from dataclasses import asdict, replace
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera, Distortion
from ldls.cloud import as_points
from ldls.errors import CorruptFileError, InputError, UnsupportedFormatError
from ldls.io.arrays import open_npz, write_npz
from ldls.io.masks.npz import mask_arrays, masks_of
from ldls.params import Params
from ldls.segmentation import Instance, Report, Segmentation, SegmentedObject
from ldls.view import SeenView, View

Arrays = Mapping[str, NDArray[Any]]
ARRAYS = frozenset(("labels", "diffused_labels", "object_name"))
"""Arrays by which a result is known."""
MASKS = "masks_"
"""Prefix of the arrays that hold the masks of a view."""


def write(path: str | PathLike[str], result: Segmentation) -> None:
    """Write the arrays of `result` under their names, its objects as `object_*`, the rest as JSON text.

    `view_names` has a name for each camera. With one, `pixels` belongs to `in_view`, `camera` is its calibration, and
    `masks_size`, `masks_runs` and so on are those of a `.npz` of masks (of a sweep among others `mask_labels` and
    `mask_in_view` are those of the view, where they differ); with several, `view0_in_view`,
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
            **_tracks(result),
            "object_n_points": np.array([o.n_points for o in objects], np.int64),
            "object_centroid": np.array([_centroid(o) for o in objects]).reshape(-1, 3),
            "object_box": np.array([_box(o) for o in objects]).reshape(-1, 7),
            "params": _json(asdict(result.params)),
            "report": _json(asdict(result.report)),
            "timings": _json(dict(result.timings)),
        },
    )


def read(path: str | PathLike[str]) -> Segmentation:
    """The segmentation that `write` wrote.

    Raises:
        UnsupportedFormatError: It is not a result of ldls, or of a version that did not store the points.
        CorruptFileError: It is not a whole `.npz` file, or its arrays do not fit one another.
        FileNotFoundError: There is no such file.
    """
    with open_npz(path, "result") as arrays:
        if not arrays.keys() >= ARRAYS:
            raise UnsupportedFormatError(f"found arrays {arrays.listed()}, expected those of ldls.save")
        if "points" not in arrays:
            raise UnsupportedFormatError("holds no points, as earlier versions wrote it; segment the frame again")
        try:
            result = _result(arrays)
            _check(result)
        except InputError as error:
            raise CorruptFileError(f"not a whole result ({error})") from None
        return result


def holds_result(path: str | PathLike[str]) -> bool:
    """True for an `.npz` file that `read` reads, by the names of its arrays.

    Raises:
        CorruptFileError: It is not a whole `.npz` file.
        FileNotFoundError: There is no such file.
    """
    with open_npz(path) as arrays:
        return ARRAYS | {"points"} <= arrays.keys()


def _tracks(result: Segmentation) -> dict[str, NDArray[Any]]:
    tracks = np.array([instance.track for instance in result.instances], np.int64)
    velocities = np.array([instance.velocity for instance in result.instances]).reshape(-1, 2)
    return {"object_track": tracks, "object_velocity": velocities} if tracks.any() else {}


def _views(result: Segmentation) -> dict[str, NDArray[Any]]:
    if len(result.views) == 1:
        (seen,) = result.views
        own = {"view_names": np.array([seen.view.name], np.str_), "pixels": result.pixels}
        if not np.array_equal(seen.labels, _every_mask(result.instances)):
            own["mask_labels"] = seen.labels  # of one sweep among several
        if not np.array_equal(seen.in_view, result.in_view):
            own["mask_in_view"] = seen.in_view  # images of other sweeps see more
        return own | _given("", seen.view.camera, mask_arrays(seen.view.masks))
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


def _result(arrays: Arrays) -> Segmentation:
    views = _read_views(arrays)
    report = json.loads(str(arrays["report"]))
    return Segmentation(
        labels=arrays["labels"],
        diffused_labels=arrays["diffused_labels"],
        confidence=arrays["confidence"],
        in_view=arrays["in_view"],
        instances=_instances(arrays, views),
        views=views,
        report=Report(**report | {"empty_masks": tuple(report["empty_masks"])}),
        timings=dict(json.loads(str(arrays["timings"]))),
        points=as_points(arrays["points"]),
        # results from before a parameter was there knew the paper's method only
        params=replace(Params.paper(), **json.loads(str(arrays["params"]))),
    )


def _instances(arrays: Arrays, views: tuple[SeenView, ...]) -> tuple[Instance, ...]:
    _check_objects(arrays)
    names = arrays["object_name"].tolist()
    sources: list[list[tuple[int, int]]] = [[] for _ in names]
    for number, seen in enumerate(views):
        for mask, label in enumerate(seen.labels.tolist()):
            sources[label - 1].append((number, mask))
    parts = zip(arrays["object_category"].tolist(), names, arrays["object_score"].tolist(), sources, strict=True)
    instances = tuple(
        Instance(label=label, category=category, name=name, score=score, sources=tuple(own))
        for label, (category, name, score, own) in enumerate(parts, start=1)
    )
    if "object_track" not in arrays:
        return instances
    tracked = zip(instances, arrays["object_track"].tolist(), arrays["object_velocity"].tolist(), strict=True)
    return tuple(replace(instance, track=track, velocity=(x, y)) for instance, track, (x, y) in tracked)


def _read_views(arrays: Arrays) -> tuple[SeenView, ...]:
    names = arrays["view_names"].tolist()
    if len(names) != 1:
        return tuple(_read_view(arrays, f"view{i}_", each, arrays[f"view{i}_labels"]) for i, each in enumerate(names))
    labels = arrays["mask_labels"] if "mask_labels" in arrays else _every_mask(arrays["object_name"])
    in_view = arrays["mask_in_view" if "mask_in_view" in arrays else "in_view"]
    return (replace(_read_view(arrays, "", names[0], labels), in_view=in_view),)


def _every_mask(objects: Sized) -> NDArray[np.int32]:
    return np.arange(1, len(objects) + 1, dtype=np.int32)


def _read_view(arrays: Arrays, prefix: str, name: str, labels: NDArray[np.int32]) -> SeenView:
    start = prefix + MASKS
    masks = {key.removeprefix(start): arrays[key] for key in arrays if key.startswith(start)}
    return SeenView(
        view=View(masks_of(masks), _camera(json.loads(str(arrays[f"{prefix}camera"]))), name),
        in_view=arrays[f"{prefix}in_view"],
        pixels=arrays[f"{prefix}pixels"],
        labels=labels,
    )


def _camera(parts: dict[str, Any]) -> Camera:
    size = parts["image_size"]
    return Camera(
        projection=np.array(parts["projection"]),
        T_camera_lidar=np.array(parts["T_camera_lidar"]),
        distortion=Distortion(**parts["distortion"]),
        image_size=None if size is None else (int(size[0]), int(size[1])),
        min_depth_m=float(parts["min_depth_m"]),
    )


def _check_objects(arrays: Arrays) -> None:
    """Refuse arrays of objects that do not fit one another.

    Raises:
        InputError: They do not.
    """
    names = arrays["object_name"]
    if names.ndim != 1 or (len(names) and names.dtype.kind != "U"):
        raise InputError(f"object_name: expected (M,) text, got {names.shape} {names.dtype}")
    n, most = len(names), np.iinfo(np.int32).max
    _expect("object_category", arrays["object_category"], np.int32, (n,), 1, most)
    _expect("object_score", arrays["object_score"], np.float32, (n,), 0, 1)
    if "object_track" in arrays:
        _expect("object_track", arrays["object_track"], np.int64, (n,), 0, most)
        _expect("object_velocity", arrays["object_velocity"], np.float64, (n, 2), -np.inf, np.inf)


def _check(result: Segmentation) -> None:
    """Refuse arrays that do not fit one another.

    Raises:
        InputError: They do not.
    """
    n, most = len(result.points), len(result.instances)
    _expect("labels", result.labels, np.int32, (n,), -1, most)
    _expect("diffused_labels", result.diffused_labels, np.int32, (n,), -1, most)
    _expect("confidence", result.confidence, np.float32, (n,), 0, 1)
    _expect("in_view", result.in_view, np.int64, (len(result.in_view),), 0, n - 1)
    for seen in result.views:
        _expect("in_view of a view", seen.in_view, np.int64, (len(seen.in_view),), 0, n - 1)
        _expect("pixels", seen.pixels, np.float64, (len(seen.in_view), 2), -np.inf, np.inf)
        for axis, pixels, size in zip("uv", seen.pixels.T, seen.view.masks.image_size[::-1], strict=True):
            _expect(f"{axis} of pixels", pixels, np.float64, pixels.shape, -0.5, size - 0.5)
        _expect("labels of a view", seen.labels, np.int32, (len(seen.view.masks),), 1, most)


def _expect(name: str, array: NDArray[Any], kind: type, shape: tuple[int, ...], low: float, high: float) -> None:
    if array.dtype != kind or array.shape != shape:
        raise InputError(f"{name}: expected {shape} {np.dtype(kind)}, got {array.shape} {array.dtype}")
    if array.size and not (array.min() >= low and array.max() <= high):
        raise InputError(f"{name}: expected {low} to {high}, got {array.min()} to {array.max()}")


def _json(parts: Mapping[str, Any]) -> NDArray[np.str_]:
    return np.array(json.dumps(parts))


def _centroid(segmented: SegmentedObject) -> NDArray[np.float64]:
    return np.full(3, np.nan) if segmented.centroid is None else segmented.centroid


def _box(segmented: SegmentedObject) -> NDArray[np.float64]:
    if segmented.box is None:
        return np.full(7, np.nan)
    return np.concatenate([segmented.box.center, segmented.box.size, [segmented.box.yaw]])
