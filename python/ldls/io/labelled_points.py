"""Columns of labelled clouds: position, instance, name and colour of each point."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ldls.palette import BACKGROUND, instance_colours, label_colours
from ldls.segmentation import Segmentation
from ldls.sequences import LabelledMap

Labelled = Segmentation | LabelledMap
"""What has points with labels."""
POSITION = ("x", "y", "z", "intensity")
CHANNELS = ("red", "green", "blue")


def positions(result: Labelled) -> dict[str, NDArray[np.floating]]:
    """(N,) x, y, z in metres and, where the cloud has a fourth column, intensity, in the precision of the cloud."""
    return dict(zip(POSITION, result.points.T, strict=False))


def instances(result: Labelled) -> NDArray[np.uint32]:
    """(N,) uint32: label of each point, or its track where it is tracked; 0 for background and out of view."""
    if isinstance(result, LabelledMap):
        return result.tracks.astype(np.uint32)
    ids: NDArray[np.uint32] = result.per_point(result.instance_ids.astype(np.uint32))
    return ids


def colors(result: Labelled) -> NDArray[np.uint8]:
    """(N, 3) uint8: red, green and blue of each point, grey for background and out of view."""
    if isinstance(result, LabelledMap):
        return _map_colors(result)
    colours: NDArray[np.uint8] = result.per_point(label_colours(result.instances))
    return colours


def packed_colors(result: Labelled) -> NDArray[np.float32]:
    """(N,) float32 whose bits are the colour 0x00RRGGBB, as the Point Cloud Library and viewers of ROS have it."""
    red, green, blue = colors(result).astype(np.uint32).T
    packed: NDArray[np.float32] = (red << 16 | green << 8 | blue).view(np.float32)
    return packed


def names(result: Segmentation) -> list[str | None]:
    """Category name of each label 0, 1, ..., and of -1 at the end; None for background and out of view."""
    return [None, *(instance.name for instance in result.instances), None]


def _map_colors(places: LabelledMap) -> NDArray[np.uint8]:
    """As of a result whose instances are the tracks of the map."""
    pairs = np.stack([places.tracks, places.categories], axis=1)
    found, numbers = np.unique(pairs, axis=0, return_inverse=True)
    of_pairs = instance_colours(found[:, 1].tolist(), found[:, 0].tolist())
    of_pairs[found[:, 1] == 0] = BACKGROUND
    colours: NDArray[np.uint8] = of_pairs[numbers.reshape(-1)]
    return colours
