"""Polygons with a label each, as parsed JSON: labelme's shapes, and the objects of Cityscapes and Mapillary Vistas.

Sources: https://github.com/wkentaro/labelme, https://github.com/mcordts/cityscapesScripts and
https://www.mapillary.com/dataset/vistas.
"""

from __future__ import annotations

from base64 import b64decode
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import ldls._ldls as _ldls
from ldls.categories import COCO_NAMES, category_ids, class_id, folded, is_object
from ldls.checks import numbers, shown
from ldls.errors import MaskError, within
from ldls.masks.coco import records
from ldls.masks.pixels import check_pixels, checked_size, uncovered

CIRCLE_CORNERS = 64
RECTANGLES = ("rectangle", "oriented_rectangle")
"""labelme's kinds that may have their four corners."""

THINGS = frozenset(("person", "rider", "car", "truck", "bus", "caravan", "trailer", "train", "motorcycle", "bicycle"))
"""Cityscapes' classes that come one by one; its others are surfaces, and groups of so many."""
NOT_DRAWN = "license plate"
"""The one label of Cityscapes that covers nothing."""
MAPILLARY_THINGS = ("animal", "human", "object")
"""What the labels of Mapillary's things begin with: object--vehicle--car."""


def from_shapes(
    content: Mapping[str, Any],
    *,
    decode: Callable[[bytes], NDArray[np.uint8]],
    names: Mapping[int, str] | None = None,
) -> dict[str, Any]:
    """Arguments of `InstanceMasks` from labelme's JSON of one image, without shapes of what is no object.

    Shapes of one label that share a group_id are parts of one instance. Labels with the name of one of COCO's
    categories, or of `names`, get its id; others 100 and their place in the alphabet, or another that `names` do not
    have.

    Args:
        content: The parsed JSON.
        decode: What makes (h, w, 3) pixels of a PNG file, for shapes of pixels.
        names: Name of each category id, for labels that COCO does not know.

    Raises:
        MaskError: A shape that covers nothing, such as a line, or whose points, group_id or pixels are none.
        CorruptFileError: It is not labelme's.
    """
    size = checked_size((content.get("imageHeight"), content.get("imageWidth")))
    parts: dict[tuple[str, object], tuple[str, _ldls.Rle]] = {}
    for i, shape in enumerate(records("shapes", content["shapes"])):
        label, group = str(shape.get("label")), shape.get("group_id")
        if not is_object(label):
            continue
        with within(f"shape {i}"):
            if isinstance(group, list | dict):
                raise MaskError(f"group_id is {shown(group)}, expected a number or text for the parts of one instance")
            own = (folded(label), ("alone", i) if group is None else group)
            rle = _drawn(shape, size, decode)
            parts[own] = (parts[own][0], parts[own][1].union(rle)) if own in parts else (label, rle)
    return _arguments(size, [label for label, _ in parts.values()], [rle for _, rle in parts.values()], names)


def _drawn(shape: Mapping[str, Any], size: tuple[int, int], decode: Callable[[bytes], NDArray[np.uint8]]) -> _ldls.Rle:
    """The pixels of a shape of labelme."""
    kind, points = shape.get("shape_type") or "polygon", _points("points", shape)
    if kind != "mask":
        return _ldls.Rle.from_polygons(*size, [_corners(kind, points)])
    with within("mask"):
        try:
            png = b64decode(shape.get("mask"), validate=True)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            found = shown(shape.get("mask"))
            raise MaskError(f"got {found}, expected a PNG in base64, as labelme writes it") from None
        pixels: NDArray[np.bool_] = decode(png).max(axis=2) > 0
    return _placed(pixels, points, size)


def _placed(pixels: NDArray[np.bool_], points: NDArray[np.float64], size: tuple[int, int]) -> _ldls.Rle:
    """The `pixels` of the box whose first and last pixel are the two `points`, in an image of that size."""
    height, width = pixels.shape
    left, top = points[0].tolist() if len(points) == 2 else (-1.0, -1.0)
    fits = 0 <= left <= size[1] - width and 0 <= top <= size[0] - height
    if not fits or np.abs(points[1] - points[0] + 1 - (width, height)).max() > 1:
        raise MaskError(
            f"mask of {height} x {width} pixels (height x width), expected as points its first and last pixel in an "
            f"image of {size[0]} x {size[1]}, x y each, got {points.tolist()}"
        )
    check_pixels(*size)
    whole = np.zeros(size, np.bool_)
    whole[int(top) : int(top) + height, int(left) : int(left) + width] = pixels
    return _ldls.Rle.from_pixels(whole)


def from_objects(content: Mapping[str, Any], *, names: Mapping[int, str] | None = None) -> dict[str, Any]:
    """Arguments of `InstanceMasks` from Cityscapes' or Mapillary's polygons of one image; surfaces are background.

    Categories are as of `from_shapes`; of a label such as object--vehicle--car the last part that COCO knows counts.
    Cityscapes draws its objects in their order: later ones, surfaces too, cover earlier ones.

    Args:
        content: The parsed JSON.
        names: Name of each category id, for labels that COCO does not know.

    Raises:
        MaskError: A polygon that is none, or has fewer than three points.
        CorruptFileError: It is of neither.
    """
    height, width = (content.get(f"img{side}", content.get(side.lower())) for side in ("Height", "Width"))
    size = checked_size((height, width))
    drawn_in_order = "imgHeight" in content
    labels, things, rles = [], [], []
    for i, each in enumerate(records("objects", content["objects"])):
        parts = str(each.get("label")).split("--")
        is_thing = parts[0] in THINGS if len(parts) == 1 else parts[0] in MAPILLARY_THINGS
        covers = drawn_in_order and parts[0] != NOT_DRAWN
        if each.get("deleted") or not (is_thing or covers):
            continue
        with within(f"object {i}"):
            polygon = _points("polygon", each)
            if is_thing or len(polygon) > 2:
                rles.append(_ldls.Rle.from_polygons(*size, [_corners("polygon", polygon)]))
        if not is_thing:
            continue
        plain = [part.replace("-", " ") for part in parts]
        known = (part for part in reversed(plain) if folded(part) in COCO_NAMES.values())
        labels.append(next(known, plain[-1]))
        things.append(len(rles) - 1)
    if drawn_in_order:
        rles = uncovered(rles, reversed(range(len(rles))))
    return _arguments(size, labels, [rles[i] for i in things], names)


def _arguments(
    size: tuple[int, int],
    labels: Sequence[str],
    rles: Sequence[_ldls.Rle],
    names: Mapping[int, str] | None,
) -> dict[str, Any]:
    given = {folded(name): category for category, name in (names or {}).items()}
    spelled = {folded(label): label for label in sorted(labels, reverse=True) if folded(label) not in given}
    others = sorted(spelled.values())
    ids, own = category_ids(dict(enumerate(others)))
    known = dict(names or {})
    of_label = given | {folded(own[each]): class_id(each, own[each], known) for each in ids.values()}
    return {
        "rles": rles,
        "image_size": size,
        "categories": np.array([of_label[folded(label)] for label in labels], np.int64),
        "names": COCO_NAMES | known,
    }


def _points(name: str, record: Mapping[str, Any]) -> NDArray[np.float64]:
    """(n, 2) x, y of the points that a record has by that name.

    Raises:
        MaskError: They are no list of x y.
    """
    return numbers(name, record.get(name) or np.empty((0, 2)), np.float64, ("n", 2), error=MaskError)


def _corners(kind: str, points: NDArray[np.float64]) -> list[float]:
    if kind == "rectangle" and len(points) == 2:
        (left, top), (right, bottom) = points.min(axis=0), points.max(axis=0)
        points = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
    elif kind == "circle" and len(points) == 2:
        points = _circle(*points)
    elif not (kind == "polygon" and len(points) > 2) and not (kind in RECTANGLES and len(points) == 4):
        raise MaskError(
            f"{kind} of {len(points)} points, expected a polygon of 3 or more, a rectangle of 2 or 4, or a circle of 2"
        )
    corners: list[float] = points.ravel().tolist()
    return corners


def _circle(center: NDArray[np.float64], edge: NDArray[np.float64]) -> NDArray[np.float64]:
    angles = np.linspace(0, 2 * np.pi, CIRCLE_CORNERS, endpoint=False)
    # what is too large becomes infinite, and is refused with the polygon
    with np.errstate(over="ignore", invalid="ignore"):
        around: NDArray[np.float64] = center + np.hypot(*(edge - center)) * np.column_stack(
            [np.cos(angles), np.sin(angles)]
        )
    return around
