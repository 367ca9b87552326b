"""One point as a camera sees it: outcome, pixel, and the masks there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

import ldls.stages as stages
from ldls.camera import Camera
from ldls.explaining.rebuilt import Rebuilt, depth_groups_of
from ldls.segmentation import Segmentation
from ldls.view import SeenView, camera_names

Outcome = Literal["in view", "behind", "outside", "beyond the lens", "not finite", "origin"]


@dataclass(frozen=True, kw_only=True)
class WindowCount:
    """Pixels of a point's window that one mask covers.

    Attributes:
        label: Label of the mask in the result; 0 for the pixels that no mask covers.
        mask: Number of the mask in its view, from 0; None for the background.
        pixels: How many; a pixel under two masks counts for both.
        counts: True if they label the point: those of a mask if it is as far away as its object, those of the
            background unless it stands beside a mask.
        behind_m: How far behind the object of the mask the point is, in metres, negative before it, 0 as far away, NaN
            without an object; None for the background, and where the parameters ask for no depth groups.
    """

    label: int
    mask: int | None
    pixels: int
    counts: bool
    behind_m: float | None


@dataclass(frozen=True, kw_only=True)
class Sight:
    """A point as one camera sees it.

    Attributes:
        camera: Name of the view, or "camera 0" and so on.
        outcome: "in view"; "behind" the camera or nearer than its smallest depth; "outside" the image; "beyond the
            lens", where a distorted lens folds back; "not finite" or at the "origin", where no camera is asked.
        image_size: (height, width) of the image in pixels.
        depth_m: Depth in the camera frame in metres; None where the point is not finite.
        pixel: u (right) and v (down) in pixels; None behind the camera and beyond the lens.
        nearest_pixel: Column and row of the pixel nearest to it; None out of view.
        direct_label: Label of that pixel, of several masks the first: direct projection. None out of view.
        window_pixels: Pixels of the window that lie in the image; 0 out of view.
        window: What covers them, background first; empty out of view.
        beside: Labels of the masks beside whose edge it stands, as far away as their objects: background pixels do not
            count for it.
    """

    camera: str
    outcome: Outcome
    image_size: tuple[int, int]
    depth_m: float | None
    pixel: tuple[float, float] | None
    nearest_pixel: tuple[int, int] | None = None
    direct_label: int | None = None
    window_pixels: int = 0
    window: tuple[WindowCount, ...] = ()
    beside: tuple[int, ...] = ()


def sights_of(result: Segmentation, point: int, system: Rebuilt | None) -> tuple[Sight, ...]:
    """The point in row `point` of the cloud of `result` as each camera sees it; in view, by its graph built again."""
    names = camera_names(result.views)
    return tuple(_sight(result, number, name, point, system) for number, name in enumerate(names))


def _sight(result: Segmentation, number: int, name: str, point: int, system: Rebuilt | None) -> Sight:
    seen = result.views[number]
    xyz = result.points[point, :3].astype(np.float64).tolist()
    at = int(np.searchsorted(seen.in_view, point))
    if system is None or at == len(seen.in_view) or seen.in_view[at] != point:
        outcome, depth_m, pixel = _out_of_view(result, seen.view.camera, xyz)
        size = seen.view.masks.image_size
        return Sight(camera=name, outcome=outcome, image_size=size, depth_m=depth_m, pixel=pixel)
    uv_px, masks, depths = seen.pixels[at], seen.view.masks, system.depths[number]
    column, row = np.floor(uv_px + 0.5).astype(int).tolist()
    window_pixels, window = _window(result, seen, depths, at)
    return Sight(
        camera=name,
        outcome="in view",
        image_size=masks.image_size,
        depth_m=seen.view.camera.core.project(*xyz)[2],
        pixel=(float(uv_px[0]), float(uv_px[1])),
        nearest_pixel=(column, row),
        direct_label=[0, *seen.labels.tolist()][int(stages.direct_labels(uv_px[None], masks)[0])],
        window_pixels=window_pixels,
        window=window,
        beside=() if depths is None else tuple(_beside(result, seen, depths, system.heights, at)),
    )


def _window(
    result: Segmentation, seen: SeenView, depths: stages.DepthGroups | None, at: int
) -> tuple[int, tuple[WindowCount, ...]]:
    """Pixels of the window of the point at slot `at` of a view that lie in the image, and what covers them."""
    uv_px, masks = seen.pixels[at : at + 1], seen.view.masks
    # edges of weight 1 count pixels
    every = stages.pixel_labels(uv_px, masks, window=result.params.window, pixel_weight=1.0)
    own = None if depths is None else depths.of_points([at])
    counting = stages.pixel_labels(uv_px, masks, window=result.params.window, pixel_weight=1.0, depths=own)
    counted = counting.weights.indices.tolist()
    labels = [0, *seen.labels.tolist()]
    window = (
        WindowCount(
            label=labels[instance],
            mask=instance - 1 if instance else None,
            pixels=int(pixels),
            counts=instance in counted,
            behind_m=float(own.behind_m(instance - 1)[0]) if own is not None and instance else None,
        )
        for instance, pixels in zip(every.weights.indices.tolist(), every.weights.data.tolist(), strict=True)
    )
    return int(every.mass[0]), tuple(window)


def _beside(
    result: Segmentation, seen: SeenView, depths: stages.DepthGroups, heights: NDArray[np.float64] | None, at: int
) -> Iterator[int]:
    """Labels of the masks that make the point at slot `at` of a view unsure."""
    for mask, label in enumerate(seen.labels.tolist() if depths.unsure[at] else ()):
        if depths.behind_m(mask)[at] == 0:
            alone = depth_groups_of(result, seen, heights, seen.view.masks.select([mask]))
            if alone is not None and alone.unsure[at]:
                yield label


def _out_of_view(
    result: Segmentation, camera: Camera, xyz: list[float]
) -> tuple[Outcome, float | None, tuple[float, float] | None]:
    if not np.isfinite(xyz).all():
        return "not finite", None, None
    u, v, depth_m = camera.core.project(*xyz)
    if not any(xyz) and result.report.n_origin:
        return "origin", depth_m, None
    if not depth_m > camera.min_depth_m:
        return "behind", depth_m, None
    return ("outside", depth_m, (u, v)) if np.isfinite(u) else ("beyond the lens", depth_m, None)
