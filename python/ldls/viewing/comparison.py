"""Direct projection beside the method, with the points that changed marked."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ldls.segmentation import Segmentation
from ldls.view import camera_names
from ldls.viewing.birds_eye import birds_eye_of, surroundings
from ldls.viewing.drawing import grid, half
from ldls.viewing.ground import ground_of
from ldls.viewing.overlay import WIDTH_PX, overlays_of, usual_width_px
from ldls.viewing.shown import Images, Shown, images_of

WIDE = 2.0
"""Width over height from which on two images stand one above the other."""


def comparison(result: Segmentation, images: Images = None) -> Image.Image:
    """Direct projection and the full method: two overlays and two bird's-eye views, changed points marked.

    Direct projection gives each point the label of its nearest pixel. Points that it gives to an object and the method
    does not, or to another one, have a white rim in its pictures; those that the method adds, in the method's.

    Args:
        result: The segmentation.
        images: As for `overlay`.

    Raises:
        InputError: As for `overlay`.
    """
    changed = result.direct_labels != result.labels
    pair = [Shown.of(result, "direct", changed), Shown.of(result, "final", changed)]
    ground = ground_of(result, size_px=(half(WIDTH_PX), half(WIDTH_PX)), fill=True)
    around = surroundings(result, ground)
    above = [birds_eye_of(shown, ground, around.copy(), boxes=shown is pair[1]) for shown in pair]
    counts, methods = captions(result), ("direct projection", "ldls")
    over, below = counts, ["direct projection from above", "ldls from above, with boxes"]
    if len(result.views) > 1:
        # the counts are of the points of all cameras
        over, below = [f"{name}: {method}" for name in camera_names(result.views) for method in methods], counts
    return grid([_overlays(pair, images_of(result, images), over), grid(above, below, columns=2)], columns=1)


def _overlays(pair: Sequence[Shown], images: Sequence[NDArray[np.uint8]], captions: Sequence[str]) -> Image.Image:
    """Both overlays of every camera: one above the other if there is only one wide image, else side by side."""
    views = pair[0].result.views
    height, width = views[0].view.masks.image_size
    stacked = len(views) == 1 and width > WIDE * height
    each_px = WIDTH_PX if stacked else half(WIDTH_PX)
    of_cameras = zip(views, images, strict=True)
    tiles = [
        tile
        for seen, image in of_cameras
        for tile in overlays_of(pair, seen, image, min(each_px, usual_width_px(*image.shape[:2])))
    ]
    return grid(tiles, captions, columns=1 if stacked else 2)


def captions(result: Segmentation) -> list[str]:
    """Captions of the two pictures: points on objects, and how many of them are marked and why."""
    before, after = result.direct_labels, result.labels
    lost = int(((before > 0) & (after == 0)).sum())
    won = int(((before == 0) & (after > 0)).sum())
    moved = int(((before > 0) & (after > 0) & (before != after)).sum())
    return [
        f"direct projection: {_points(before)}; white rim: {lost:,} on no object in the end, {moved:,} on another",
        f"ldls: {_points(after)}; white rim: {won:,} added, {moved:,} from another object",
    ]


def _points(labels: NDArray[np.int32]) -> str:
    return f"{int((labels > 0).sum()):,} points on objects"
