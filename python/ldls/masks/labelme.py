"""labelme's shapes, as parsed JSON.

Shapes of one label that share a group_id are parts of one instance. Source: https://github.com/wkentaro/labelme.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

import ldls._ldls as _ldls
from ldls.categories import COCO_NAMES, category_ids
from ldls.errors import CorruptFileError, MaskError, within
from ldls.masks.pixels import checked_size

CIRCLE_CORNERS = 64


def arguments(content: Mapping[str, Any], *, names: Mapping[int, str] | None = None) -> dict[str, Any]:
    """Arguments of `InstanceMasks` from the parsed JSON of one image.

    Labels with the name of one of COCO's categories, or of `names`, get its id; others 100 and their place in the
    alphabet.

    Args:
        content: The parsed JSON.
        names: Name of each category id, for labels that COCO does not know.

    Raises:
        MaskError: A shape that covers nothing, such as a line.
        CorruptFileError: It is not labelme's.
    """
    size = checked_size((content.get("imageHeight"), content.get("imageWidth")))
    shapes = content["shapes"]
    if not isinstance(shapes, list) or not all(isinstance(shape, dict) for shape in shapes):
        raise CorruptFileError("expected shapes to be a list of objects")
    parts: dict[tuple[str, object], list[list[float]]] = {}
    for i, shape in enumerate(shapes):
        label, group = str(shape.get("label")), shape.get("group_id")
        with within(f"shape {i}"):
            parts.setdefault((label, ("alone", i) if group is None else group), []).append(_polygon(shape))
    given = {name: category for category, name in (names or {}).items()}
    labels = sorted({label for label, _ in parts if label not in given})
    ids, own = category_ids(dict(enumerate(labels)))
    of_label = {label: ids[index] for index, label in enumerate(labels)} | given
    return {
        "rles": [_ldls.Rle.from_polygons(*size, polygons) for polygons in parts.values()],
        "image_size": size,
        "categories": np.array([of_label[label] for label, _ in parts], np.int64),
        "names": COCO_NAMES | own | dict(names or {}),
    }


def _polygon(shape: Mapping[str, Any]) -> list[float]:
    kind = shape.get("shape_type") or "polygon"
    points = np.array(shape.get("points", ()), np.float64)
    if points.ndim != 2 or points.shape[1:] != (2,) or not np.isfinite(points).all():
        raise CorruptFileError("points: expected a list of x y")
    if kind == "rectangle" and len(points) == 2:
        (left, top), (right, bottom) = points.min(axis=0), points.max(axis=0)
        points = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
    elif kind == "circle" and len(points) == 2:
        points = _circle(*points)
    elif kind != "polygon" or len(points) < 3:
        raise MaskError(f"{kind} of {len(points)} points, expected a polygon, a rectangle or a circle")
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
