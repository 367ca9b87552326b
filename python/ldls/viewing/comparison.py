"""Direct projection beside the method, with the points that changed marked."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ldls.segmentation import Segmentation
from ldls.viewing.birds_eye import ground_of, shown_birds_eye_view
from ldls.viewing.grid import GAP_PX, grid
from ldls.viewing.overlay import shown_overlay
from ldls.viewing.shown import Images, images_of, shown

WIDTH_PX = 1800
WIDE = 2.0
"""Width over height from which on two images stand one above the other."""


def comparison(result: Segmentation, images: Images = None) -> Image.Image:
    """Direct projection and the full method: two overlays and two bird's-eye views, changed points marked.

    Direct projection gives each point the label of its nearest pixel. Points that it gives to an object and the method
    does not, or to another one, have a white rim in its pictures; those that the method adds, in the method's.

    Args:
        result: What to show.
        images: As for `overlay`.

    Raises:
        InputError: There are more or fewer images than cameras, or one has not the size of the masks.
    """
    changed = result.direct_labels != result.labels
    pair = [shown(result, "direct", changed), shown(result, "final", changed)]
    pixels = images_of(result, images)
    height, width = result.views[0].view.masks.image_size
    stacked = len(pixels) > 1 or width > WIDE * height
    each = None if len(pixels) > 1 else WIDTH_PX if stacked else (WIDTH_PX - GAP_PX) // 2
    overlays = grid([shown_overlay(one, pixels, each) for one in pair], captions(result), columns=1 if stacked else 2)
    half = (overlays.width - GAP_PX) // 2
    ground = ground_of(result, size_px=(half, half), fill=True)
    views = [shown_birds_eye_view(one, ground, boxes=one is pair[1]) for one in pair]
    above = grid(views, ["direct projection from above", "ldls from above, with boxes"], columns=2)
    return grid([overlays, above], columns=1)


def captions(result: Segmentation) -> list[str]:
    """What is above either picture: points on objects, and how many of them are marked and why."""
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
