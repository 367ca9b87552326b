"""Objects as rows of text, for the tables of commands, notebooks and recordings."""

from __future__ import annotations

from collections.abc import Iterable

from ldls.segmentation import SegmentedObject

HEADINGS = ("label", "object", "score", "points", "distance", "length x width x height")
"""What the cells of a row are."""


def nearest_first(objects: Iterable[SegmentedObject]) -> list[SegmentedObject]:
    """The objects by their distance, those without points last."""
    return sorted(objects, key=lambda found: (found.distance_m is None, found.distance_m))


def cells_of(found: SegmentedObject) -> tuple[str, ...]:
    """Label, name, score, points, distance and size of an object as text; "-" for what it has not."""
    distance, size = "-", "-"
    if found.box is not None:
        distance = f"{found.distance_m:.1f} m"
        size = " x ".join(f"{side:.1f}" for side in found.box.size) + " m"
    return str(found.label), found.name, f"{found.score:.2f}", f"{found.n_points:,}", distance, size
