"""One mask as a network draws it: coarse, over the edge, wavering."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ldls._optional import require
from ldls.simulation.errors import SegmenterErrors

Mask = NDArray[np.bool_]
MARGIN_PX = 12
NETWORK_CELLS = 28
WAVE_PX = 6.0
"""An edge wavers over about this many pixels of its length."""


def drawn(silhouette: Mask, errors: SegmenterErrors, rng: np.random.Generator) -> Mask:
    """(H, W) the mask that a network draws of `silhouette`; the same where all strengths are 0."""
    window = _window(silhouette, MARGIN_PX + int(2 * _mean_bleed(silhouette, errors)))
    part = silhouette[window]
    cells = _on_cells(part, errors, rng) if errors.mask_cells or errors.box_slip else part
    mask = np.zeros_like(silhouette)
    mask[window] = _edged(cells, errors, rng)
    return mask


def _window(mask: Mask, margin_px: int) -> tuple[slice, slice]:
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    return (
        slice(max(rows[0] - margin_px, 0), rows[-1] + 1 + margin_px),
        slice(max(columns[0] - margin_px, 0), columns[-1] + 1 + margin_px),
    )


def _on_cells(part: Mask, errors: SegmenterErrors, rng: np.random.Generator) -> Mask:
    """`part` sampled on the cells of a box that nearly fits, and enlarged again."""
    tight = _window(part, 0)
    slip = rng.normal(0, 1, (2, 2)) * errors.box_slip
    rows, columns = (_slipped(s, slip[k], part.shape[k]) for k, s in enumerate(tight))
    crop = Image.fromarray(part[rows, columns].astype(np.float32))
    if errors.mask_cells:
        cells = crop.resize((errors.mask_cells, errors.mask_cells), Image.Resampling.BILINEAR)
        crop = cells.resize(crop.size, Image.Resampling.BILINEAR)
    mask = np.zeros_like(part)
    mask[rows, columns] = np.asarray(crop) >= 0.5
    return mask if mask.any() else part


def _slipped(extent: slice, slip: NDArray[np.float64], size: int) -> slice:
    low, high = np.round(np.array([extent.start, extent.stop]) + slip * (extent.stop - extent.start)).astype(int)
    low, high = max(int(low), 0), min(int(high), size)
    return slice(low, high) if high > low else extent


def _edged(part: Mask, errors: SegmenterErrors, rng: np.random.Generator) -> Mask:
    """`part` with its edge moved outwards by a bleed of its own, and wavering."""
    if not (errors.bleed_px or errors.bleed_cells or errors.ragged_px):
        return part
    ndimage = require("scipy.ndimage", "sim")
    outside, inside = ndimage.distance_transform_edt(~part), ndimage.distance_transform_edt(part)
    bleed = _mean_bleed(part, errors) * rng.gamma(4.0, 0.25)
    wave = ndimage.gaussian_filter(rng.normal(size=part.shape), WAVE_PX / 2)
    # a sliver is not frayed away
    wave *= min(errors.ragged_px, 0.25 * float(inside.max())) / max(float(wave.std()), 1e-9)
    grown: Mask = np.where(part, inside - 0.5, 0.5 - outside) + bleed + wave >= 0
    return grown if grown.any() else part


def _mean_bleed(part: Mask, errors: SegmenterErrors) -> float:
    rows, columns = _window(part, 0)
    side_px = min(rows.stop - rows.start, columns.stop - columns.start)
    return float(errors.bleed_px + errors.bleed_cells * side_px / NETWORK_CELLS)
