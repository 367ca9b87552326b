"""COCO JSON: data set files, and bare lists of results."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np

from ldls import _ldls
from ldls.categories import COCO_NAMES
from ldls.errors import CorruptFileError, LimitError, MaskError
from ldls.io.masks.records import MaskRecords

MAX_FILE_BYTES = 1 << 30
"""Larger files hold whole data sets; parsed, they take many times their size in memory."""


def read(
    source: str | PathLike[str] | Mapping[str, Any] | Sequence[Mapping[str, Any]],
    *,
    image_id: int | str | None = None,
    image_size: tuple[int, int] | None = None,
) -> MaskRecords:
    """The instances of one image of a COCO file or of its parsed content.

    Raises:
        MaskError: An annotation cannot be used.
        CorruptFileError: The file is not JSON, or not COCO's.
    """
    if isinstance(source, str | PathLike):
        place, document = fspath(source), _load(Path(source))
    else:
        place, document = "masks", source
    annotations, images, names = _parts(place, document)
    image_id = _choose_image(place, annotations, images, image_id)
    chosen = [a for a in annotations if image_id is None or a.get("image_id", image_id) == image_id]
    size = image_size or _size_of(place, images, image_id, chosen)
    labels = [f"{place}: annotation {a.get('id', i)}" for i, a in enumerate(chosen)]
    scores = _scores(labels, chosen)
    return MaskRecords(
        size=size,
        rles=[_rle(label, a, size) for label, a in zip(labels, chosen, strict=True)],
        categories=[_category(label, a, names) for label, a in zip(labels, chosen, strict=True)],
        scores=scores,
        names=names,
    )


def _load(path: Path) -> object:
    if path.stat().st_size > MAX_FILE_BYTES:
        raise LimitError(f"{path}: over {MAX_FILE_BYTES} bytes; split it by image")
    try:
        return json.loads(path.read_bytes(), parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise CorruptFileError(f"{path}: not valid JSON ({error})") from None


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is no JSON number")


def _parts(place: str, document: object) -> tuple[list[dict[str, Any]], dict[Any, dict[str, Any]], Mapping[int, str]]:
    """Annotations, images by id, and category names of a data set or a bare list of results."""
    if isinstance(document, list):
        return _records(place, "results", document), {}, COCO_NAMES
    if not isinstance(document, Mapping) or "annotations" not in document:
        raise CorruptFileError(
            f"{place}: expected COCO's object with images, annotations and categories, or a list of results"
        )
    annotations = _records(place, "annotations", document["annotations"])
    images = {i.get("id"): i for i in _records(place, "images", document.get("images", []))}
    categories = _records(place, "categories", document.get("categories", []))
    names: dict[Any, str] = {c.get("id"): str(c.get("name", c.get("id"))) for c in categories}
    return annotations, images, names or COCO_NAMES


def _records(place: str, name: str, values: object) -> list[dict[str, Any]]:
    if not isinstance(values, list) or not all(isinstance(value, dict) for value in values):
        raise CorruptFileError(f"{place}: expected {name} to be a list of objects")
    return values


def _choose_image(
    place: str,
    annotations: list[dict[str, Any]],
    images: Mapping[Any, dict[str, Any]],
    image_id: int | str | None,
) -> int | str | None:
    known = list(images) or sorted({a["image_id"] for a in annotations if "image_id" in a}, key=str)
    if image_id is not None and known and image_id not in known:
        raise MaskError(f"{place}: no image with id {image_id!r}; found {known[:10]}")
    if image_id is None and len(known) > 1:
        raise MaskError(f"{place}: holds {len(known)} images; pass image_id=, one of {known[:10]}")
    return image_id if image_id is not None else next(iter(known), None)


def _size_of(
    place: str,
    images: Mapping[Any, dict[str, Any]],
    image_id: int | str | None,
    annotations: list[dict[str, Any]],
) -> tuple[int, int]:
    image = images.get(image_id, {})
    found = [image.get("height"), image.get("width")]
    if None in found:
        sizes = (a["segmentation"] for a in annotations if isinstance(a.get("segmentation"), dict))
        found = next((s["size"] for s in sizes if "size" in s), found)
    if None in found:
        raise MaskError(f"{place}: the image's size is not given; pass image_size=(height, width)")
    return _checked_size(place, found)


def _checked_size(place: str, size: object) -> tuple[int, int]:
    whole = isinstance(size, list | tuple) and len(size) == 2 and all(type(s) is int for s in size)
    if not whole or not all(0 < s < 2**31 for s in size):  # type: ignore[attr-defined]
        raise MaskError(f"{place}: size is {size!r}, expected [height, width] in whole pixels")
    return size[0], size[1]  # type: ignore[index]


def _rle(place: str, annotation: dict[str, Any], size: tuple[int, int]) -> _ldls.Rle:
    segmentation = annotation.get("segmentation")
    try:
        if isinstance(segmentation, dict):
            return _from_rle(segmentation, size)
        if isinstance(segmentation, list):
            return _from_polygons(segmentation, size)
    except MaskError as error:
        raise MaskError(f"{place}: {error}") from None
    raise MaskError(f"{place}: no segmentation, expected polygons or RLE; a box alone is no mask")


def _from_rle(rle: dict[str, Any], image_size: tuple[int, int]) -> _ldls.Rle:
    size = _checked_size("RLE", rle.get("size"))
    if size != image_size:
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
    flat = all(isinstance(p, list) and all(type(c) in (int, float) for c in p) for p in polygons)
    if not flat or not polygons:
        raise MaskError("polygons: expected lists of numbers x1, y1, x2, y2, ...")
    return _ldls.Rle.from_polygons(*image_size, polygons)


def _category(place: str, annotation: dict[str, Any], names: Mapping[int, str]) -> int:
    category = annotation.get("category_id")
    if type(category) is not int or category not in names:
        some = ", ".join(f"{i} {name}" for i, name in list(names.items())[:5])
        raise MaskError(f"{place}: category_id is {category!r}, which is not among the categories ({some}, ...)")
    return category


def _scores(labels: list[str], annotations: list[dict[str, Any]]) -> list[float]:
    """Scores of results; 1 for annotations by hand, which have none."""
    if not any("score" in a for a in annotations):
        return [1.0] * len(annotations)
    for label, annotation in zip(labels, annotations, strict=True):
        score = annotation.get("score")
        if type(score) not in (int, float) or not 0 <= score <= 1:  # type: ignore[operator]
            raise MaskError(f"{label}: score is {score!r}, expected a number from 0 to 1")
    return [float(a["score"]) for a in annotations]
