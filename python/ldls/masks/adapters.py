"""Masks of what other programs return, as arguments of `InstanceMasks`; none of the programs is imported."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import ldls._ldls as _ldls
from ldls.categories import COCO_NAMES, category_ids
from ldls.checks import as_array, numbers, shown
from ldls.errors import MaskError, within
from ldls.masks.coco import from_rle
from ldls.masks.letterbox import Letterbox
from ldls.masks.pixels import checked_size, encode
from ldls.masks.resampling import upsample


def from_torchvision(
    output: Mapping[str, Any], *, threshold: float = 0.5, names: Mapping[int, str] | None = None
) -> dict[str, Any]:
    """Masks of one element of the list that an instance segmentation network of torchvision returns.

    Source: https://docs.pytorch.org/vision/stable/models/generated/torchvision.models.detection.maskrcnn_resnet50_fpn.html

    Args:
        output: `labels` (N,), which are COCO's 91-space ids already, `scores` (N,) and `masks` (N, 1, H, W)
            probabilities.
        threshold: Least probability of a pixel of the object.
        names: Name of each label; COCO's without them.

    Raises:
        MaskError: A part is missing, or of another shape.
    """
    missing = [key for key in ("labels", "scores", "masks") if key not in output]
    if missing:
        raise MaskError(f"output: {missing[0]!r} is missing, found {sorted(output)}; a detector without masks?")
    masks = as_array("masks", to_numpy(output["masks"]), MaskError)
    if masks.ndim != 4 or masks.shape[1] != 1:
        raise MaskError(f"masks: expected (N, 1, height, width), got shape {masks.shape}")
    return {
        "rles": [encode(i, mask[0], threshold) for i, mask in enumerate(masks)],
        "image_size": masks.shape[2:],
        "categories": whole_numbers("labels", output["labels"]),
        "scores": to_numpy(output["scores"]),
        "names": COCO_NAMES if names is None else names,
    }


def from_supervision(
    detections: Any,  # noqa: ANN401
    *,
    names: Mapping[int, str] | None = None,
    image_size: tuple[int, int] | None = None,
) -> dict[str, Any]:
    """Masks of `supervision.Detections`.

    Source: https://supervision.roboflow.com/latest/detection/core/

    Args:
        detections: `mask` (N, H, W), `confidence` (N,) or None, `class_id` (N,) or None, and `data["class_name"]`,
            which does without class ids.
        names: Name of each class id, where `data` does not say; a class without one is called by its number. Without
            class ids it is what keeps the categories of names the same from image to image.
        image_size: (height, width) of the image in pixels; only needed where there may be no detection, and no array of
            masks that has the size.

    Raises:
        MaskError: There are boxes and no masks, or arrays that do not fit one another.
    """
    _check_parts("detections", detections, ("mask", "xyxy", "confidence", "class_id", "data"))
    masks = detections.mask
    if masks is None:
        _check_no_boxes("detections", detections.xyxy)
    pixels = [] if masks is None else [to_numpy(mask) for mask in masks]
    if not pixels and image_size is None:
        image_size = _image_size(masks)
    if not pixels and image_size is None:
        raise MaskError("detections: none, so the image's size is not known; pass image_size=(height, width)")
    rles = [encode(i, mask) for i, mask in enumerate(pixels)]
    classes = _classes(detections, len(rles), names)
    size = (rles[0].height, rles[0].width) if image_size is None else image_size
    return {"rles": rles, "image_size": size, "scores": detections.confidence, **classes}


def _image_size(masks: Any) -> tuple[int, int] | None:  # noqa: ANN401
    """(H, W) of an array (0, H, W); None where there is no such array."""
    shape: tuple[int, ...] = getattr(masks, "shape", ())
    return (shape[1], shape[2]) if len(shape) == 3 and all(shape[1:]) else None


def _classes(detections: Any, count: int, names: Mapping[int, str] | None) -> dict[str, Any]:  # noqa: ANN401
    """Categories and their names; none where there are neither class ids nor names."""
    own = {index: str(name) for index, name in (names or {}).items()}
    class_names = (detections.data or {}).get("class_name")
    if detections.class_id is not None:
        indices = whole_numbers("class_id", detections.class_id)
        if class_names is None:
            class_names = [own.get(index, f"class {index}") for index in indices]
    elif class_names is None:
        return {}
    else:
        indices = _numbered([str(name) for name in class_names], own)
    class_names = [str(name) for name in class_names]
    if not len(indices) == len(class_names) == count:
        raise MaskError(f"detections: {count} masks, {len(indices)} class ids, {len(class_names)} class names")
    by_index = dict(zip(indices, class_names, strict=True))
    for i, (index, name) in enumerate(zip(indices, class_names, strict=True)):
        if index < 0:
            raise MaskError(f"mask {i}: class {index}, expected 0 or more")
        if by_index[index] != name:
            raise MaskError(f"mask {i}: class {index} is {name!r}, elsewhere {by_index[index]!r}; one name a class")
    ids, by_category = category_ids(by_index)
    return {"categories": [ids[index] for index in indices], "names": by_category}


def _numbered(class_names: Sequence[str], names: Mapping[int, str]) -> list[int]:
    """The number of each name: that of `names`, of others one behind these, by the alphabet."""
    numbers = {name: index for index, name in names.items()}
    others = sorted(set(class_names) - numbers.keys())
    numbers |= {name: index for index, name in enumerate(others, start=max(names, default=-1) + 1)}
    return [numbers[name] for name in class_names]


def from_ultralytics(result: Any) -> dict[str, Any]:  # noqa: ANN401
    """Masks of the `Results` of Ultralytics' segmentation networks for one image.

    Source: https://docs.ultralytics.com/reference/engine/results/

    Masks of the image's size, as `retina_masks=True` makes them, are taken as they are. Those of the padded input are
    cut out of it and resampled bilinearly. Outlines alone run through the middles of the outermost cells of the
    network, so that half a cell is lacking all around, and have no holes.

    Args:
        result: `masks` (`data` (N, h, w), or without them `xy`, N outlines in image pixels) or None, `boxes` (`cls`,
            `conf`) or None, for objects of one category, `names` (a list, or by number) and `orig_shape`.

    Raises:
        MaskError: There are boxes and no masks, an index that `names` does not have, or parts that do not fit one
            another.
    """
    _check_parts("result", result, ("masks", "boxes", "names", "orig_shape"))
    size = checked_size(result.orig_shape)
    ids, names = category_ids(_by_number(result.names))
    if result.masks is None:
        _check_no_boxes("result", () if result.boxes is None else result.boxes.cls)
        return {"rles": [], "image_size": size, "categories": [], "scores": [], "names": names}
    if result.boxes is None:
        return {"rles": _ultralytics_rles(result.masks, size), "image_size": size}
    classes = whole_numbers("boxes.cls", result.boxes.cls)
    for i, index in enumerate(classes):
        if index not in ids:
            raise MaskError(f"mask {i}: class {index} has no name; found {len(ids)} names")
    return {
        "rles": _ultralytics_rles(result.masks, size),
        "image_size": size,
        "categories": [ids[index] for index in classes],
        "scores": to_numpy(result.boxes.conf),
        "names": names,
    }


def _by_number(names: Any) -> dict[int, str]:  # noqa: ANN401
    """Class names by their numbers, of a list or a mapping whose keys may be text, as JSON makes them."""
    try:
        listed = dict(enumerate(names)) if isinstance(names, list | tuple) else names
        return {int(number): str(name) for number, name in listed.items()}
    except (AttributeError, TypeError, ValueError):
        raise MaskError(
            f"names: got {shown(names)}, expected class names by their numbers, or a list of them"
        ) from None


def _ultralytics_rles(masks: Any, size: tuple[int, int]) -> list[_ldls.Rle]:  # noqa: ANN401
    if getattr(masks, "data", None) is None:
        return [_from_outline(i, to_numpy(outline), size) for i, outline in enumerate(masks.xy)]
    pixels = to_numpy(masks.data)
    rles = [encode(i, mask) for i, mask in enumerate(pixels)]
    if pixels.shape[1:] == size:
        return rles
    return [_in_image(rle, size) for rle in rles]


def _in_image(rle: _ldls.Rle, size: tuple[int, int]) -> _ldls.Rle:
    """A mask of a network's padded input as one of the image of (height, width) `size`.

    As `scale_masks` of Ultralytics 8.4, and a pixel is in it that is by more than half.
    """
    box = Letterbox.fit(size, (rle.height, rle.width))
    grid = rle.crop(box.top, box.left, *box.scaled_size)
    # all else is zero, and images are large
    rows, columns = (_window(np.flatnonzero(grid.any(axis=1 - axis)), grid.shape[axis], size[axis]) for axis in (0, 1))
    pixels = np.zeros(size, np.bool_)
    pixels[rows, columns] = upsample(grid.astype(np.float32), size, (rows, columns)) > 0.5
    return _ldls.Rle.from_pixels(pixels)


def _window(cells: NDArray[np.int64], source: int, target: int) -> slice:
    """Which of `target` cells depend on `cells`, in ascending order, of `source` that are resampled to as many."""
    if not len(cells):
        return slice(0)
    scale = target / source
    return slice(max(int((cells[0] - 1) * scale) - 1, 0), min(int((cells[-1] + 2) * scale) + 1, target))


def _from_outline(index: int, outline: Any, size: tuple[int, int]) -> _ldls.Rle:  # noqa: ANN401
    if len(outline) < 3:  # of a mask without pixels, or with next to none
        return _ldls.Rle.from_pixels(np.zeros(size, np.bool_))
    with within(f"mask {index}"):
        return _ldls.Rle.from_polygons(*size, [outline.ravel().tolist()])


def from_sam(
    records: Sequence[Mapping[str, Any]],
    *,
    categories: ArrayLike | None = None,
    names: Mapping[int, str] | None = None,
    image_size: tuple[int, int] | None = None,
) -> dict[str, Any]:
    """Masks of the list of records that an automatic mask generator of Segment Anything returns for one image.

    Source: https://github.com/facebookresearch/segment-anything

    Args:
        records: Each with `segmentation`, (H, W) bool or COCO's run lengths, and `predicted_iou`, the score, which may
            lie a little above 1.
        categories: (M,) category ids; without them all are category 1, "object".
        names: Name of each category id.
        image_size: (height, width) of the image in pixels; only needed where there may be no mask.

    Raises:
        MaskError: A record that cannot be used, by its index.
    """
    rles = [_sam_rle(i, record) for i, record in enumerate(records)]
    if not rles and image_size is None:
        raise MaskError("records: none, so the image's size is not known; pass image_size=(height, width)")
    size = (rles[0].height, rles[0].width) if image_size is None else image_size
    ious = numbers("predicted_iou", [record.get("predicted_iou", 1.0) for record in records], np.float32, ("M",))
    scores = np.clip(ious, 0, 1)
    return {"rles": rles, "image_size": size, "categories": categories, "scores": scores, "names": names}


def _sam_rle(index: int, record: Mapping[str, Any]) -> _ldls.Rle:
    if "segmentation" not in record:
        raise MaskError(f"record {index}: 'segmentation' is missing, found {sorted(record)}")
    segmentation = record["segmentation"]
    if not isinstance(segmentation, Mapping):
        return encode(index, to_numpy(segmentation))
    with within(f"record {index}"):
        return from_rle(segmentation)


def _check_no_boxes(name: str, boxes: Any) -> None:  # noqa: ANN401
    """Refuse boxes (N, ...) of a result that has no masks."""
    n_boxes = len(to_numpy(boxes))
    if n_boxes:
        raise MaskError(
            f"{name}: {n_boxes} boxes without masks, expected a result of a network that makes masks; "
            "InstanceMasks.from_boxes takes boxes for masks, and ldls.segmenters.BoxSegmenter does so frame by frame"
        )


def _check_parts(name: str, source: object, parts: Sequence[str]) -> None:
    """Refuse an object of another program that has not the parts that its class has."""
    missing = [part for part in parts if not _has(source, part)]
    if missing:
        raise MaskError(f"{name}: {missing[0]!r} is missing, got {shown(source)}; is it of another class?")


def _has(source: object, part: str) -> bool:
    try:
        return hasattr(source, part)
    except Exception:  # an attribute that cannot be asked for, as `data` of some arrays
        return False


def to_numpy(values: Any) -> NDArray[Any]:  # noqa: ANN401
    """`values`, an array or a tensor on any device, with or without gradient."""
    if not hasattr(values, "detach"):
        return as_array("array", values, MaskError)
    tensor = values.detach().cpu()
    try:
        return np.asarray(tensor.numpy())
    except TypeError:  # bfloat16, which NumPy does not have
        return np.asarray(tensor.float().numpy())


def whole_numbers(name: str, values: Any) -> list[int]:  # noqa: ANN401
    """Class indices, which some programs keep as floats.

    Raises:
        MaskError: One of them is no whole number; the message names its instance.
    """
    array = as_array(name, to_numpy(values), MaskError)
    if array.ndim != 1 or array.dtype.kind not in "iuf":
        raise MaskError(f"{name}: expected one number an instance, got {array.dtype} of shape {array.shape}")
    for i, value in enumerate(array.tolist()):
        if value != value or value % 1 != 0:
            raise MaskError(f"mask {i}: {name} is {value}, expected a whole number")
    return [int(value) for value in array.tolist()]
