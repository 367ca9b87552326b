"""Columns of labelled clouds: position, instance, name and colour of each point."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ldls.palette import label_colours
from ldls.segmentation import Segmentation

POSITION = ("x", "y", "z", "intensity")
CHANNELS = ("red", "green", "blue")


def positions(result: Segmentation) -> dict[str, NDArray[np.floating]]:
    """(N,) x, y, z in metres and, where the cloud has a fourth column, intensity, in the precision of the cloud."""
    return dict(zip(POSITION, result.points.T, strict=False))


def instances(result: Segmentation) -> NDArray[np.uint32]:
    """(N,) uint32: label of each point, 0 for background and out of view."""
    return np.maximum(result.labels, 0).astype(np.uint32)


def colors(result: Segmentation) -> NDArray[np.uint8]:
    """(N, 3) uint8: red, green and blue of each point, grey for background and out of view."""
    colours: NDArray[np.uint8] = result.per_point(label_colours(instance.category for instance in result.instances))
    return colours


def names(result: Segmentation) -> list[str | None]:
    """Category name of each label 0, 1, ..., and of -1 at the end; None for background and out of view."""
    return [None, *(instance.name for instance in result.instances), None]
