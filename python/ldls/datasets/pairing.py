"""Which image goes with which sweep, by their stamps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Stamps = NDArray[np.int64]
NONE = -1


def nearest(stamps_ns: Stamps, others_ns: Stamps) -> NDArray[np.int64]:
    """(n,) index of the nearest of `others_ns` (m,), in any order, for each of `stamps_ns` (n,); -1 if m is 0.

    Of two equally near ones the earlier.
    """
    if len(others_ns) == 0:
        return np.full(len(stamps_ns), NONE, np.int64)
    order = np.argsort(others_ns, kind="stable")
    ascending = others_ns[order]
    after = np.searchsorted(ascending, stamps_ns).clip(0, len(ascending) - 1)
    before = np.maximum(after - 1, 0)
    closer_before = np.abs(stamps_ns - ascending[before]) <= np.abs(ascending[after] - stamps_ns)
    return np.asarray(order[np.where(closer_before, before, after)], np.int64)
