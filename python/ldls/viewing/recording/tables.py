"""Objects and report of a segmentation as Markdown."""

from __future__ import annotations

from dataclasses import asdict

from ldls.object_rows import HEADINGS, cells_of, nearest_first
from ldls.segmentation import Segmentation


def markdown(result: Segmentation, *, title: str = "") -> str:
    """The objects, the nearest first and those without points last, and what was noticed."""
    in_order = nearest_first(result.objects)
    found = sum(o.n_points > 0 for o in in_order)
    parts = [f"# {title}"] if title else []
    parts.append(f"{found} of {len(in_order)} objects found")
    if in_order:
        parts.append(_table(HEADINGS, [cells_of(o) for o in in_order]))
    noticed = {name: value for name, value in asdict(result.report).items() if value is not None}
    parts.append(_table(("report", ""), [(name.replace("_", " "), _text(value)) for name, value in noticed.items()]))
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
