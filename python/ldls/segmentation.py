"""Segment a cloud, and hold what comes of it."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls import _ldls
from ldls.camera import Camera
from ldls.cloud import Points, as_points
from ldls.errors import (
    DuplicateWarning,
    InputError,
    MaskError,
    NonFiniteError,
    NoUsablePoints,
    ParameterError,
    PrecisionWarning,
    ScaleWarning,
)
from ldls.io import results
from ldls.masks import InstanceMasks
from ldls.objects import SegmentedObject, fit_upright_box
from ldls.params import Params
from ldls.report import Report

COARSEST_STEP_M = 0.01
"""Step between single-precision coordinates from which on distances between neighbours suffer."""
WIDEST_CLOUD_M = 10_000.0
"""Extent beyond which the unit is probably not the metre."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Segmentation:
    """Labels of the points of a cloud, in the order of its N points.

    Attributes:
        labels: (N,) int32: -1 out of view, 0 background, m instance m, which is `masks[m - 1]`.
        diffused_labels: (N,) int32: the same before outlier removal.
        confidence: (N,) float32 in [0, 1]: likelihood of the diffused label over the sum of all; 0 out of view.
        in_view: (n,) int64: indices of the points in view, ascending.
        pixels: (n, 2) float64: u (right) and v (down) of these points in pixels.
        report: What was noticed about the input and the run.
        timings: Seconds that each step took.
        points: (N, >= 3) the points given, x y z first, in metres.
        masks: The masks given.
        params: The parameters used.
    """

    labels: NDArray[np.int32]
    diffused_labels: NDArray[np.int32]
    confidence: NDArray[np.float32]
    in_view: NDArray[np.int64]
    pixels: NDArray[np.float64]
    report: Report
    timings: Mapping[str, float]
    points: Points
    masks: InstanceMasks
    params: Params

    @cached_property
    def categories(self) -> NDArray[np.int32]:
        """(N,) int32: category id of each point; 0 for background and out of view."""
        # label -1 picks the last entry
        by_label = np.concatenate([[0], self.masks.categories, [0]]).astype(np.int32)
        return by_label[self.labels]

    @cached_property
    def objects(self) -> tuple[SegmentedObject, ...]:
        """One record for each instance mask, in their order."""
        inside = self.in_view[np.argsort(self.labels[self.in_view], kind="stable")]
        labels = np.arange(1, len(self.masks) + 1)
        starts = np.searchsorted(self.labels[inside], labels, side="left")
        ends = np.searchsorted(self.labels[inside], labels, side="right")
        rows = (inside[start:end] for start, end in zip(starts, ends, strict=True))
        return tuple(self._object(m, members) for m, members in enumerate(rows, start=1))

    def _object(self, label: int, rows: NDArray[np.int64]) -> SegmentedObject:
        mask = self.masks[label - 1]
        xyz = self.points[rows, :3].astype(np.float64)
        return SegmentedObject(
            label=label,
            category=mask.category,
            name=mask.name,
            score=mask.score,
            n_points=len(rows),
            centroid=xyz.mean(axis=0) if len(rows) else None,
            box=fit_upright_box(xyz) if len(rows) else None,
        )

    def save(self, path: str | PathLike[str]) -> None:
        """Write the labels; the suffix chooses the format.

        `.npz` has all fields, `.label` is SemanticKITTI's, `.ply` a binary point cloud with label, instance,
        confidence and colour. The file appears only when it is whole.

        Raises:
            UnsupportedFormatError: No format has this suffix.
        """
        results.write(path, self)

    def __repr__(self) -> str:
        found = sum(o.n_points > 0 for o in self.objects)
        return (
            f"Segmentation({len(self.labels)} points, {len(self.in_view)} in view, "
            f"{found} of {len(self.masks)} objects found)"
        )


def segment(
    points: ArrayLike,
    masks: InstanceMasks,
    camera: Camera,
    *,
    params: Params | None = None,
    nonfinite: Literal["drop", "raise"] = "drop",
    keep_origin: bool = False,
) -> Segmentation:
    """Instance labels of lidar points by label diffusion (Wang et al., RA-L 2019).

    Args:
        points: (N, >= 3) float32 or float64, x y z first, in metres in the lidar frame. Never modified. Another
            thread must not write to it meanwhile.
        masks: Instance masks of the image.
        camera: The camera that took the image.
        params: Parameters of the method; the paper's by default.
        nonfinite: Points with NaN or infinite coordinates are left out and counted ("drop") or refused ("raise").
        keep_origin: Points at exactly (0, 0, 0) are missing returns to most sensors and left out; keep them if yours
            means them.

    Returns:
        Labels, confidences and objects, in the order of `points`. Equal bit for bit for any number of threads.

    Raises:
        InputError: `points`, `masks` or `camera` cannot be used; see its subclasses.
        LimitError: The cloud has more points than the graph can index.
    """
    return _segment(points, masks, camera, params or Params(), nonfinite, keep_origin)


class LabelDiffusion:
    """Segments the frames of a stream: what one camera and one lidar yield, frame after frame.

    Does what `segment` does, but keeps the memory that a frame needs for the next one: after the first frame of a size
    only the result is allocated. Several threads may call at a time; each then has memory of its own.

    Attributes:
        camera: The camera that takes the images.
        params: Parameters of the method.

    Example:
        >>> diffusion = ldls.LabelDiffusion(camera)  # doctest: +SKIP
        >>> for points, masks in stream:  # doctest: +SKIP
        ...     labels = diffusion.segment(points, masks).labels
    """

    def __init__(self, camera: Camera, params: Params | None = None) -> None:
        """Prepare for the images of `camera`; the parameters are the paper's by default.

        Raises:
            InputError: `camera` or `params` is of another type.
        """
        _check_camera(camera)
        if params is not None and not isinstance(params, Params):
            raise ParameterError(f"params: expected Params, got {type(params).__name__}")
        self.camera = camera
        self.params = params or Params()
        self._memory = _ldls.StreamMemory()

    def segment(
        self,
        points: ArrayLike,
        masks: InstanceMasks,
        *,
        nonfinite: Literal["drop", "raise"] = "drop",
        keep_origin: bool = False,
    ) -> Segmentation:
        """Segment the next frame; arguments, result and errors are those of `ldls.segment`."""
        return _segment(points, masks, self.camera, self.params, nonfinite, keep_origin, self._memory)

    def __repr__(self) -> str:
        return f"LabelDiffusion({self.camera!r}, {self.params!r})"


def _segment(
    points: ArrayLike,
    masks: InstanceMasks,
    camera: Camera,
    params: Params,
    nonfinite: str,
    keep_origin: bool,
    memory: _ldls.StreamMemory | None = None,
) -> Segmentation:
    cloud = as_points(points)
    _check_masks(masks, camera)
    _check_nonfinite(cloud, nonfinite)
    arrays = _ldls.segment(
        cloud,
        masks.core,
        camera.projection,
        camera.T_camera_lidar,
        camera.min_depth_m,
        params.as_tuple(),
        keep_origin,
        params.threads,
        memory,
    )
    _warn(cloud, arrays.report)
    return Segmentation(
        labels=arrays.labels,
        diffused_labels=arrays.diffused_labels,
        confidence=arrays.confidence,
        in_view=arrays.in_view,
        pixels=arrays.pixels,
        report=_report(arrays, masks),
        timings=arrays.timings,
        points=cloud,
        masks=masks,
        params=params,
    )


def _check_masks(masks: InstanceMasks, camera: Camera) -> None:
    if not isinstance(masks, InstanceMasks):
        raise InputError(
            f"masks: expected InstanceMasks, got {type(masks).__name__}; "
            "make them with InstanceMasks.from_array, from_coco or from_npz"
        )
    _check_camera(camera)
    expected = camera.image_size
    if expected is not None and masks.image_size != tuple(expected):
        hint = "; swapped?" if masks.image_size == tuple(expected)[::-1] else ""
        raise MaskError(f"masks: {masks.image_size}, the camera's image is {expected}{hint}")


def _check_camera(camera: Camera) -> None:
    if not isinstance(camera, Camera):
        raise InputError(
            f"camera: expected Camera, got {type(camera).__name__}; "
            "make one with Camera(projection=..., T_camera_lidar=...) or Camera.from_kitti"
        )


def _check_nonfinite(cloud: Points, nonfinite: str) -> None:
    if nonfinite == "drop":
        return
    if nonfinite != "raise":
        raise ParameterError(f"nonfinite: got {nonfinite!r}, expected 'drop' or 'raise'")
    finite: NDArray[np.bool_] = np.asarray(np.isfinite(cloud[:, :3]).all(axis=1))
    if not finite.all():
        raise NonFiniteError(
            f"points: {finite.sum()} of {len(finite)} rows are finite, row {finite.argmin()} is the first "
            "that is not; pass nonfinite='drop' to leave such rows out"
        )


def _warn(cloud: Points, report: Mapping[str, Any]) -> None:
    if len(cloud) and report["n_nonfinite"] == len(cloud):
        _warning(f"points: 0 of {len(cloud)} rows are finite; nothing is labelled", NoUsablePoints)
        return
    low, high = (np.array(bound) for bound in report["bounds"])
    farthest = float(np.abs([low, high]).max()) if len(cloud) else 0.0
    step = float(np.spacing(np.float32(farthest)))
    if cloud.dtype == np.float32 and step > COARSEST_STEP_M:
        message = f"points: float32 spacing at {farthest:.1e} is {step:.2g} m; pass float64 or subtract an origin"
        _warning(message, PrecisionWarning)
    extent = float((high - low).max()) if len(cloud) else 0.0
    if extent > WIDEST_CLOUD_M:
        _warning(f"points: extent is {extent:.3g} m, over 10 km; are they in metres?", ScaleWarning)
    if report["only_islands"]:
        message = "points: every point has more copies than neighbours, so labels cannot spread; remove duplicates"
        _warning(message, DuplicateWarning)


def _warning(message: str, category: type[Warning]) -> None:
    # the caller of segment, four calls up, is the one to be told
    warnings.warn(message, category, stacklevel=5)


def _report(arrays: _ldls.SegmentationArrays, masks: InstanceMasks) -> Report:
    counts = dict(arrays.report)
    del counts["bounds"], counts["only_islands"]
    empty = tuple(m for m, mask in enumerate(masks, start=1) if mask.area == 0)
    return Report(n_points=len(arrays.labels), n_in_view=len(arrays.in_view), empty_masks=empty, **counts)
