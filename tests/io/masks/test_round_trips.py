"""Whatever file masks go through, every pixel, category, score and name comes back."""

from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
import pytest

import ldls
from mask_samples import NAMES, of_coco, random_masks


def all_but_pixels(masks):
    return {"categories": masks.categories, "scores": masks.scores, "names": masks.names}


@dataclass(frozen=True)
class Kind:
    """A kind of file, and what it can keep of masks."""

    name: str
    limit: Any = lambda masks: masks
    save: dict = field(default_factory=dict)
    read: Any = lambda masks: {}


KINDS = {
    "data set": Kind("masks.json"),
    "results": Kind("results.json", save={"results": True}, read=lambda masks: {"names": masks.names}),
    "png": Kind("masks.png", limit=lambda masks: masks.resolve_overlaps()),
    "npz": Kind("masks.npz"),
    "research npz": Kind("research.npz", limit=of_coco, save={"layout": "research"}),
    "npy": Kind("masks.npy", save={"pixels_only": True}, read=all_but_pixels),
}


def through(kind, masks, folder):
    path = folder / kind.name
    ldls.save(masks, path, **kind.save)
    return ldls.read_masks(path, image_size=masks.image_size, **kind.read(masks))


@pytest.mark.parametrize(("first", "second"), list(product(KINDS, KINDS)))
def test_any_two_formats_keep_everything(tmp_path, first, second):
    for seed in range(8):
        masks = KINDS[second].limit(KINDS[first].limit(random_masks(seed)))
        found = masks
        for name in (first, second):
            found = through(KINDS[name], found, tmp_path)
        assert found == masks


@pytest.mark.parametrize("kind", [pytest.param(kind, id=name) for name, kind in KINDS.items()])
def test_no_masks_at_all_come_back(tmp_path, kind):
    none = kind.limit(ldls.InstanceMasks.from_array([], image_size=(4, 5)))
    assert through(kind, none, tmp_path) == none


@pytest.mark.parametrize("count", [255, 256, 300])
def test_numbers_of_instances_do_not_wrap(tmp_path, count):
    pixels = np.zeros((count, 20, 40), bool)
    pixels.reshape(count, -1)[np.arange(count), np.arange(count)] = True
    masks = ldls.InstanceMasks.from_array(pixels, categories=np.full(count, 3), names=NAMES)
    for kind in (KINDS["png"], KINDS["npz"], KINDS["data set"]):
        assert through(kind, masks, tmp_path) == masks
