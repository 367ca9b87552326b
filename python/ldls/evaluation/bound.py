"""What masks allow: the best labels that a method could make of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ldls.checks import checked
from ldls.evaluation.classes import CLASS_SHIFT, ClassSet
from ldls.evaluation.on_masks import overlaps_with_masks, points_on_masks
from ldls.labeling import Labeling
from ldls.segmentation import Segmentation


@checked
def bound_labels(result: Segmentation, truth: Labeling, classes: ClassSet) -> NDArray[np.int32]:
    """Labels (N,) in which every true object wholly has the label of the mask that overlaps it best.

    A mask labels one object, of its own class; true points of a class without an instance are one object. Pairs are
    taken from the largest IoU down, between the points of the object and those that fall on the mask, and of equals the
    first; points that do not count are in neither. An object without a mask is background.

    Args:
        result: Any result from the masks; only its points, masks and cameras matter.
        truth: True labels of its N points.
        classes: The scored classes; other objects are background.

    Raises:
        InputError: Truth holds a class that `classes` does not know.
    """
    true = classes.map(truth, truth=True)
    labels = np.full(len(true), -1, np.int32)
    labels[result.in_view] = 0
    rows = np.flatnonzero((labels == 0) & ~true.ignored)
    of_objects = np.where(true.classes > 0, true.classes.astype(np.int64) << CLASS_SHIFT | true.instances, -1)
    codes, objects = np.unique(of_objects[rows], return_inverse=True)
    iou = overlaps_with_masks(objects, points_on_masks(result)[rows])
    of_masks = np.array([classes.index(instance.name) for instance in result.instances], np.int64)
    iou[(codes[:, None] >> CLASS_SHIFT != of_masks) | (codes[:, None] < 0)] = 0
    order = np.argsort(-iou, axis=None, kind="stable")[: np.count_nonzero(iou)]
    for k, m in zip(*np.unravel_index(order, iou.shape), strict=True):
        if iou[k, m] > 0:
            labels[rows[objects == k]] = m + 1
            # both are taken
            iou[k], iou[:, m] = 0, 0
    return labels
