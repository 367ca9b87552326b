"""One point as a camera sees it: outcome, pixel, and the masks there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

import ldls.stages as stages
from ldls.camera import Camera
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
    """

    label: int
    mask: int | None
    pixels: int


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


def sights_of(result: Segmentation, point: int) -> tuple[Sight, ...]:
    """Return the point in row `point` of the cloud of `result` as each camera sees it."""
    names = camera_names(result.views)
    return tuple(_sight(result, seen, name, point) for name, seen in zip(names, result.views, strict=True))


def _sight(result: Segmentation, seen: SeenView, name: str, point: int) -> Sight:
    xyz = result.points[point, :3].astype(np.float64).tolist()
    at = int(np.searchsorted(seen.in_view, point))
    if at < len(seen.in_view) and seen.in_view[at] == point:
        return _in_view(result, seen, name, seen.pixels[at], seen.view.camera.core.project(*xyz)[2])
    outcome, depth_m, pixel = _out_of_view(result, seen.view.camera, xyz)
    size = seen.view.masks.image_size
    return Sight(camera=name, outcome=outcome, image_size=size, depth_m=depth_m, pixel=pixel)


def _in_view(result: Segmentation, seen: SeenView, name: str, uv_px: NDArray[np.float64], depth_m: float) -> Sight:
    masks = seen.view.masks
    # edges of weight 1 count pixels
    counts = stages.pixel_labels(uv_px[None], masks, window=result.params.window, pixel_weight=1.0)
    labels = [0, *seen.labels.tolist()]
    column, row = np.floor(uv_px + 0.5).astype(int).tolist()
    window = (
        WindowCount(label=labels[instance], mask=instance - 1 if instance else None, pixels=int(pixels))
        for instance, pixels in zip(counts.weights.indices.tolist(), counts.weights.data.tolist(), strict=True)
    )
    return Sight(
        camera=name,
        outcome="in view",
        image_size=masks.image_size,
        depth_m=depth_m,
        pixel=(float(uv_px[0]), float(uv_px[1])),
        nearest_pixel=(column, row),
        direct_label=labels[int(stages.direct_labels(uv_px[None], masks)[0])],
        window_pixels=int(counts.mass[0]),
        window=tuple(window),
    )


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
