"""Which points a recording has."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ldls.cloud import Points


def finite_rows(points: Points) -> NDArray[np.int64]:
    """Rows of the points whose coordinates are all finite; viewers have no place for the others."""
    return np.flatnonzero(np.isfinite(points[:, :3]).all(axis=1))
