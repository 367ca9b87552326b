"""Masks of a large image and how the COCO tools code them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

HEIGHT, WIDTH, COUNT = 1080, 1920, 100


def outlines(count: int = COUNT) -> NDArray[np.bool_]:
    """(count, 1080, 1920) rounded shapes of 40 to 600 pixels, wavy as a network's masks are."""
    generator = np.random.default_rng(0)
    v, u = np.ogrid[:HEIGHT, :WIDTH]
    masks = np.zeros((count, HEIGHT, WIDTH), np.bool_)
    for mask in masks:
        row, column = generator.uniform(0, HEIGHT), generator.uniform(0, WIDTH)
        tall, wide = generator.uniform(20, 300, 2)
        turn = np.arctan2(v - row, u - column)
        mask[...] = ((v - row) / tall) ** 2 + ((u - column) / wide) ** 2 <= 1 + 0.2 * np.sin(7 * turn)
    return masks


def encoded(masks: NDArray[np.bool_]) -> list[dict[str, Any]]:
    """Compressed RLE of each mask by the COCO tools."""
    from pycocotools import mask as coco_tools

    return [coco_tools.encode(np.asfortranarray(mask, np.uint8)) for mask in masks]


def results(rles: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The masks as a list of results, as a JSON file holds them."""
    return [
        {"category_id": 1, "score": 0.5, "segmentation": {"size": rle["size"], "counts": rle["counts"].decode()}}
        for rle in rles
    ]
