"""The image with masks, labelled points and names drawn on it: the picture people judge by."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageFilter

from ldls.errors import InputError, ParameterError
from ldls.masks import InstanceMasks
from ldls.palette import Colour, as_tuples, instance_colours
from ldls.segmentation import Segmentation
from ldls.view import SeenView, camera_names
from ldls.viewing.drawing import MARK, Canvas, disc, grid, half, places_in_grid
from ldls.viewing.shown import AnImage, Images, Shown, Stage, image_like, images_of, numbered
from ldls.viewing.tags import Tag, draw_tags

WIDTH_PX, MOST_HEIGHT_PX = 1800, 3600
"""Width of a picture, which is less where it would be higher than this."""
BACKGROUND: Colour = (225, 225, 225)
HALO: Colour = (15, 15, 20)


def overlay(
    result: Segmentation,
    images: Images = None,
    *,
    stage: Stage = "final",
    width_px: int | None = None,
) -> Image.Image:
    """The camera image with masks, points in the colour of their instance, and the names of those that have points.

    An object that an image overlooks is named at its points.

    Args:
        result: The segmentation.
        images: (H, W, 3) uint8 RGB image, or one of Pillow's; for several cameras a list of one for each, None where
            there is none. Without an image masks and points stand on a dark one.
        stage: Labels to show: "direct" projection, "diffused", or "final" after outlier removal.
        width_px: Width of the picture of each image; by default 1800 pixels, or half of it where there are several,
            which then stand two by two; less where one would be higher than 3600.

    Raises:
        InputError: There is no camera, there are more or fewer images than cameras, or one has not the size of the
            masks.
        ParameterError: There is no such stage, or the width is below 1.
    """
    if width_px is not None and width_px < 1:
        raise ParameterError(f"width_px: got {width_px}, expected 1 or more")
    shown, each = Shown.of(result, stage), images_of(result, images)
    if len(each) == 1:
        return overlays_of([shown], result.views[0], each[0], width_px or usual_width_px(*each[0].shape[:2]))[0]
    pairs = zip(result.views, each, strict=True)
    each_px = width_px or min(half(WIDTH_PX), *(usual_width_px(*image.shape[:2]) for image in each))
    tiles = [overlays_of([shown], seen, image, each_px)[0] for seen, image in pairs]
    return grid(tiles, camera_names(result.views), columns=2)


def pixel_of(result: Segmentation, size_px: tuple[int, int], at_px: tuple[float, float]) -> tuple[int, float, float]:
    """Number of the view, u and v in pixels of its image, that lie at a place of a picture of `overlay`.

    Args:
        result: The result that the picture shows.
        size_px: Height and width of the picture.
        at_px: x (right) and y (down) in pixels of the picture.

    Raises:
        InputError: No overlay of this result has this size, or the place lies between its images.
    """
    sizes = [seen.view.masks.image_size for seen in result.views]
    several = len(sizes) > 1
    width_px = half(size_px[1]) if several else size_px[1]
    scales = [width_px / width for _, width in sizes]
    tiles = [_scaled((width, height), scale) for (height, width), scale in zip(sizes, scales, strict=True)]
    corners, whole = places_in_grid(tiles, captions=several, columns=2 if several else 1)
    if whole != (size_px[1], size_px[0]):
        size = f"{size_px[0]} x {size_px[1]} pixels (height x width)"
        raise InputError(f"a picture of {size} is no overlay of this result, which is of {whole[1]} x {whole[0]}")
    for number, ((left, top), (width, height), scale) in enumerate(zip(corners, tiles, scales, strict=True)):
        x, y = at_px[0] - left, at_px[1] - top
        if 0 <= x < width and 0 <= y < height:
            return number, (x + 0.5) / scale - 0.5, (y + 0.5) / scale - 0.5
    raise InputError(f"{at_px[0]:g},{at_px[1]:g} lies in no image of the picture of {size_px[0]} x {size_px[1]} pixels")


def masks_overlay(masks: InstanceMasks, image: AnImage | None = None) -> Image.Image:
    """The image with masks and their names, each with its label, from 1 in their order.

    Raises:
        InputError: The image has not the size of the masks.
    """
    colours = as_tuples(instance_colours(masks.categories.tolist()))
    names = [numbered(mask.name, label) for label, mask in enumerate(masks, start=1)]
    pixels = image_like(image, masks.image_size)
    scale = usual_width_px(*pixels.shape[:2]) / pixels.shape[1]
    picture, covered = _with_masks(pixels, masks, colours, scale)
    draw_tags(picture, _tags(masks, colours, names, scale), covered, _pen_px(picture))
    return picture


def usual_width_px(height: int, width: int) -> int:
    """Width of the picture of an image alone, of its height and width."""
    return max(min(WIDTH_PX, MOST_HEIGHT_PX * width // height), 1)


def overlays_of(each: Sequence[Shown], seen: SeenView, image: NDArray[np.uint8], width_px: int) -> list[Image.Image]:
    """The pictures of one camera's image as each of `each` shows it, of one result, marked points with a white rim."""
    masks, scale = seen.view.masks, width_px / image.shape[1]
    labels = seen.labels.tolist()
    colours = [each[0].colours[label - 1] for label in labels]
    pictures = []
    masked, covered = _with_masks(image, masks, colours, scale)
    for shown in each:
        with_points = set(shown.labels.tolist())
        names = [shown.names[label - 1] if label in with_points else None for label in labels]
        picture = _with_points(masked, shown, seen, scale)
        tags = _tags(masks, colours, names, scale) + _tags_of_points(shown, seen, scale)
        draw_tags(picture, tags, covered, _pen_px(picture))
        pictures.append(picture)
    return pictures


def _with_masks(
    image: NDArray[np.uint8], masks: InstanceMasks, colours: Sequence[Colour], scale: float
) -> tuple[Image.Image, NDArray[np.bool_]]:
    """The image with masks, and (H, W) True where masks are."""
    picture = _subdued(image, scale)
    covered = np.zeros(image.shape[:2], bool)
    for mask, colour in zip(masks, colours, strict=True):
        top, left, height, width = mask.bounding_box
        crop = mask.crop()
        if height:
            _draw_mask(picture, crop, colour, (left, top), scale)
        covered[top : top + height, left : left + width] |= crop
    return picture, covered


def _tags(masks: InstanceMasks, colours: Sequence[Colour], names: Sequence[str | None], scale: float) -> list[Tag]:
    """A tag for each mask that has a name."""
    tags = []
    for mask, colour, name in zip(masks, colours, names, strict=True):
        if name is not None:
            top, left, height, width = mask.bounding_box
            tags.append(_tag(name, colour, (left, top, left + width, top + height), scale))
    return tags


def _tags_of_points(shown: Shown, seen: SeenView, scale: float) -> list[Tag]:
    """A tag for each object that the image overlooks: one that has points there and no mask."""
    labels, tags = shown.labels[seen.in_view], []
    for label in sorted({*labels[labels > 0].tolist()} - {*seen.labels.tolist()}):
        at_px = seen.pixels[labels == label] + 0.5
        box = (*at_px.min(axis=0).tolist(), *at_px.max(axis=0).tolist())
        tags.append(_tag(shown.names[label - 1], shown.colours[label - 1], box, scale))
    return tags


def _tag(name: str, colour: Colour, box: tuple[float, float, float, float], scale: float) -> Tag:
    """A tag at left, top, right and bottom of the image."""
    left, top, right, bottom = (round(scale * edge) for edge in box)
    return Tag(name, colour, (left, top, right, bottom))


def _with_points(picture: Image.Image, shown: Shown, seen: SeenView, scale: float) -> Image.Image:
    pen_px = _pen_px(picture)
    canvas = Canvas(picture, radius_px=2.0 * pen_px)
    # the farthest first, the nearest above them
    distances = np.linalg.norm(shown.result.points[seen.in_view, :3], axis=1)
    order = np.argsort(-distances, kind="stable")
    at_px = np.floor((seen.pixels[order] + 0.5) * scale).astype(np.int64)
    labels, marked = shown.labels[seen.in_view][order], shown.marked[seen.in_view][order]
    labelled = labels > 0
    canvas.stamp(at_px[~labelled], BACKGROUND, disc(0.45 * pen_px, 0.5))
    canvas.stamp(at_px[labelled & ~marked], HALO, disc(1.7 * pen_px, 0.55))
    canvas.stamp(at_px[labelled & marked], MARK, disc(2.0 * pen_px))
    canvas.stamp(at_px[labelled], shown.colours_of(labels[labelled]), disc(1.1 * pen_px))
    return canvas.picture().convert("RGB")


def _subdued(image: NDArray[np.uint8], scale: float) -> Image.Image:
    """The image, scaled, darker and nearly grey: colour belongs to the labels."""
    picture = Image.fromarray(image)
    nearly_grey = Image.blend(picture.convert("L").convert("RGB"), picture, 0.3)
    darker = Image.blend(nearly_grey, Image.new("RGB", picture.size), 0.22)
    return darker.resize(_scaled(picture.size, scale), Image.Resampling.BICUBIC)


def _draw_mask(
    picture: Image.Image, crop: NDArray[np.bool_], colour: Colour, corner: tuple[int, int], scale: float
) -> None:
    half_line_px = 0.6 * _pen_px(picture) + 0.5
    # as wide as pixels of the image, and wide enough that the way to the edge is known as far as the line goes
    blur_px = max(scale, half_line_px / 1.25)
    margin = math.ceil(3 * blur_px / scale)
    small = Image.fromarray(np.pad(crop, margin).astype(np.uint8) * 255)
    large = small.resize(_scaled(small.size, scale), Image.Resampling.BILINEAR)
    blurred = np.asarray(large.filter(ImageFilter.GaussianBlur(blur_px)))
    # what is thinner than the blur would nowhere come to a half
    inside = blurred / max(blurred.max(), 1)
    # A blurred edge rises by 1 / (sqrt(2 pi) radius) a pixel, which gives the way to it in pixels.
    to_edge_px = np.abs(inside - 0.5) * 2.5 * blur_px
    outline = (half_line_px - to_edge_px).clip(0, 1)
    at_px = (round((corner[0] - margin) * scale), round((corner[1] - margin) * scale))
    opacity = np.maximum(outline, 0.28 * (inside > 0.5))
    picture.paste(colour, at_px, Image.fromarray((opacity * 255).round().astype(np.uint8)))


def _scaled(size_px: tuple[int, int], scale: float) -> tuple[int, int]:
    """Width and height of a picture, scaled."""
    width, height = size_px
    return max(round(width * scale), 1), max(round(height * scale), 1)


def _pen_px(picture: Image.Image) -> float:
    """Width of a thin line: pictures of one width look alike."""
    return max(picture.width / 1240, 1)
