"""HTML of a segmentation for notebooks: pictures, and the table of its objects."""

from __future__ import annotations

import base64
from html import escape

from PIL import Image

from ldls.io.images import png_of
from ldls.palette import label_colours
from ldls.segmentation import Segmentation
from ldls.viewing.birds_eye import birds_eye_of, surroundings
from ldls.viewing.ground import ground_of
from ldls.viewing.object_tables import HEADINGS, cells_of, nearest_first, objects_found
from ldls.viewing.overlay import overlay
from ldls.viewing.shown import Shown

WIDTH_PX, HEIGHT_PX = 1200, 700


def html_of(result: Segmentation) -> str:
    """HTML of a result: masks and points as its cameras see them, the view from above, and its objects, nearest first.

    A result does not hold the image; `ldls.viewing.overlay(result, image)` draws on it, and notebooks show that too.
    """
    numbers = f"{len(result.labels):,} points, {len(result.in_view):,} in view, {objects_found(result.objects)}"
    pictures = ""
    if result.views:
        pictures = _img(overlay(result, width_px=WIDTH_PX if len(result.views) == 1 else None), "masks and points")
    ground = ground_of(result, size_px=(WIDTH_PX, HEIGHT_PX), fill=True)
    above = birds_eye_of(Shown.of(result, "final"), ground, surroundings(result, ground), boxes=True)
    pictures += _img(above, "the points from above")
    return f"<div><p>{numbers}</p>{pictures}{_table(result)}</div>"


def _img(picture: Image.Image, caption: str) -> str:
    encoded = base64.b64encode(png_of(picture)).decode()
    return f'<img alt="{caption}" style="max-width: 100%; display: block" src="data:image/png;base64,{encoded}">'


def _table(result: Segmentation) -> str:
    colours = label_colours(result.instances).tolist()
    numbers = result.instance_ids.tolist()
    head = "".join(f"<th>{heading}</th>" for heading in ("", *HEADINGS))
    rows = []
    for each in nearest_first(result.objects):
        red, green, blue = colours[each.label]
        cells = "".join(f"<td>{escape(cell)}</td>" for cell in cells_of(each, numbers[each.label]))
        rows.append(f'<tr><td style="background: rgb({red}, {green}, {blue})">&emsp;</td>{cells}</tr>')
    return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
