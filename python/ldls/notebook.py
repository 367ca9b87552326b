"""What notebooks show of a segmentation: pictures, and the table of its objects."""

from __future__ import annotations

import base64
import io
from html import escape
from typing import TYPE_CHECKING

from ldls.object_rows import HEADINGS, cells_of, nearest_first
from ldls.segmentation import Segmentation, SegmentedObject

if TYPE_CHECKING:
    from PIL import Image

WIDTH_PX, HEIGHT_PX = 1200, 700


def html_of(result: Segmentation) -> str:
    """HTML of a result: masks and points as its cameras see them, the view from above, and its objects, nearest first.

    A result does not hold the image; `ldls.viewing.overlay(result, image)` draws on it, and notebooks show that too.
    """
    from ldls.viewing.birds_eye import shown_birds_eye_view
    from ldls.viewing.ground import ground_of
    from ldls.viewing.overlay import overlay
    from ldls.viewing.shown import shown

    seen = overlay(result, width_px=WIDTH_PX if len(result.views) == 1 else None)
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
    head = "".join(f"<th>{column}</th>" for column in ("", *HEADINGS))
    rows = "".join(_row(each, colours[each.label - 1]) for each in nearest_first(result.objects))
    return f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"


def _row(found: SegmentedObject, colour: list[int]) -> str:
    swatch = f'<td style="background: rgb({colour[0]}, {colour[1]}, {colour[2]})">&emsp;</td>'
    return f"<tr>{swatch}{''.join(f'<td>{escape(cell)}</td>' for cell in cells_of(found))}</tr>"
