"""What of a segmentation makes a curve over frames."""

from __future__ import annotations

from collections import Counter

import numpy as np

from ldls.palette import category_colour
from ldls.segmentation import Segmentation
from ldls.viewing.recording.stream import Entity, rerun


def log_statistics(entity: Entity, result: Segmentation) -> None:
    """Log points of each category that has masks, mean confidence of labelled points, milliseconds of each stage."""
    rr = rerun()
    colours = {instance.name: category_colour(instance.category) for instance in result.instances}
    for name, count in points_by_name(result).items():
        (entity / "points" / name).log(rr.Scalars(count), rr.SeriesLines(names=name, colors=colours[name]))
    labelled = result.labels > 0
    if labelled.any():
        mean = float(result.confidence[labelled].mean(dtype=np.float64))
        (entity / "confidence").log(rr.Scalars(mean), rr.SeriesLines(names="mean confidence"))
    for stage, seconds in result.timings.items():
        (entity / "milliseconds" / stage).log(rr.Scalars(seconds * 1e3), rr.SeriesLines(names=stage))


def points_by_name(result: Segmentation) -> dict[str, int]:
    """Points of each category that has masks, by its name."""
    counts: Counter[str] = Counter()
    for found in result.objects:
        counts[found.name] += found.n_points
    return dict(counts)
