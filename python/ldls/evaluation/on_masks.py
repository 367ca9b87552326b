"""The points that fall on masks, and how far groups of points overlap with them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ldls import stages
from ldls._optional import require
from ldls.segmentation import Segmentation

if TYPE_CHECKING:
    from scipy.sparse import csr_array


def points_on_masks(result: Segmentation) -> csr_array:
    """(N, M) sparse, 1 where the nearest pixel of a point is on a mask of an instance, of several on each."""
    sparse = require("scipy.sparse", "eval")
    on = sparse.csr_array((len(result.labels), len(result.instances)), dtype=np.float32)
    for seen in result.views:
        weights = stages.pixel_labels(seen.pixels, seen.view.masks, window=1).weights[:, 1:].tocoo()
        places = seen.in_view[weights.row], seen.labels[weights.col] - 1
        on = on + sparse.csr_array((weights.data, places), shape=on.shape)
    return (on > 0).astype(np.int64)


def overlaps_with_masks(groups: NDArray[np.integer], on: csr_array) -> NDArray[np.float64]:
    """(G, M) IoU of groups 0, 1, ... of points with the points on each instance.

    Args:
        groups: (n,) group of each point; -1 for none.
        on: (n, M) sparse, rows of `points_on_masks`.
    """
    sparse, rows = require("scipy.sparse", "eval"), np.flatnonzero(groups >= 0)
    shape = int(groups.max(initial=-1)) + 1, len(groups)
    members = sparse.csr_array((np.ones(len(rows), np.int64), (groups[rows], rows)), shape=shape)
    both = (members @ on).toarray()
    union = members.sum(axis=1)[:, None] + on.sum(axis=0)[None, :] - both
    # a number that no point has is of no size
    ious: NDArray[np.float64] = both / np.maximum(union, 1)
    return ious
