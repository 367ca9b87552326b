"""Masks of a large image and how the COCO tools code them."""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

import ldls
from benches.frames import Frame
from benches.measuring import add_ratio, medians, new_table

HEIGHT, WIDTH, COUNT = 1080, 1920, 100


def outlines() -> NDArray[np.bool_]:
    """(`COUNT`, 1080, 1920) rounded shapes of 40 to 600 pixels, wavy as a network's masks are."""
    generator = np.random.default_rng(0)
    v, u = np.ogrid[:HEIGHT, :WIDTH]
    masks = np.zeros((COUNT, HEIGHT, WIDTH), np.bool_)
    for mask in masks:
        row, column = generator.uniform(0, HEIGHT), generator.uniform(0, WIDTH)
        tall, wide = generator.uniform(20, 300, 2)
        turn = np.arctan2(v - row, u - column)
        mask[...] = ((v - row) / tall) ** 2 + ((u - column) / wide) ** 2 <= 1 + 0.2 * np.sin(7 * turn)
    return masks


def results(rles: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The masks as a list of results, as a JSON file holds them."""
    return [
        {"category_id": 1, "score": 0.5, "segmentation": {"size": rle["size"], "counts": rle["counts"].decode()}}
        for rle in rles
    ]


def masks(_measured: Frame, options: argparse.Namespace) -> Table:
    """Masks of 1920 x 1080 pixels from and to COCO's run lengths, against pycocotools."""
    from pycocotools import mask as coco_tools

    warnings.filterwarnings("ignore", "__array__ implementation", DeprecationWarning)
    pixels = outlines()
    columns_first = [np.asfortranarray(mask, np.uint8) for mask in pixels]
    rles = [coco_tools.encode(mask) for mask in columns_first]
    listed = results(rles)
    sides: dict[str, tuple[Callable[[], object], Callable[[], object]]] = {
        "results to pixels": (
            lambda: coco_tools.decode(rles),
            lambda: ldls.InstanceMasks.from_coco(listed).to_array(),
        ),
        "pixels to run lengths": (
            lambda: [coco_tools.encode(mask) for mask in columns_first],
            lambda: ldls.InstanceMasks.from_array(pixels),
        ),
    }
    differ = int((np.moveaxis(coco_tools.decode(rles), -1, 0) != sides["results to pixels"][1]()).sum())
    table = new_table(
        f"{COUNT} masks of {WIDTH} x {HEIGHT} pixels",
        ["work", "pycocotools, ms", "ldls, ms", "ratio"],
        f"pycocotools on one thread, ldls on {options.threads}; pixels that differ: {differ}",
    )
    for name, (peer, own) in sides.items():
        found = medians({"peer": peer, "ldls": own}, runs=min(options.runs, 7))
        add_ratio(table, name, found["peer"], found["ldls"])
    return table
