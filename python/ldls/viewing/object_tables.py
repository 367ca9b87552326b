"""Objects of a result as text, for the tables of commands, notebooks and recordings."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict

from ldls.segmentation import Segmentation, SegmentedObject

HEADINGS = ("number", "object", "score", "points", "distance", "length x width x height")
"""Headings of the cells of a row."""


def objects_found(objects: Sequence[SegmentedObject]) -> str:
    """The number of objects that have points, as "3 of 4 objects found"."""
    return f"{sum(each.n_points > 0 for each in objects)} of {len(objects)} objects found"


def nearest_first(objects: Iterable[SegmentedObject]) -> list[SegmentedObject]:
    """The objects by their distance, those without points last."""
    return sorted(objects, key=lambda each: (each.distance_m is None, each.distance_m))


def cells_of(each: SegmentedObject, number: int) -> tuple[str, ...]:
    """Number, name, score, points, distance and size of an object as text; "-" for what it has not."""
    distance, size = "-", "-"
    if each.box is not None:
        distance = f"{each.distance_m:.1f} m"
        size = " x ".join(f"{side:.1f}" for side in each.box.size) + " m"
    return str(number or "-"), each.name, f"{each.score:.2f}", f"{each.n_points:,}", distance, size


def markdown(result: Segmentation, *, title: str = "") -> str:
    """Tables of the objects, the nearest first and those without points last, and of the report, in Markdown."""
    numbers = result.instance_ids.tolist()
    parts = [f"# {title}"] if title else []
    parts.append(objects_found(result.objects))
    if result.objects:
        parts.append(_table(HEADINGS, [cells_of(each, numbers[each.label]) for each in nearest_first(result.objects)]))
    report = {name: value for name, value in asdict(result.report).items() if value is not None}
    parts.append(_table(("report", ""), [(name.replace("_", " "), _text(value)) for name, value in report.items()]))
    return "\n\n".join(parts) + "\n"


def _text(value: object) -> str:
    if isinstance(value, tuple):
        return ", ".join(map(str, value)) or "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:,}" if isinstance(value, int) else f"{value:.2g}"


def _table(headings: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    lines = [headings, ("---",) * len(headings), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)
