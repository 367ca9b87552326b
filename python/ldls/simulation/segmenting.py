"""What an image segmenter finds in an image whose truth is known."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ldls.masks import InstanceMasks
from ldls.simulation import objects
from ldls.simulation.errors import SegmenterErrors
from ldls.simulation.outlines import Mask, drawn
from ldls.simulation.photograph import PixelTruth

SMALLEST_PX = 40
"""Smaller silhouettes are never found."""
CONFUSED_WITH = {
    objects.PERSON: (objects.DOG, objects.BICYCLE),
    objects.BICYCLE: (objects.MOTORCYCLE, objects.CHAIR),
    objects.CAR: (objects.TRUCK, objects.BUS),
    objects.MOTORCYCLE: (objects.BICYCLE, objects.CAR),
    objects.BUS: (objects.TRUCK, objects.CAR),
    objects.TRUCK: (objects.BUS, objects.CAR),
    objects.BENCH: (objects.CHAIR, objects.BICYCLE),
    objects.DOG: (objects.PERSON, objects.CHAIR),
    objects.CHAIR: (objects.BENCH, objects.POTTED_PLANT),
    objects.POTTED_PLANT: (objects.CHAIR, objects.PERSON),
}
"""What each category is taken for."""


@dataclass(frozen=True, eq=False)
class _Find:
    """One instance as found so far, of the object `number`; `visible` is the share of it that nothing hides."""

    number: int
    category: int
    mask: Mask
    visible: float
    score: float = 1.0


def true_masks(truth: PixelTruth) -> InstanceMasks:
    """Masks of every object that the image shows, in the order of the objects' numbers."""
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
        replace(f, mask=drawn(f.mask, errors, np.random.default_rng((seed, 3, f.number))))
        for f in _merged(found, errors, merging)
    ]
    found = [_named(_scored(f, errors, naming), errors, naming) for f in found]
    found += [_invented(truth, inventing) for _ in range(int(inventing.poisson(errors.invented)))]
    return _as_masks(sorted(found, key=lambda f: -f.score), truth)


def _visible(truth: PixelTruth, smallest_px: int) -> list[_Find]:
    counts = np.bincount(truth.instances.ravel(), minlength=len(truth.categories) + 1)[1:]
    shares = np.clip(counts / np.maximum(truth.expected_px, counts).clip(1), 0, 1)
    return [
        _Find(m + 1, int(truth.categories[m]), truth.instances == m + 1, float(shares[m]))
        for m in np.flatnonzero(counts >= smallest_px).tolist()
    ]


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


def _meet(one: Mask, other: Mask) -> bool:
    """Whether the boxes of two masks overlap or touch."""
    spans = [
        [(np.flatnonzero(mask.any(axis=axis))[0], np.flatnonzero(mask.any(axis=axis))[-1]) for axis in (1, 0)]
        for mask in (one, other)
    ]
    return all(a[0] <= b[1] + 2 and b[0] <= a[1] + 2 for a, b in zip(*spans, strict=True))


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
    return _Find(0, categories[int(rng.integers(len(categories)))], blob, 1.0, float(rng.uniform(0.3, 0.65)))


def _as_masks(found: list[_Find], truth: PixelTruth) -> InstanceMasks:
    categories: NDArray[np.int32] = np.array([f.category for f in found], np.int32)
    scores = np.array([f.score for f in found], np.float32)
    size = (truth.instances.shape[0], truth.instances.shape[1])
    return InstanceMasks.from_array([f.mask for f in found], categories=categories, scores=scores, image_size=size)
