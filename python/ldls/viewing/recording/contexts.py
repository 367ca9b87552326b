"""Annotation contexts: which name and colour a number has.

Of files the viewer reads contexts that hold for all times only, while labels mean other objects in every frame. So what
a recording has named is remembered, new names are added to it, and numbers keep their meaning.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls.categories import category_ids
from ldls.errors import LimitError
from ldls.labeling import Labeling
from ldls.palette import BACKGROUND, Colour, category_colour
from ldls.segmentation import Instance, Segmentation
from ldls.viewing.recording.colours import GREATEST_ID, OUT_OF_VIEW_COLOUR, OUT_OF_VIEW_ID, label_colours
from ldls.viewing.recording.keeping import log_context
from ldls.viewing.recording.stream import Entity, rerun

CLEAR = (0, 0, 0, 0)
RECORDINGS = 64
"""Recordings whose names are remembered at a time."""


class Names:
    """Categories and instances that a recording has named below an entity."""

    def __init__(self) -> None:
        """No names yet."""
        self._categories: dict[int, str] = {}
        self._instances: dict[tuple[int, int], tuple[str, Colour]] = {}
        self._mask_ids: dict[tuple[int, int, Colour], int] = {}

    def __len__(self) -> int:
        """How many there are; it only grows."""
        return len(self._categories) + len(self._instances) + len(self._mask_ids)

    def add(self, result: Segmentation) -> None:
        """Name the categories and instances of a result.

        Raises:
            LimitError: There are more than Rerun has numbers for.
        """
        for instance, colour in _coloured(result):
            self._categories.setdefault(instance.category, instance.name)
            name = f"{instance.name} {instance.label}"
            self._instances.setdefault((instance.category, instance.label), (name, colour))
            self._number(instance, colour)

    def mask_ids(self, result: Segmentation) -> NDArray[np.uint16]:
        """(M + 1,) class id of the masks of each label of a result that was added, 0 for 0.

        It is the label, unless an earlier frame used that number for another object.
        """
        ids = [self._mask_ids[i.label, i.category, colour] for i, colour in _coloured(result)]
        return np.array([0, *ids], np.uint16)

    def of_points(self) -> Any:  # noqa: ANN401
        """The context of points: categories as classes, the instances of each as its keypoints."""
        rr = rerun()
        nothing = [rr.AnnotationInfo(0, "background", BACKGROUND)]
        nothing += [rr.AnnotationInfo(OUT_OF_VIEW_ID, "out of view", OUT_OF_VIEW_COLOUR)]
        classes = [rr.ClassDescription(info=nothing[0], keypoint_annotations=nothing)]
        for category, name in self._categories.items():
            own = [rr.AnnotationInfo(m, *found) for (of, m), found in self._instances.items() if of == category]
            info = rr.AnnotationInfo(category, name, category_colour(category))
            classes.append(rr.ClassDescription(info=info, keypoint_annotations=own))
        return rr.AnnotationContext(classes)

    def of_masks(self) -> Any:  # noqa: ANN401
        """The context of mask images: instances as classes; 0 is clear, so that the image shows."""
        rr = rerun()
        found = [
            rr.AnnotationInfo(number, self._instances[category, label][0], colour)
            for (label, category, colour), number in self._mask_ids.items()
        ]
        return rr.AnnotationContext([rr.AnnotationInfo(0, "background", CLEAR), *found])

    def _number(self, instance: Instance, colour: Colour) -> None:
        key = (instance.label, instance.category, colour)
        if key in self._mask_ids:
            return
        taken = set(self._mask_ids.values())
        number = instance.label if instance.label not in taken else max(taken) + 1
        if number > GREATEST_ID:
            raise LimitError(f"masks: one recording names at most {GREATEST_ID} instances; begin another")
        self._mask_ids[key] = number


@lru_cache(maxsize=RECORDINGS)
def names_in(recording_id: str, path: str) -> Names:
    """What a recording has named below a path."""
    return Names()


def log_names(root: Entity, result: Segmentation) -> tuple[Names, bool]:
    """Name what a result has; the names, and whether there are new ones."""
    names = names_in(root.recording_id, root.path)
    before = len(names)
    names.add(result)
    grown = len(names) > before or not before
    if grown:
        log_context(root, names.of_points())
    return names, grown


def of_truth(truth: Labeling) -> Any:  # noqa: ANN401
    """Classes of true labels by their numbers, in the colours of the categories of their names."""
    rr = rerun()
    infos = zip(truth.names, truth_colours(truth), strict=True)
    return rr.AnnotationContext([rr.AnnotationInfo(at, *info) for at, info in enumerate(infos)])


def truth_colours(truth: Labeling) -> list[Colour]:
    """Colour of each class of true labels; that of the category of its name, background first."""
    ids, _ = category_ids(dict(enumerate(truth.names)))
    return [BACKGROUND, *(category_colour(ids[at]) for at in range(1, len(truth.names)))]


def _coloured(result: Segmentation) -> list[tuple[Instance, Colour]]:
    colours = label_colours(result)
    return [(instance, tuple(colours[instance.label].tolist())) for instance in result.instances]
