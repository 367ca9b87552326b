"""Whose pixels decide the label of a point."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.sparse import csr_array

LEFT = 1e-9
"""What one more product brings, 1 at first, below which a converged solution leaves out the rest."""
MOST_PRODUCTS = 20_000


def influences(A: csr_array, row: int, iterations: int | None) -> NDArray[np.float64]:
    """What the pixels of each point count for the point in `row`: (n,) r, with which its likelihoods are r b.

    Likelihoods are z = (1 + A + ... + A^(iterations - 1)) b (step 5); r is one row of that polynomial, the sum of the
    products of the transpose of A with a unit vector, in double precision. It costs one vector instead of one for each
    label, and tells where a label comes from.

    Args:
        A: (n, n) of `stages.normalize_rows`.
        row: The point.
        iterations: Number of products; None until what comes is lost in rounding.
    """
    transpose = A.T.tocsr().astype(np.float64)
    own = np.zeros(A.shape[0])
    own[row] = 1.0
    total = own.copy()
    for _ in range(1, MOST_PRODUCTS if iterations is None else iterations):
        own = transpose @ own
        total += own
        if iterations is None and own.sum() < LEFT:
            break
    return total
