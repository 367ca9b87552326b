"""Numbers of a recording, and the names and colours that annotation contexts give them.

Of files the viewer reads only contexts that hold for all times, while labels mean other objects in every frame that
is not tracked. So a recording remembers what it has named, new names are added to it, and numbers keep their meaning.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls.categories import category_ids
from ldls.errors import LimitError
from ldls.labeling import Labeling
from ldls.palette import BACKGROUND, Colour, as_tuples, category_colour, label_colours
from ldls.segmentation import Segmentation
from ldls.segmentation.segmentation import by_name
from ldls.viewing.recording.stream import Entity, rerun
from ldls.viewing.shown import numbered

OUT_OF_VIEW_COLOUR: Colour = (64, 64, 64)
"""Darker than background: no camera says what these points are."""
OUT_OF_VIEW_ID = 2**16 - 1
"""Keypoint id of points out of view."""
GREATEST_ID = OUT_OF_VIEW_ID - 1
CLEAR = (0, 0, 0, 0)


class Names:
    """Instances that a recording has named below an entity: one for each category, label or track, and shade."""

    def __init__(self) -> None:
        """No names yet."""
        # number on mask images, and name of the category
        self._named: dict[tuple[int, int, Colour], tuple[int, str]] = {}
        self._logged: dict[str, int] = {}
        self._classes: dict[int, str] = {}

    def add(self, result: Segmentation) -> Segmentation:
        """Name the categories and instances of a result; it comes back with the ids that its classes have here.

        Raises:
            LimitError: A category, a label or a track is beyond Rerun's ids, or there are more instances than ids.
        """
        result = by_name(result, self._classes)
        for instance, own in zip(result.instances, result.instance_ids[1:].tolist(), strict=True):
            for kind, number in (("category", instance.category), ("track" if instance.track else "label", own)):
                if not 0 <= number <= GREATEST_ID:
                    raise LimitError(
                        f"{kind} {number}: recordings hold 0 to {GREATEST_ID}; number the categories anew, or leave "
                        "masks out with InstanceMasks.filter"
                    )
        for key, instance in zip(_keys(result), result.instances, strict=True):
            if key not in self._named:
                taken = {0, *(number for number, _ in self._named.values())}
                number = max(taken) + 1 if key[1] in taken else key[1]
                if number > GREATEST_ID:
                    raise LimitError(f"masks: one recording names at most {GREATEST_ID} instances; begin another")
                self._named[key] = number, instance.name
        return result

    def mask_ids(self, result: Segmentation) -> NDArray[np.uint16]:
        """(M + 1,) class id of the masks of each label of a result that was added, 0 for 0.

        It is the label or the track, unless that number was used for another object before.
        """
        return np.array([0, *(self._named[key][0] for key in _keys(result))], np.uint16)

    def log(self, entity: Entity, context: Callable[[], Any]) -> None:
        """Log `of_points` or `of_masks` at an entity, unless it has all these names already."""
        # names are only ever added: as many are the same
        if self._logged.get(entity.path) != len(self._named):
            entity.stream.log_context(entity, context())
            self._logged[entity.path] = len(self._named)

    def of_points(self) -> Any:  # noqa: ANN401
        """The context of points: categories as classes, the instances of each as its keypoints."""
        rr = rerun()
        nothing = [rr.AnnotationInfo(0, "background", BACKGROUND)]
        nothing += [rr.AnnotationInfo(OUT_OF_VIEW_ID, "out of view", OUT_OF_VIEW_COLOUR)]
        classes = [rr.ClassDescription(info=nothing[0], keypoint_annotations=nothing)]
        names: dict[int, str] = {}
        instances: dict[int, dict[int, Any]] = {}
        for (category, label, colour), (_, name) in self._named.items():
            names.setdefault(category, name)
            info = rr.AnnotationInfo(label, numbered(name, label), colour)
            instances.setdefault(category, {}).setdefault(label, info)
        for category, own in instances.items():
            info = rr.AnnotationInfo(category, names[category], category_colour(category))
            classes.append(rr.ClassDescription(info=info, keypoint_annotations=list(own.values())))
        return rr.AnnotationContext(classes)

    def of_masks(self) -> Any:  # noqa: ANN401
        """The context of mask images: instances as classes; 0 is clear, so that the image shows."""
        rr = rerun()
        named = self._named.items()
        infos = [rr.AnnotationInfo(n, numbered(name, label), colour) for (_, label, colour), (n, name) in named]
        return rr.AnnotationContext([rr.AnnotationInfo(0, "background", CLEAR), *infos])


def log_truth_context(entity: Entity, truth: Labeling) -> NDArray[np.uint8]:
    """Log classes of true labels by their numbers; (C, 3) colours, those of the categories of their names."""
    rr = rerun()
    ids, _ = category_ids(dict(enumerate(truth.names)))
    colours = [BACKGROUND, *(category_colour(ids[at]) for at in range(1, len(truth.names)))]
    infos = [rr.AnnotationInfo(at, *info) for at, info in enumerate(zip(truth.names, colours, strict=True))]
    entity.stream.log_context(entity, rr.AnnotationContext(infos))
    return np.array(colours, np.uint8)


def fields_of_points(result: Segmentation, labels: NDArray[np.int32]) -> dict[str, NDArray[Any]]:
    """Colour, class id and keypoint id of points with `labels` (n,), as the archetypes of points take them.

    Class ids are categories, keypoint ids labels or tracks, save that of points out of view.
    """
    out_of_view, inside = labels < 0, np.maximum(labels, 0)
    colours = label_colours(result.instances)[inside]
    colours[out_of_view] = OUT_OF_VIEW_COLOUR
    return {
        "colors": colours,
        "class_ids": np.array([0, *(instance.category for instance in result.instances)], np.uint16)[inside],
        "keypoint_ids": np.where(out_of_view, OUT_OF_VIEW_ID, result.instance_ids[inside]).astype(np.uint16),
    }


def _keys(result: Segmentation) -> list[tuple[int, int, Colour]]:
    categories = [each.category for each in result.instances]
    colours = as_tuples(label_colours(result.instances)[1:])
    return list(zip(categories, result.instance_ids[1:].tolist(), colours, strict=True))
