"""Segment a cloud."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

import ldls._ldls as _ldls
from ldls.camera import Camera
from ldls.checks import checked
from ldls.cloud import Points, as_points, is_finite
from ldls.doubts import warn_of
from ldls.errors import InputError, NonFiniteError, ParameterError
from ldls.masks import InstanceMasks
from ldls.params import Params
from ldls.segmentation import Instance, Report, Segmentation
from ldls.view import SeenView, View, check_names, common_categories

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
            cameras see and that fall on either mask, at least this share falls on both; above 0, at most 1. Where views
            have different names, a category goes by its name, and instances have the id that the first view gave it.

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
        return tuple(masks)
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
    finite = is_finite(cloud)
    if not finite.all():
        raise NonFiniteError(
            f"points: {finite.sum()} of {len(finite)} rows are finite, row {finite.argmin()} is the first "
            "that is not; pass nonfinite='drop' to leave such rows out"
        )


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
