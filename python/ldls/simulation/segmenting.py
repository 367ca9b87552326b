"""The masks that an image segmenter finds in an image whose truth is known."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ldls._optional import require
from ldls.masks import InstanceMasks
from ldls.simulation.error_model import SegmenterErrors
from ldls.simulation.photograph import PixelTruth
from ldls.simulation.scene_object import BENCH, BICYCLE, BUS, CAR, CHAIR, DOG, MOTORCYCLE, PERSON, POTTED_PLANT, TRUCK

SMALLEST_PX = 40
"""Smaller silhouettes are never found."""
MARGIN_PX = 12
NETWORK_CELLS = 28
WAVE_PX = 6.0
"""An edge wavers over about this many pixels of its length."""
CONFUSED_WITH = {
    PERSON: (DOG, BICYCLE),
    BICYCLE: (MOTORCYCLE, CHAIR),
    CAR: (TRUCK, BUS),
    MOTORCYCLE: (BICYCLE, CAR),
    BUS: (TRUCK, CAR),
    TRUCK: (BUS, CAR),
    BENCH: (CHAIR, BICYCLE),
    DOG: (PERSON, CHAIR),
    CHAIR: (BENCH, POTTED_PLANT),
    POTTED_PLANT: (CHAIR, PERSON),
}
"""The categories that each one is taken for."""


@dataclass(frozen=True, eq=False)
class _Find:
    """One instance as found so far: the part of the object `number` that looks like `category`.

    `part` counts those of an object: a cyclist has two. `visible` is the share of the object that nothing hides.
    """

    number: int
    part: int
    category: int
    mask: NDArray[np.bool_]
    visible: float
    score: float = 1.0


def true_masks(truth: PixelTruth) -> InstanceMasks:
    """Masks of every object that the image shows, in the order of the objects' numbers; a cyclist has two."""
    return _as_masks(_visible(truth, 1), truth)


def segmented(truth: PixelTruth, *, errors: SegmenterErrors | None = None, seed: int = 0) -> InstanceMasks:
    """Masks, categories and scores that a segmenter with `errors` finds; the true ones where all strengths are 0."""
    errors = SegmenterErrors() if errors is None else errors
    if errors == SegmenterErrors.none():
        return true_masks(truth)
    # each error has numbers of its own, so that the strength of one does not change what another does
    missing, merging, naming, inventing = (np.random.default_rng((seed, 2, k)) for k in range(4))
    seen = _visible(truth, SMALLEST_PX)
    found = [f for f, chance in zip(seen, missing.random(len(seen)), strict=True) if chance >= _miss_chance(f, errors)]
    found = [
        replace(f, mask=_drawn(f.mask, errors, np.random.default_rng((seed, 3, f.number, f.part))))
        for f in _merged(found, errors, merging)
    ]
    found = [_named(_scored(f, errors, naming), errors, naming) for f in found]
    found += [_invented(truth, inventing) for _ in range(int(inventing.poisson(errors.invented)))]
    return _as_masks(sorted(found, key=lambda f: -f.score), truth)


def _visible(truth: PixelTruth, smallest_px: int) -> list[_Find]:
    counts = np.bincount(truth.instances.ravel(), minlength=len(truth.expected_px) + 1)[1:]
    shares = np.clip(counts / np.maximum(truth.expected_px, counts).clip(1), 0, 1)
    found = []
    for m in np.flatnonzero(counts).tolist():
        own = truth.instances == m + 1
        for part, category in enumerate(np.unique(truth.categories[own]).tolist()):
            found.append(_Find(m + 1, part, category, own & (truth.categories == category), float(shares[m])))
    return [find for find in found if np.count_nonzero(find.mask) >= smallest_px]


def _miss_chance(find: _Find, errors: SegmenterErrors) -> float:
    hidden = 1 + 2 * (1 - find.visible)
    small = 1 + 5 * float(np.exp(-np.count_nonzero(find.mask) / 300))
    return float(min(errors.missed * hidden * small, 0.95))


def _merged(found: list[_Find], errors: SegmenterErrors, rng: np.random.Generator) -> list[_Find]:
    kept: list[_Find] = []
    for one in found:
        others = [k for k, o in enumerate(kept) if o.category == one.category and _meet(o.mask, one.mask)]
        if others and rng.random() < errors.merged:
            host = kept[others[0]]
            kept[others[0]] = replace(host, mask=host.mask | one.mask)
        else:
            kept.append(one)
    return kept


def _meet(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> bool:
    """True where the boxes of two masks overlap or touch."""
    pairs = zip(_window(one, 0), _window(other, 0), strict=True)
    return all(a.start <= b.stop + 1 and b.start <= a.stop + 1 for a, b in pairs)


def _scored(find: _Find, errors: SegmenterErrors, rng: np.random.Generator) -> _Find:
    noise = abs(rng.normal())
    if errors.score_noise == 0:
        return find
    small = 0.25 * np.exp(-np.count_nonzero(find.mask) / 600) + 0.15 * (1 - find.visible)
    return replace(find, score=float(np.clip(0.99 - small - errors.score_noise * noise, 0.3, 1)))


def _named(find: _Find, errors: SegmenterErrors, rng: np.random.Generator) -> _Find:
    chance, choice = rng.random(2)
    if chance >= errors.wrong_class:
        return find
    others = CONFUSED_WITH[find.category]
    return replace(find, category=others[int(choice * len(others))], score=0.8 * find.score)


def _invented(truth: PixelTruth, rng: np.random.Generator) -> _Find:
    """Something that is not there: a blob in the lower part of the image."""
    height, width = truth.instances.shape
    v, u = np.ogrid[:height, :width]
    row, column = rng.uniform(0.35, 0.75) * height, rng.uniform(0, 1) * width
    tall, wide = rng.uniform(0.03, 0.12) * height, rng.uniform(0.02, 0.12) * height
    blob = ((v - row) / tall) ** 2 + ((u - column) / wide) ** 2 <= 1
    categories = list(CONFUSED_WITH)
    return _Find(0, 0, categories[int(rng.integers(len(categories)))], blob, 1.0, float(rng.uniform(0.3, 0.65)))


def _drawn(silhouette: NDArray[np.bool_], errors: SegmenterErrors, rng: np.random.Generator) -> NDArray[np.bool_]:
    """(H, W) mask that a network draws of `silhouette`; the same where all strengths are 0."""
    window = _window(silhouette, MARGIN_PX + int(2 * _mean_bleed(silhouette, errors)))
    part = silhouette[window]
    cells = _on_cells(part, errors, rng) if errors.mask_cells or errors.box_slip else part
    mask = np.zeros_like(silhouette)
    mask[window] = _edged(cells, errors, rng)
    return mask


def _window(mask: NDArray[np.bool_], margin_px: int) -> tuple[slice, slice]:
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    return (
        slice(max(rows[0] - margin_px, 0), rows[-1] + 1 + margin_px),
        slice(max(columns[0] - margin_px, 0), columns[-1] + 1 + margin_px),
    )


def _on_cells(part: NDArray[np.bool_], errors: SegmenterErrors, rng: np.random.Generator) -> NDArray[np.bool_]:
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


def _edged(part: NDArray[np.bool_], errors: SegmenterErrors, rng: np.random.Generator) -> NDArray[np.bool_]:
    """`part` with its edge moved outwards by a bleed of its own, and wavering."""
    if not (errors.bleed_px or errors.bleed_cells or errors.ragged_px):
        return part
    ndimage = require("scipy.ndimage", "sim")
    outside, inside = ndimage.distance_transform_edt(~part), ndimage.distance_transform_edt(part)
    bleed = _mean_bleed(part, errors) * rng.gamma(4.0, 0.25)
    wave = ndimage.gaussian_filter(rng.normal(size=part.shape), WAVE_PX / 2)
    # a sliver is not frayed away
    wave *= min(errors.ragged_px, 0.25 * float(inside.max())) / max(float(wave.std()), 1e-9)
    grown: NDArray[np.bool_] = np.where(part, inside - 0.5, 0.5 - outside) + bleed + wave >= 0
    return grown if grown.any() else part


def _mean_bleed(part: NDArray[np.bool_], errors: SegmenterErrors) -> float:
    rows, columns = _window(part, 0)
    side_px = min(rows.stop - rows.start, columns.stop - columns.start)
    return float(errors.bleed_px + errors.bleed_cells * side_px / NETWORK_CELLS)


def _as_masks(found: list[_Find], truth: PixelTruth) -> InstanceMasks:
    categories: NDArray[np.int32] = np.array([f.category for f in found], np.int32)
    scores = np.array([f.score for f in found], np.float32)
    size = (truth.instances.shape[0], truth.instances.shape[1])
    return InstanceMasks.from_array([f.mask for f in found], categories=categories, scores=scores, image_size=size)
