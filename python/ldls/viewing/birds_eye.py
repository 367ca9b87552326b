"""The cloud from above: labelled points, oriented boxes, names, and rings of equal range."""

from __future__ import annotations

from math import ceil, floor

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFilter, ImageFont

from ldls.cloud import Points, finite_rows
from ldls.explaining import refused_labels
from ldls.palette import Colour
from ldls.segmentation import Segmentation
from ldls.viewing.drawing import INK, MARK, PAPER, Canvas, disc
from ldls.viewing.ground import Ground, ground_of
from ldls.viewing.shown import Shown, Stage
from ldls.viewing.tags import Box, Tag, draw_tags

RING_STEPS_M = (1, 2, 5, 10, 20, 50)
MOST_RINGS = 7
RINGS: Colour = (70, 70, 80)
RANGES: Colour = (170, 170, 180)
RIM_PX = 3
"""Paper left around the range of a ring."""
ASIDE_DEG = (0, -4, 4, -8, 8, -12, 12, -16, 16, -20, 20, -25, 25, -30, 30)
"""Bearings from straight ahead at which a range may stand."""
OUT_OF_VIEW: Colour = (66, 66, 76)
BACKGROUND: Colour = (135, 135, 140)
DIM = 0.6
"""Brightness of points on a mask that are outside its depth group."""
PEN_PX = 1.15
AVERSION = 40.0
"""Heights of a name that it goes aside rather than lie on an object."""
SMALL = 0.55
"""Radius of points of no object, in sizes of a point."""
FINE = 2
"""Scale at which a picture is drawn before it is reduced, so that slanting lines are smooth."""


def birds_eye_view(
    result: Segmentation, *, stage: Stage = "final", range_m: float | None = None, boxes: bool = True
) -> Image.Image:
    """The cloud from above, the first camera looking up: points, oriented boxes, names and rings of equal range.

    Without a camera, x is up. Points that no camera sees are dark, the background is grey. Points of the background
    that fall on a mask, but lie before or behind its object, are dim in its colour.

    Args:
        result: The segmentation.
        stage: Labels to show: "direct" projection, "diffused", or "final" after outlier removal.
        range_m: Farthest range shown, in metres; by default as far as the objects lie, but no farther than 120. Objects
            beyond it are left out.
        boxes: True to draw the boxes of the objects; they are those of the final labels.

    Raises:
        ParameterError: There is no such stage, or the range is not more than 0.
    """
    ground = ground_of(result, range_m)
    return birds_eye_of(Shown.of(result, stage), ground, surroundings(result, ground), boxes=boxes)


def surroundings(result: Segmentation, ground: Ground) -> Canvas:
    """What all pictures of a part of the ground show: rings of equal range, and above them points out of view."""
    width, height = ground.size_px
    fine = Image.new("RGBX", (FINE * width, FINE * height), PAPER)
    _draw_rings(ImageDraw.Draw(fine), ground, _ring_step_m(ground))
    canvas = Canvas(fine, radius_px=_rim_px(ground))
    rows = finite_rows(result.points)
    at_px = _fine_px(ground, result.points[rows[result.labels[rows] < 0]])
    canvas.stamp(at_px, OUT_OF_VIEW, disc(SMALL * _point_px(ground)))
    return canvas


def birds_eye_of(shown: Shown, ground: Ground, canvas: Canvas, *, boxes: bool) -> Image.Image:
    """The picture of a part of the ground, marked points with a white rim, drawn on a canvas with its surroundings."""
    _set_points(canvas, shown, ground)
    fine, step_m = canvas.picture(), _ring_step_m(ground)
    draw = ImageDraw.Draw(fine)
    tags = []
    for each in shown.result.objects if boxes else ():
        if each.box is not None:
            corners, colour = ground.at(each.box.corners()[:4, :2]), shown.colours[each.label - 1]
            around = [tuple(place) for place in (FINE * corners[[0, 3, 2, 1, 0]]).tolist()]
            draw.line(around, colour, 2 * FINE, joint="curve")
            # a name whose object is elsewhere would stand at the edge as if the object did
            if (corners.max(axis=0) >= 0).all() and (corners.min(axis=0) < ground.size_px).all():
                tags.append(Tag(shown.names[each.label - 1], colour, _around(corners)))
    picture = fine.reduce(FINE).convert("RGB")
    covered = _covered(picture, shown, ground)
    written = _write_ranges(picture, ground, step_m, covered)
    draw_tags(picture, tags, covered, PEN_PX, aversion=AVERSION, taken=written)
    return picture


def _ring_step_m(ground: Ground) -> int:
    farthest = max(ground.ahead_m, ground.right_m, -ground.left_m)
    return next((step for step in RING_STEPS_M if farthest / step <= MOST_RINGS), RING_STEPS_M[-1])


def _ranges(ground: Ground, step_m: int) -> range:
    edges = np.hypot(*np.meshgrid([ground.left_m, ground.right_m], [ground.behind_m, ground.ahead_m]))
    return range(step_m, floor(edges.max()) + 1, step_m)


def _draw_rings(draw: ImageDraw.ImageDraw, ground: Ground, step_m: int) -> None:
    (x, y), *_ = (FINE * ground.at(np.zeros((1, 2)))).tolist()
    for range_m in _ranges(ground, step_m):
        radius = FINE * range_m * ground.px_per_m
        draw.ellipse((x - radius, y - radius, x + radius, y + radius), outline=RINGS, width=FINE)
    arm = 8 * FINE
    draw.polygon([(x, y - 1.6 * arm), (x - arm, y + arm), (x, y + 0.4 * arm), (x + arm, y + arm)], fill=INK)


def _write_ranges(picture: Image.Image, ground: Ground, step_m: int, covered: NDArray[np.bool_]) -> list[Box]:
    """Write the ranges of rings in a line ahead of the lidar, or aside where fewer hide objects; the places taken."""
    draw = ImageDraw.Draw(picture)
    font = ImageFont.load_default(size=15)
    texts = [f"{range_m} m" for range_m in _ranges(ground, step_m)]
    lines = []
    for bearing in _bearings(ground.forward):
        places = ground.at(np.outer(_ranges(ground, step_m), bearing)).tolist()
        around = (draw.textbbox(place, text, font, anchor="mm") for place, text in zip(places, texts, strict=True))
        lines.append((places, [_box_around(each) for each in around]))
    inside = [i for i, (_, top, _, _) in enumerate(lines[0][1]) if top > 0]

    def n_hiding(boxes: list[Box]) -> int:
        """How many of them lie on an object, or beside the picture."""
        count = 0
        for left, top, right, bottom in (boxes[i] for i in inside):
            is_beside = left <= 0 or right >= picture.width
            count += is_beside or bool(covered[max(top, 0) : bottom, left:right].any())
        return count

    places, boxes = min(lines, key=lambda line: n_hiding(line[1]))
    for i in inside:
        draw.rectangle(boxes[i], PAPER)
        draw.text(places[i], texts[i], RANGES, font, anchor="mm")
    return [boxes[i] for i in inside]


def _bearings(forward: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 2) unit vectors: ahead, then more and more aside."""
    angles = np.radians(ASIDE_DEG)
    (x, y), cosines, sines = forward, np.cos(angles), np.sin(angles)
    return np.stack([x * cosines - y * sines, x * sines + y * cosines], axis=1)


def _box_around(text: tuple[float, float, float, float]) -> Box:
    left, top, right, bottom = text
    return int(left) - RIM_PX, int(top) - RIM_PX, ceil(right) + RIM_PX, ceil(bottom) + RIM_PX


def _set_points(canvas: Canvas, shown: Shown, ground: Ground) -> None:
    points = shown.result.points
    rows = finite_rows(points)
    rows = rows[shown.labels[rows] >= 0]
    # the lowest first: objects cover the ground that they stand on
    rows = rows[np.argsort(points[rows, 2], kind="stable")]
    at_px, point_px = _fine_px(ground, points[rows]), _point_px(ground)
    labels, marked = shown.labels[rows], shown.marked[rows]
    canvas.stamp(at_px[labels == 0], BACKGROUND, disc(SMALL * point_px))
    refused = refused_labels(shown.result)[rows]
    outside = (labels == 0) & (refused > 0)
    dim = (shown.colours_of(refused[outside]) * DIM).astype(np.uint8)
    canvas.stamp(at_px[outside], dim, disc(0.8 * point_px))
    own = labels > 0
    canvas.stamp(at_px[own & marked], MARK, disc(_rim_px(ground)))
    canvas.stamp(at_px[own], shown.colours_of(labels[own]), disc(1.2 * point_px))


def _fine_px(ground: Ground, points: Points) -> NDArray[np.int64]:
    """(n, 2) places of points on the canvas."""
    return np.floor(FINE * ground.at(points[:, :2].astype(np.float64))).astype(np.int64)


def _point_px(ground: Ground) -> float:
    """Size of a point on the canvas."""
    return FINE * float(np.clip(ground.px_per_m / 14, 0.7, 1.8))


def _rim_px(ground: Ground) -> float:
    """Radius of the rim of a marked point on the canvas, the largest mark."""
    return 1.2 * _point_px(ground) + 0.8 * FINE


def _covered(picture: Image.Image, shown: Shown, ground: Ground) -> NDArray[np.bool_]:
    """(H, W) True on and around the points of objects in the picture."""
    points = shown.result.points[shown.labels > 0, :2].astype(np.float64)
    at = np.floor(ground.at(points)).astype(int)
    covered = np.zeros((picture.height, picture.width), bool)
    x, y = at[((at >= 0) & (at < picture.size)).all(axis=1)].T
    covered[y, x] = True
    # any of 9 x 9 pixels leaves something in their mean
    return np.asarray(Image.fromarray(covered).convert("L").filter(ImageFilter.BoxBlur(4))) > 0


def _around(corners: NDArray[np.float64]) -> tuple[int, int, int, int]:
    left, top = np.floor(corners.min(axis=0)).astype(int).tolist()
    right, bottom = np.ceil(corners.max(axis=0)).astype(int).tolist()
    return left, top, right, bottom
