"""The image with masks, labelled points and names drawn on it: the picture people judge by."""

from collections.abc import Iterable, Sequence
from math import ceil

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageFilter

from ldls.palette import Colour, instance_colours
from ldls.viewing.tags import Tag, draw_tags

MIN_WIDTH_PX = 1800
BACKGROUND: Colour = (225, 225, 225)
HALO: Colour = (15, 15, 20)


def overlay(
    image: NDArray[np.uint8],
    masks: Iterable[tuple[int, int, NDArray[np.bool_]]],
    uv_px: NDArray[np.floating],
    labels: NDArray[np.int32],
    names: Sequence[str],
    categories: Sequence[int],
    *,
    scale: int | None = None,
) -> Image.Image:
    """Return `image` (H, W, 3), enlarged `scale` times, with its instances drawn on it.

    `masks` yields (top, left, crop) for instance 1, 2, ...; `names` has a tag for each
    and `categories` its category id. `uv_px`
    (n, 2) are points' pixel positions (centres at integers), `labels` (n,) their instances, 0 the
    background. By default the scale makes the picture at least 1800 pixels wide.
    """
    scale = scale or ceil(MIN_WIDTH_PX / image.shape[1])
    picture = _subdued(image, scale)
    pen_px = max(picture.width / 1240, 1)  # pictures of one width look alike
    covered = np.zeros(image.shape[:2], bool)
    colours: list[Colour] = [(int(r), int(g), int(b)) for r, g, b in instance_colours(categories)]
    tags = []
    for (top, left, crop), colour, name in zip(masks, colours, names, strict=True):
        bottom, right = top + crop.shape[0], left + crop.shape[1]
        _draw_mask(picture, crop, (left * scale, top * scale), colour, scale, pen_px)
        covered[top:bottom, left:right] |= crop
        tags.append(Tag(name, colour, (left * scale, top * scale, right * scale, bottom * scale)))
    _draw_points(picture, np.floor((uv_px + 0.5) * scale).astype(int), labels, colours, pen_px)
    draw_tags(picture, tags, covered, pen_px)
    return picture


def _subdued(image: NDArray[np.uint8], scale: int) -> Image.Image:
    """Return the image, enlarged, darker and nearly grey: colour belongs to the labels."""
    picture = Image.fromarray(image)
    nearly_grey = Image.blend(picture.convert("L").convert("RGB"), picture, 0.3)
    darker = Image.blend(nearly_grey, Image.new("RGB", picture.size), 0.22)
    return darker.resize((picture.width * scale, picture.height * scale), Image.Resampling.BICUBIC)


def _draw_mask(
    picture: Image.Image,
    crop: NDArray[np.bool_],
    corner_px: tuple[int, int],
    colour: Colour,
    scale: int,
    pen_px: float,
) -> None:
    margin = 3  # for the outline
    small = Image.fromarray(np.pad(crop, margin).astype(np.uint8) * 255)
    large = small.resize((small.width * scale, small.height * scale), Image.Resampling.BILINEAR)
    inside = np.asarray(large.filter(ImageFilter.GaussianBlur(scale))) / 255
    # A blurred edge rises by 1 / (sqrt(2 pi) radius) a pixel, which gives the way to it in pixels.
    to_edge_px = np.abs(inside - 0.5) * 2.5 * scale
    outline = (0.6 * pen_px + 0.5 - to_edge_px).clip(0, 1)
    at_px = (corner_px[0] - margin * scale, corner_px[1] - margin * scale)
    picture.paste(colour, at_px, _opacity(np.maximum(outline, 0.28 * (inside > 0.5))))


def _draw_points(
    picture: Image.Image,
    at_px: NDArray[np.int64],
    labels: NDArray[np.int32],
    colours: Sequence[Colour],
    pen_px: float,
) -> None:
    labelled = labels > 0
    own = [colours[m - 1] for m in labels[labelled]]
    grey = [BACKGROUND] * (len(labels) - len(own))
    _stamp(picture, at_px[~labelled], grey, _disc(0.45 * pen_px, 0.5))
    _stamp(picture, at_px[labelled], [HALO] * len(own), _disc(1.7 * pen_px, 0.55))
    _stamp(picture, at_px[labelled], own, _disc(1.1 * pen_px, 1.0))


def _disc(radius_px: float, opacity: float) -> Image.Image:
    """Return the smooth opacity of a disc in the middle of an odd square."""
    reach = ceil(radius_px + 0.5)
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    return _opacity((radius_px + 0.5 - np.hypot(x, y)).clip(0, 1) * opacity)


def _opacity(share: NDArray[np.floating]) -> Image.Image:
    return Image.fromarray((share * 255).round().astype(np.uint8))


def _stamp(picture: Image.Image, at_px: NDArray[np.int64], colours: Sequence[Colour], disc: Image.Image) -> None:
    corners = at_px - disc.width // 2
    for (x, y), colour in zip(corners.tolist(), colours, strict=True):
        picture.paste(colour, (x, y), disc)
