"""Colours and numbers of labels in a recording."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ldls import palette
from ldls.errors import LimitError
from ldls.segmentation import Segmentation

OUT_OF_VIEW_COLOUR: palette.Colour = (64, 64, 64)
"""Darker than background: no camera says what these points are."""
OUT_OF_VIEW_ID = 2**16 - 1
"""Keypoint id of points out of view."""
GREATEST_ID = OUT_OF_VIEW_ID - 1


def label_colours(result: Segmentation) -> NDArray[np.uint8]:
    """(M + 2, 3) colours by label: background, the instances, and last, where label -1 finds it, out of view."""
    categories = (instance.category for instance in result.instances)
    return palette.label_colours(categories, out_of_view=OUT_OF_VIEW_COLOUR)


def class_ids(categories: NDArray[np.int32]) -> NDArray[np.uint16]:
    """Class id of each category; they are the same."""
    return categories.astype(np.uint16)


def keypoint_ids(labels: NDArray[np.int32]) -> NDArray[np.uint16]:
    """Keypoint id of each label: itself, save that of points out of view."""
    return np.where(labels < 0, OUT_OF_VIEW_ID, labels).astype(np.uint16)


def check_ids(result: Segmentation) -> None:
    """Refuse what Rerun cannot number.

    Raises:
        LimitError: A category or a label is beyond its ids.
    """
    for instance in result.instances:
        for name, number in (("category", instance.category), ("label", instance.label)):
            if not 0 <= number <= GREATEST_ID:
                raise LimitError(
                    f"{name} {number}: recordings hold 0 to {GREATEST_ID}; number the categories anew, or leave masks "
                    "out with InstanceMasks.filter"
                )
