"""What is odd about points, cameras and masks that were labelled, and the warnings that say so."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ldls.camera import Camera
from ldls.camera.rigid import ALONG_Z, doubt_of_distance, inverse, is_leaning, transformed
from ldls.cloud import Points, doubt_of_scale, finite_rows
from ldls.errors import (
    DuplicateWarning,
    ImageSizeWarning,
    NothingInView,
    NoUsablePoints,
    PrecisionWarning,
    ScaleWarning,
    UprightWarning,
    some,
)
from ldls.segmentation import Segmentation
from ldls.stages import ground, on_ground
from ldls.view import SeenView, View, camera_names

COARSEST_STEP_M = 0.01
"""Step between single-precision coordinates from which on distances between neighbours suffer."""
EXPECTED_ON_MASKS = 20.0
"""Points that masks of this area would have on them by chance, from which on none at all is no chance."""
STEEPEST = 0.97
"""Share of z of the lidar along a camera's axis up to which a leaning wall in the image may pass for ground."""
RESIZED = 1.5
"""Times the middle of an image that a principal point is at, or the reverse, beyond which it is that of another."""
ALIKE = 1.25
"""Times the scale along one axis that the other may be where an image was resized."""
NOT_FINITE = "points: no row is finite; nothing is labelled; are they read as they were written?"
GROUND_SHARE = 0.2
"""Share of the points in view that the ground must have to tell where up is."""
ENOUGH_FOR_GROUND = 4000
"""Points that tell as much of the ground as more do."""


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
        coarse = doubt_of_precision("points", farthest)
        if coarse is not None and any(result.points.dtype == np.float32 for result in results):
            yield coarse, PrecisionWarning
        scale = doubt_of_scale(low, high)
        if scale is not None:
            yield scale, ScaleWarning
        if report["only_islands"]:
            message = "points: every point has more copies than neighbours, so labels cannot spread; remove duplicates"
            yield message, DuplicateWarning
        leaning = dict.fromkeys(
            name
            for each in results
            for name, seen in _named(each.views)
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
    yield from dict.fromkeys(doubt for each in results for doubt in _doubts_of_views(each))


def doubt_of_precision(name: str, farthest_m: float) -> str | None:
    """What is odd about single-precision coordinates up to so many metres; None where nothing is."""
    step_m = float(np.spacing(np.float32(farthest_m)))
    if not step_m > COARSEST_STEP_M:
        return None
    return f"{name}: float32 spacing at {farthest_m:.1e} is {step_m:.2g} m; pass float64 or subtract an origin"


def _named(views: Sequence[SeenView]) -> Iterator[tuple[str, SeenView]]:
    return zip(camera_names(views), views, strict=True)


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


def _doubts_of_views(result: Segmentation) -> Iterator[tuple[str, type[Warning]]]:
    """What is odd about the place of cameras, and the sizes of their images."""
    for name, seen in _named(result.views):
        size = _doubt_of_size(seen.view)
        if size is not None:
            yield f"{name}: {size}", ImageSizeWarning
        distance = doubt_of_distance(seen.view.camera.T_camera_lidar)
        if distance is not None and _is_outside(seen.view.camera, result.points):
            yield f"{name}: {distance}", ScaleWarning


def _is_outside(camera: Camera, points: Points) -> bool:
    """True for a camera outside of a cloud that its lidar is in."""
    known = points[finite_rows(points), :3]
    low, high = known.min(axis=0, initial=np.inf), known.max(axis=0, initial=-np.inf)
    # a lidar is outside of its cloud where that is of a map whose origin is elsewhere, or a part of one
    places = (np.zeros(3), inverse(camera.T_camera_lidar)[:3, 3])
    has_lidar, has_camera = (bool(((low <= place) & (place <= high)).all()) for place in places)
    return has_lidar and not has_camera


def _doubt_of_size(view: View) -> str | None:
    """Why masks are of an image of another size: by that, its middle would be where the principal point is."""
    if view.camera.image_size is not None:
        return None
    height, width = view.masks.image_size
    projection = view.camera.projection
    u, v = (projection[:2, 2] / projection[2, 2]).tolist()
    scales = (2 * u / width, 2 * v / height)
    if _are_near_one(scales):
        return None
    if 0 < max(scales) <= ALIKE * min(scales):
        mend = (
            "was it resized? Give masks of its size before, or multiply the first two rows of the camera's projection "
            "by the ratio."
        )
    elif _are_near_one((2 * u / height, 2 * v / width)):
        mend = "are rows and columns of the masks swapped?"
    else:
        return None
    return (
        f"masks: of an image of {height} x {width}, but the camera's principal point ({u:.1f}, {v:.1f}) is the middle "
        f"of about {2 * v:.0f} x {2 * u:.0f}; {mend} If the principal point is right, as of "
        f"an image that was cropped, give the camera image_size=({height}, {width})"
    )


def _are_near_one(scales: tuple[float, float]) -> bool:
    return min(scales) >= 1 / RESIZED and max(scales) <= RESIZED


def _is_own_frame(seen: SeenView) -> bool:
    """True for a cloud in the frame of the camera, where up is -y."""
    turn = seen.view.camera.T_camera_lidar
    return bool(turn[1, 1] > 0.5 and turn[2, 2] > ALONG_Z)


def _leans(seen: SeenView, result: Segmentation) -> bool:
    """True if z of the lidar points down or to the side in an image.

    Where the camera looks along it, the ground must tell: what a drone sees lies below z, and in other frames below
    what is up in the image.
    """
    z = seen.view.camera.T_camera_lidar[2, 2]
    if abs(z) < ALONG_Z:
        return is_leaning(seen.view.camera.T_camera_lidar)
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
    return float(on_ground(heights).mean()) if len(heights) else 0.0


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
