"""All fields of a segmentation in one `.npz` file."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ldls.io.npz import write_npz

if TYPE_CHECKING:
    from ldls.objects import SegmentedObject
    from ldls.segmentation import Segmentation


def write(path: Path, result: Segmentation) -> None:
    """Write the arrays of `result` under their names, its objects as `object_*`, the rest as JSON text.

    With one camera, `pixels` belongs to `in_view`; with several, `view_names` names them, and `view0_in_view`,
    `view0_pixels`, `view0_labels` and so on are what each sees.
    `object_box` has a row for each object: x y z of the middle, length, width, height in metres, yaw in radians; NaN
    where the object has no point.
    """
    objects = result.objects
    write_npz(
        path,
        {
            "labels": result.labels,
            "diffused_labels": result.diffused_labels,
            "categories": result.categories,
            "confidence": result.confidence,
            "in_view": result.in_view,
            **_views(result),
            "object_category": np.array([o.category for o in objects], np.int32),
            "object_name": np.array([o.name for o in objects], np.str_),
            "object_score": np.array([o.score for o in objects], np.float32),
            "object_n_points": np.array([o.n_points for o in objects], np.int64),
            "object_centroid": np.array([_centroid(o) for o in objects]).reshape(-1, 3),
            "object_box": np.array([_box(o) for o in objects]).reshape(-1, 7),
            "params": np.array(json.dumps(asdict(result.params))),
            "report": np.array(json.dumps(asdict(result.report))),
            "timings": np.array(json.dumps(dict(result.timings))),
        },
    )


def _views(result: Segmentation) -> dict[str, NDArray[Any]]:
    if len(result.views) == 1:
        return {"pixels": result.pixels}
    arrays: dict[str, NDArray[Any]] = {
        "view_names": np.array([seen.view.name or f"camera {i}" for i, seen in enumerate(result.views)], np.str_)
    }
    for i, seen in enumerate(result.views):
        arrays |= {f"view{i}_in_view": seen.in_view, f"view{i}_pixels": seen.pixels, f"view{i}_labels": seen.labels}
    return arrays


def _centroid(found: SegmentedObject) -> NDArray[np.float64]:
    return np.full(3, np.nan) if found.centroid is None else found.centroid


def _box(found: SegmentedObject) -> NDArray[np.float64]:
    if found.box is None:
        return np.full(7, np.nan)
    return np.concatenate([found.box.center, found.box.size, [found.box.yaw]])
