"""COCO's annotations and results, as parsed JSON.

Ids of annotations only serve messages, so they may repeat; those of images and categories may not. A region of a crowd
(iscrowd 1) is an instance like any other. Source: https://cocodataset.org/#format-data.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any

import numpy as np

import ldls._ldls as _ldls
from ldls.categories import COCO_NAMES, is_object
from ldls.checks import as_python
from ldls.errors import CorruptFileError, LeftOutWarning, MaskError, within
from ldls.masks.instance_mask import InstanceMask
from ldls.masks.pixels import check_same_size, checked_size


def arguments(
    content: object,
    *,
    image_id: int | str | None = None,
    image_size: tuple[int, int] | None = None,
    names: Mapping[int, str] | None = None,
) -> dict[str, Any]:
    """Arguments of `InstanceMasks` from the parsed JSON of a data set or of a bare list of results.

    Annotations of a category that is named background are left out.

    Args:
        content: The parsed JSON.
        image_id: Which image, where there are several.
        image_size: (height, width) in pixels, where the content does not say.
        names: Name of each category id, where the content does not say; COCO's own list without them.

    Raises:
        MaskError: An annotation cannot be used.
        CorruptFileError: It is not COCO's.
    """
    annotations, images, own_names = parts(content)
    names = own_names or names or COCO_NAMES
    image_id = chosen_image(annotations, images, image_id)
    chosen = [a for a in annotations if image_id is None or a.get("image_id") in (None, image_id)]
    no_objects = [category for category, name in names.items() if not is_object(name)]
    chosen = [a for a in chosen if a.get("category_id") not in no_objects]
    drawn = [a for a in chosen if not _is_empty(a.get("segmentation"))]
    if len(drawn) < len(chosen):
        warnings.warn(
            f"{len(chosen) - len(drawn)} of {len(chosen)} annotations have an empty segmentation and are left out; "
            "boxes alone are no masks",
            LeftOutWarning,
            stacklevel=2,
        )
        chosen = drawn
    size = _size_of(images, image_id, chosen, image_size)
    labels = [f"annotation {a.get('id', i)}" for i, a in enumerate(chosen)]
    scores = _scores(labels, chosen)
    return {
        "rles": [_rle(label, a, size) for label, a in zip(labels, chosen, strict=True)],
        "image_size": size,
        "categories": [_category(label, a, names) for label, a in zip(labels, chosen, strict=True)],
        "scores": scores,
        "names": names,
    }


def results(masks: Iterable[InstanceMask], image_size: tuple[int, int], image_id: int) -> list[dict[str, Any]]:
    """One of COCO's results for each mask, as compressed run lengths; boxes are left, top, width, height."""
    return [
        {
            "image_id": image_id,
            "category_id": mask.category,
            "segmentation": {"size": list(image_size), "counts": mask.rle.to_compressed().decode("ascii")},
            "bbox": [mask.bounding_box[i] for i in (1, 0, 3, 2)],
            "area": mask.area,
            "score": mask.score,
        }
        for mask in masks
    ]


def parts(content: object) -> tuple[list[dict[str, Any]], dict[Any, dict[str, Any]], dict[Any, str]]:
    """Annotations, images by id, and category names of a data set or a bare list of results.

    Raises:
        CorruptFileError: It is neither.
    """
    if isinstance(content, list | tuple):
        return records("results", content), {}, {}
    if not isinstance(content, Mapping) or "annotations" not in content:
        raise CorruptFileError("expected COCO's object with images, annotations and categories, or a list of results")
    annotations = records("annotations", content["annotations"])
    images = by_id("images", content.get("images", []), (int, str))
    return annotations, images, category_names(content)


def category_names(content: Mapping[str, Any]) -> dict[int, str]:
    """Name of each category id of a data set; none where it has no table of them.

    Raises:
        CorruptFileError: The table is none.
    """
    categories = by_id("categories", content.get("categories", []), (int,))
    return {i: str(c.get("name", i)) for i, c in categories.items()}


def by_id(name: str, values: object, types: tuple[type, ...]) -> dict[Any, dict[str, Any]]:
    """Records of a list by their id.

    Raises:
        CorruptFileError: It is no list of objects, an id is of none of the types, or two records have the same.
    """
    by_id: dict[Any, dict[str, Any]] = {}
    for i, record in enumerate(records(name, values)):
        key = as_python(record.get("id"))
        if type(key) not in types:
            expected = " or ".join(t.__name__ for t in types)
            raise CorruptFileError(f"{name}[{i}] has id {key!r}, expected {expected}")
        if by_id.setdefault(key, record) != record:
            raise CorruptFileError(f"{name}[{i}] has id {key!r}, which another of {name} has already")
    return by_id


def records(name: str, values: object) -> list[dict[str, Any]]:
    """The `values` of that name, which are a list of objects.

    Raises:
        CorruptFileError: They are not.
    """
    if not isinstance(values, list | tuple) or not all(isinstance(value, dict) for value in values):
        raise CorruptFileError(f"expected {name} to be a list of objects")
    return list(values)


def chosen_image(
    annotations: list[dict[str, Any]],
    images: Mapping[Any, dict[str, Any]],
    image_id: int | str | None,
) -> int | str | None:
    """The image that is chosen, or the only one there is; None where annotations do not say.

    Text chooses the number that reads so where no id is that text.

    Raises:
        MaskError: There is no such image, or several and none was chosen.
        CorruptFileError: An annotation has an id that is none.
    """
    for i, annotation in enumerate(annotations):
        own = as_python(annotation.get("image_id"))
        if type(own) not in (int, str, type(None)):
            raise CorruptFileError(f"annotation {i}: image_id is {own!r}, expected int or str")
        if images and own is not None and own not in images:
            raise MaskError(
                f"annotation {annotation.get('id', i)}: image_id is {own!r}, which no image has; "
                f"found {list(images)[:10]}; mend the id, or leave the annotation out"
            )
    known = list(images) or sorted({a["image_id"] for a in annotations if a.get("image_id") is not None}, key=str)
    if isinstance(image_id, str) and image_id not in known:
        # of a command line, where numbers are text too
        with suppress(ValueError):
            image_id = int(image_id) if int(image_id) in known else image_id
    if image_id is not None and known and image_id not in known:
        raise MaskError(f"no image with id {image_id!r}; found {known[:10]}")
    if image_id is None and len(known) > 1:
        raise MaskError(f"holds {len(known)} images; pass image_id=, one of {known[:10]}")
    return image_id if image_id is not None else next(iter(known), None)


def _is_empty(segmentation: object) -> bool:
    """True for a list of polygons that are all empty, or of none."""
    return isinstance(segmentation, list) and all(isinstance(polygon, list) and not polygon for polygon in segmentation)


def _size_of(
    images: Mapping[Any, dict[str, Any]],
    image_id: int | str | None,
    annotations: list[dict[str, Any]],
    image_size: tuple[int, int] | None,
) -> tuple[int, int]:
    """(height, width) of the image: what its record says, else what is given, else what the first RLE says."""
    known = size_of_record(images.get(image_id, {}), image_size)
    if known is not None:
        return known
    segmentations = (a.get("segmentation") for a in annotations)
    sizes = [s["size"] for s in segmentations if isinstance(s, dict) and "size" in s]
    if not sizes:
        raise MaskError("the image's size is not given; pass image_size=(height, width)")
    return checked_size(sizes[0])


def size_of_record(image: Mapping[str, Any], image_size: tuple[int, int] | None) -> tuple[int, int] | None:
    """(height, width) that the record of an image says, else the given one; None where neither does.

    Raises:
        MaskError: Both do, and differ.
    """
    given = None if image_size is None else checked_size(image_size)
    if image.get("height") is None or image.get("width") is None:
        return given
    own = checked_size((image["height"], image["width"]))
    if given is not None:
        check_same_size(own, given)
    return own


def _rle(label: str, annotation: dict[str, Any], size: tuple[int, int]) -> _ldls.Rle:
    segmentation = annotation.get("segmentation")
    with within(label):
        if isinstance(segmentation, dict):
            return from_rle(segmentation, size)
        if isinstance(segmentation, list):
            return _from_polygons(segmentation, size)
        raise MaskError("no segmentation, expected polygons or RLE; a box alone is no mask")


def from_rle(rle: Mapping[str, Any], image_size: tuple[int, int] | None = None) -> _ldls.Rle:
    """The pixels of COCO's run lengths: `size`, and `counts` as a list or compressed.

    Raises:
        MaskError: Runs that do not sum to height * width, or another size than `image_size`.
    """
    with within("RLE"):
        size = checked_size(rle.get("size"))
    if image_size is not None and size != image_size:
        hint = "; swapped?" if size == image_size[::-1] else ""
        raise MaskError(f"RLE of size {size}, image is {image_size}{hint}")
    counts = rle.get("counts")
    if isinstance(counts, str):
        return _ldls.Rle.from_compressed(*size, counts.encode("utf-8", "replace"))
    if isinstance(counts, bytes):
        return _ldls.Rle.from_compressed(*size, counts)
    if not isinstance(counts, list) or not all(type(c) is int for c in counts):
        raise MaskError("RLE: counts must be a list of whole numbers, or a string")
    wrong = next((i for i, count in enumerate(counts) if not 0 <= count < 2**32), None)
    if wrong is not None:
        raise MaskError(f"RLE: run {wrong} is {counts[wrong]}, expected 0 or more pixels of 32 bits")
    return _ldls.Rle.from_runs(*size, np.array(counts, np.uint32))


def _from_polygons(polygons: list[Any], image_size: tuple[int, int]) -> _ldls.Rle:
    flat = all(isinstance(p, list) and all(_is_number(c) for c in p) for p in polygons)
    if not flat or not polygons:
        raise MaskError("polygons: expected lists of numbers x1, y1, x2, y2, ...")
    return _ldls.Rle.from_polygons(*image_size, polygons)


def _is_number(value: object) -> bool:
    return type(value) in (int, float) or type(as_python(value)) in (int, float)


def _category(label: str, annotation: dict[str, Any], names: Mapping[int, str]) -> int:
    category = as_python(annotation.get("category_id"))
    if category == 0 and type(category) is int:
        raise MaskError(f"{label}: category_id is 0, which stands for background in results; number categories from 1")
    if type(category) is not int or category not in names:
        some = ", ".join(f"{i} {name}" for i, name in list(names.items())[:5])
        raise MaskError(f"{label}: category_id is {category!r}, which is not among the categories ({some}, ...)")
    return category


def _scores(labels: list[str], annotations: list[dict[str, Any]]) -> list[float]:
    """Scores of results; 1 for annotations by hand, which have none."""
    if not any("score" in a for a in annotations):
        return [1.0] * len(annotations)
    for label, annotation in zip(labels, annotations, strict=True):
        score = as_python(annotation.get("score"))
        if type(score) not in (int, float) or not 0 <= score <= 1:
            raise MaskError(f"{label}: score is {score!r}, expected a number from 0 to 1")
    return [float(a["score"]) for a in annotations]
