"""What notebooks show of a segmentation: pictures, and the table of its objects."""

from __future__ import annotations

import base64
import io
from html import escape
from typing import TYPE_CHECKING

from ldls.objects import SegmentedObject
from ldls.segmentation import Segmentation

if TYPE_CHECKING:
    from PIL import Image

WIDTH_PX, HEIGHT_PX = 1200, 700
COLUMNS = ("", "label", "object", "score", "points", "distance", "length x width x height")


def html_of(result: Segmentation) -> str:
    """HTML of a result: masks and points as its cameras see them, the view from above, and its objects, nearest first.

    A result does not hold the image; `ldls.viewing.overlay(result, image)` draws on it, and notebooks show that too.
    """
    from ldls.viewing.birds_eye import shown_birds_eye_view
    from ldls.viewing.ground import ground_of
    from ldls.viewing.overlay import WIDTH_PX as PAIR_PX
    from ldls.viewing.overlay import overlay
    from ldls.viewing.shown import shown

    seen = overlay(result, width_px=WIDTH_PX if len(result.views) == 1 else PAIR_PX // 2)
    ground = ground_of(result, size_px=(WIDTH_PX, HEIGHT_PX), fill=True)
    above = shown_birds_eye_view(shown(result, "final"), ground, boxes=True)
    pictures = [_picture(seen, "masks and points"), _picture(above, "the points from above")]
    return f"<div>{_summary(result)}{''.join(pictures)}{_table(result)}</div>"


def _summary(result: Segmentation) -> str:
    found = sum(each.n_points > 0 for each in result.objects)
    return (
        f"<p>{len(result.labels):,} points, {len(result.in_view):,} in view, "
        f"{found} of {len(result.objects)} objects found</p>"
    )


def _picture(picture: Image.Image, what: str) -> str:
    file = io.BytesIO()
    picture.save(file, "PNG")
    encoded = base64.b64encode(file.getvalue()).decode()
    return f'<img alt="{what}" style="max-width: 100%; display: block" src="data:image/png;base64,{encoded}">'


def _table(result: Segmentation) -> str:
    from ldls.palette import instance_colours

    colours = instance_colours(instance.category for instance in result.instances).tolist()
    nearest = sorted(result.objects, key=lambda each: (each.distance_m is None, each.distance_m))
    head = "".join(f"<th>{column}</th>" for column in COLUMNS)
    rows = "".join(_row(each, colours[each.label - 1]) for each in nearest)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"


def _row(found: SegmentedObject, colour: list[int]) -> str:
    swatch = f'<td style="background: rgb({colour[0]}, {colour[1]}, {colour[2]})">&emsp;</td>'
    distance = "-" if found.distance_m is None else f"{found.distance_m:.1f} m"
    size = "-" if found.box is None else " x ".join(f"{side:.1f}" for side in found.box.size) + " m"
    cells = (str(found.label), escape(found.name), f"{found.score:.2f}", f"{found.n_points:,}", distance, size)
    return f"<tr>{swatch}{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>"
