"""Segment a cloud."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

import ldls._ldls as _ldls
from ldls.camera import Camera
from ldls.camera.rigid import transformed
from ldls.checks import checked
from ldls.cloud import Points, as_points, doubt_of_scale, finite_rows
from ldls.errors import (
    DuplicateWarning,
    InputError,
    NonFiniteError,
    NothingInView,
    NoUsablePoints,
    ParameterError,
    PrecisionWarning,
    ScaleWarning,
    UprightWarning,
    some,
)
from ldls.masks import InstanceMasks
from ldls.params import Params
from ldls.segmentation import Instance, Report, Segmentation
from ldls.stages import GROUND_M, ground
from ldls.view import SeenView, View, camera_names, check_names, common_categories

COARSEST_STEP_M = 0.01
"""Step between single-precision coordinates from which on distances between neighbours suffer."""
EXPECTED_ON_MASKS = 20.0
"""Points that masks of this area would have on them by chance, from which on none at all is no chance."""
ALONG_Z = 0.7
"""Share of z of the lidar along a camera's axis from which on it has no direction in the image."""
STEEPEST = 0.97
"""The same up to which a camera may look up, where a leaning wall in the image passes for ground."""
NOT_FINITE = "points: no row is finite; nothing is labelled; are they read as they were written?"
GROUND_SHARE = 0.2
"""Share of the points in view that the ground must have to tell where up is."""
ENOUGH_FOR_GROUND = 4000
"""Points that tell as much of the ground as more do."""
SAME_OBJECT = 0.5
"""Share of common points from which on instances of two images are one object."""


@checked
def segment(
    points: ArrayLike,
    masks: InstanceMasks | Sequence[View],
    camera: Camera | None = None,
    *,
    params: Params | None = None,
    nonfinite: Literal["drop", "raise"] = "drop",
    keep_origin: bool = False,
    same_object: float = SAME_OBJECT,
) -> Segmentation:
    """Instance labels of lidar points by label diffusion (Wang et al., RA-L 2019).

    With several cameras, `segment(points, [View(masks, camera), ...])`, there is one graph over all points that any
    of them sees; where images overlap, the pixels of both take part.

    Args:
        points: (N, >= 3) float32 or float64, x y z first, in metres in the lidar frame. Never modified. Another
            thread must not write to it meanwhile. The result has the array itself: give a copy where a buffer is used
            again while the result is.
        masks: Instance masks of the image; or one `View` for each of several cameras.
        camera: The camera that took the image; None beside views, which have their own.
        params: Parameters of the method; the best known by default.
        nonfinite: Points with NaN or infinite coordinates are left out and counted ("drop") or refused ("raise").
        keep_origin: Points at exactly (0, 0, 0) are missing returns to most sensors and left out; keep them if yours
            means them.
        same_object: Two instances of one category in two images become one label if, of the points that both
            cameras see and that fall on either mask, at least this share falls on both; 0 to 1. Where views have
            different names, a category goes by its name, and instances have the id that the first view gave it.

    Returns:
        Labels, confidences and objects, in the order of `points`. Equal bit for bit for any number of threads.

    Raises:
        InputError: `points`, `masks` or `camera` cannot be used; see its subclasses.
        LimitError: The cloud has more points than the graph can index.
    """
    return segment_views(points, _views(masks, camera), params or Params(), nonfinite, keep_origin, same_object)


def _views(masks: InstanceMasks | Sequence[View], camera: Camera | None) -> tuple[View, ...]:
    if not isinstance(masks, InstanceMasks):
        if camera is not None:
            raise InputError("camera: expected None beside views, which have cameras of their own")
        for view in masks:
            if not isinstance(view, View):
                raise InputError(f"masks: expected InstanceMasks or a list of View, got {type(view).__name__} in it")
        return tuple(view for view in masks if isinstance(view, View))
    # a View refuses what is no camera
    return (View(masks, camera),)  # type: ignore[arg-type]


def segment_views(
    points: ArrayLike,
    views: tuple[View, ...],
    params: Params,
    nonfinite: str,
    keep_origin: bool,
    same_object: float,
) -> Segmentation:
    """What `segment` does with its arguments as views; warnings name the line that called its caller."""
    check_names(views)
    cloud = as_points(points)
    if nonfinite == "raise":
        check_finite(cloud)
    arrays = diffuse_labels(cloud, views, None, params, keep_origin=keep_origin, same_object=same_object)
    result = result_of(arrays, views, cloud, params)
    # names the line that calls the caller, which is checked
    warn_of([result], arrays.report, stacklevel=5)
    return result


def diffuse_labels(
    cloud: Points,
    views: Sequence[View],
    rows: list[tuple[int, int]] | None,
    params: Params,
    *,
    keep_origin: bool,
    same_object: float,
) -> _ldls.SegmentationArrays:
    """Call the core; `rows` has the first row and the one after the last that each view labels, None where all."""
    if not 0 < same_object <= 1:
        raise ParameterError(f"same_object: got {same_object!r}, expected more than 0 and at most 1")
    return _ldls.segment(
        cloud,
        [view.masks.core for view in views],
        common_categories(views)[0],
        [view.masks.scores.tolist() for view in views],
        [view.camera.core for view in views],
        rows,
        same_object,
        params,
        keep_origin,
    )


def result_of(
    arrays: _ldls.SegmentationArrays,
    views: Sequence[View],
    points: Points,
    params: Params,
    *,
    rows: tuple[int, int] | None = None,
    own: range | None = None,
) -> Segmentation:
    """Return what the core says of `points`, which are some `rows` of its cloud, and of the `own` views among all."""
    start, end = rows or (0, len(points))
    own = range(len(views)) if own is None else own
    numbered = enumerate(arrays.objects, start=1)
    categories, names = common_categories(views)
    scores = [view.masks.scores.tolist() for view in views]
    instances = tuple(_instance(label, parts, categories, names, scores, own) for label, parts in numbered)
    sightings = [arrays.sightings[number] for number in own]
    in_view = arrays.in_view
    if rows is not None:
        sightings = [(seen - start, pixels) for seen, pixels in sightings]
        in_view = in_view[slice(*np.searchsorted(in_view, rows))] - start
    seen = _seen([views[number] for number in own], sightings, instances)
    return Segmentation(
        labels=arrays.labels[start:end],
        diffused_labels=arrays.diffused_labels[start:end],
        confidence=arrays.confidence[start:end],
        in_view=in_view,
        instances=instances,
        views=seen,
        report=_report(arrays, len(points), len(in_view), seen, instances),
        timings=arrays.timings,
        points=points,
        params=params,
    )


def nothing_in_view(result: Segmentation) -> str | None:
    """Why nothing of a cloud is labelled, if no point is finite, in view, or on a mask; None otherwise.

    The text has no numbers, so that those of many frames are few.
    """
    n_in_view = result.report.n_in_view
    if (result.labels > 0).any():
        return None
    # of sweeps that were labelled together the report counts the points of all
    if result.report.n_nonfinite and len(result.points) and not len(finite_rows(result.points)):
        return NOT_FINITE
    if not result.views:
        return None
    usable, behind = _usable_and_behind(result)
    if usable == 0:
        return None
    if n_in_view == 0 and behind == usable:
        found, cause = "every point lies behind the camera", "is T_camera_lidar that of this lidar, or its inverse"
    elif n_in_view == 0:
        found, cause = "no point falls inside the image", "are calibration and image size those of this camera"
    elif _expected_on_masks(result.views) > EXPECTED_ON_MASKS and not (result.direct_labels > 0).any():
        found, cause = "no point in view falls on a mask", "are the masks those of this frame"
    else:
        return None
    return f"points: {found}; nothing is labelled; {cause}, and are x, y, z in order and in metres?"


def _usable_and_behind(result: Segmentation) -> tuple[int, int]:
    """How many points of a cloud are not left out, and how many of these lie behind all of its cameras."""
    report = result.report
    if report.n_sweeps == 1:
        return report.n_points - report.n_nonfinite - report.n_origin, report.n_behind
    # the report has those of all sweeps together
    finite = np.isfinite(result.points[:, :3]).all(axis=1)
    # without any at the origin they may have been kept
    missing = ~result.points[:, :3].any(axis=1) & (report.n_origin > 0)
    usable = result.points[finite & ~missing]
    cameras = [seen.view.camera for seen in result.views]
    behind = [transformed(usable, each.T_camera_lidar)[:, 2] <= each.min_depth_m for each in cameras]
    return len(usable), int(np.all(behind, axis=0).sum())


def _expected_on_masks(views: Sequence[SeenView]) -> float:
    """Points that would fall on the masks if those in view were spread evenly over the images."""
    areas = [(seen, sum(seen.view.masks.core.areas())) for seen in views]
    return sum(len(seen.in_view) * area / (seen.view.masks.height * seen.view.masks.width) for seen, area in areas)


def _instance(
    label: int,
    parts: Sequence[tuple[int, int]],
    categories: Sequence[Sequence[int]],
    names: Mapping[int, str],
    scores: Sequence[Sequence[float]],
    own: range,
) -> Instance:
    """Return the instance that the core's parts, numbers of a view and of a mask from 1, are one object of."""
    # of several moments they may be of several categories; that counts which the segmenter is the surest of
    sums: dict[int, float] = {}
    for number, mask in parts:
        category = categories[number][mask - 1]
        sums[category] = sums.get(category, 0.0) + scores[number][mask - 1]
    category = max(sums, key=sums.__getitem__)
    return Instance(
        label=label,
        category=category,
        name=names[category],
        score=max(scores[number][mask - 1] for number, mask in parts),
        sources=tuple((number - own.start, mask - 1) for number, mask in parts if number in own),
    )


def _seen(
    views: Sequence[View],
    sightings: Sequence[tuple[NDArray[np.int64], NDArray[np.float64]]],
    instances: tuple[Instance, ...],
) -> tuple[SeenView, ...]:
    labels = [np.zeros(len(view.masks), np.int32) for view in views]
    for instance in instances:
        for number, mask in instance.sources:
            labels[number][mask] = instance.label
    return tuple(
        SeenView(view=view, in_view=rows, pixels=pixels, labels=own)
        for view, (rows, pixels), own in zip(views, sightings, labels, strict=True)
    )


def check_finite(cloud: Points) -> None:
    """Refuse points that are not finite.

    Raises:
        NonFiniteError: There are some.
    """
    finite: NDArray[np.bool_] = np.asarray(np.isfinite(cloud[:, :3]).all(axis=1))
    if not finite.all():
        raise NonFiniteError(
            f"points: {finite.sum()} of {len(finite)} rows are finite, row {finite.argmin()} is the first "
            "that is not; pass nonfinite='drop' to leave such rows out"
        )


def warn_of(results: Sequence[Segmentation], report: Mapping[str, Any], *, stacklevel: int) -> None:
    """Warn of what is odd about points, cameras and masks of some sweeps that were labelled together.

    Args:
        results: Those of the sweeps to warn of.
        report: What the core says of all of them.
        stacklevel: Of `warnings.warn`, from here.
    """
    for message, category in (*_oddities(results, report), *_doubts(results)):
        warnings.warn(message, category, stacklevel=stacklevel)


def _oddities(results: Sequence[Segmentation], report: Mapping[str, Any]) -> Iterator[tuple[str, type[Warning]]]:
    low, high = report["bounds"]
    if low[0] <= high[0]:  # there is a finite point
        farthest = max(abs(bound) for bound in (*low, *high))
        step = float(np.spacing(np.float32(farthest)))
        if any(result.points.dtype == np.float32 for result in results) and step > COARSEST_STEP_M:
            message = f"points: float32 spacing at {farthest:.1e} is {step:.2g} m; pass float64 or subtract an origin"
            yield message, PrecisionWarning
        scale = doubt_of_scale(low, high)
        if scale is not None:
            yield scale, ScaleWarning
        if report["only_islands"]:
            message = "points: every point has more copies than neighbours, so labels cannot spread; remove duplicates"
            yield message, DuplicateWarning
        leaning = dict.fromkeys(
            name
            for each in results
            for name, seen in zip(camera_names(each.views), each.views, strict=True)
            # the ground is fitted around the first camera
            if not _is_own_frame(each.views[0]) and _leans(seen, each)
        )
        if leaning:
            message = (
                f"T_camera_lidar of {', '.join(leaning)}: z of the lidar does not point up in the image; is it the "
                "inverse, or is the turn to the optical frame missing (x right, y down, z forward)? If another axis of "
                "the lidar points up, turn points and T_camera_lidar until z does"
            )
            yield message, UprightWarning


def _doubts(results: Sequence[Segmentation]) -> Iterator[tuple[str, type[Warning]]]:
    """Why nothing is labelled, once for all sweeps with the same cause."""
    doubts: dict[str, list[str]] = {}
    for number, result in enumerate(results):
        doubt = nothing_in_view(result)
        if doubt is not None:
            doubts.setdefault(doubt, []).append(f"sweep {number}")
    for doubt, sweeps in doubts.items():
        place = f"{some(sweeps)}: " if len(results) > 1 else ""
        yield f"{place}{doubt}", NoUsablePoints if doubt == NOT_FINITE else NothingInView


def _is_own_frame(seen: SeenView) -> bool:
    """True for a cloud in the frame of the camera, where up is -y."""
    turn = seen.view.camera.T_camera_lidar
    return bool(turn[1, 1] > 0.5 and turn[2, 2] > ALONG_Z)


def _leans(seen: SeenView, result: Segmentation) -> bool:
    """True if z of the lidar points down or to the side in an image, by over 60 degrees.

    Where the camera looks along it, the ground must tell: what a drone sees lies below z, and in other frames below
    what is up in the image.
    """
    x, y, z = seen.view.camera.T_camera_lidar[:3, 2]
    if abs(z) < ALONG_Z:
        return bool(-y < 0.5 * np.hypot(x, y))
    if ALONG_Z <= z < STEEPEST or _is_own_frame(seen):
        return False
    rows = seen.in_view[:: max(1, len(seen.in_view) // ENOUGH_FOR_GROUND)]
    points, camera, threads = result.points[rows, :3], seen.view.camera, result.params.threads
    of_lidar = _share_of_ground(points, camera, threads)
    own_frame = transformed(points, camera.T_camera_lidar)
    of_image = _share_of_ground(own_frame, Camera(projection=np.eye(3)), threads)
    return of_image > max(GROUND_SHARE, 2 * of_lidar)


def _share_of_ground(points: Points, camera: Camera, threads: int | None) -> float:
    heights = ground(points, camera, threads=threads)
    low, high = GROUND_M
    return float(np.mean((heights > low) & (heights < high))) if len(heights) else 0.0


def _report(
    arrays: _ldls.SegmentationArrays,
    n_points: int,
    n_in_view: int,
    views: Sequence[SeenView],
    instances: tuple[Instance, ...],
) -> Report:
    counts = dict(arrays.report)
    del counts["bounds"], counts["only_islands"]
    areas = [seen.view.masks.core.areas() for seen in views]
    shown = (instance for instance in instances if instance.sources)
    empty = tuple(i.label for i in shown if not any(areas[number][mask] for number, mask in i.sources))
    return Report(n_points=n_points, n_in_view=n_in_view, empty_masks=empty, **counts)
