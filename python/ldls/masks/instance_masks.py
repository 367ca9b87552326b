"""Instance masks of one image, kept as run lengths."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence, Sized
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

import ldls._ldls as _ldls
from ldls.by_value import same
from ldls.categories import COCO_NAMES, find_categories, is_object
from ldls.checks import as_array, as_python, checked, numbers, shown, whole_number
from ldls.errors import InputError, LimitError, MaskError, ParameterError, within
from ldls.masks import adapters, coco, instance_image
from ldls.masks.instance_mask import InstanceMask
from ldls.masks.pixels import checked_size, encode, rectangles, uncovered

MAX_INSTANCES = 65_535
"""Most masks of an image: labels of pixels have 16 bits."""
STRIP = 4
"""An array whose last axis is so many times shorter than the others is taken for (H, W, M)."""
LEAST_SIDE = 100
"""Images are larger, in pixels, where nobody says which axis counts the masks."""
TEXT_KINDS = "OTU"
"""NumPy's kinds of arrays that may hold text."""
MAX_RADIUS = 10_000
"""Farthest that masks grow or shrink, in pixels."""


class InstanceMasks:
    """Instance masks of one image with category, score and name; instance m is `masks[m - 1]`.

    Masks are kept as run lengths, so memory grows with their outlines and not with the image. They may overlap: a
    pixel counts for every mask that covers it.

    Attributes:
        categories: (M,) int32 category ids.
        scores: (M,) float32 scores, 0 to 1.
        names: Name of each category id.
    """

    @checked
    def __init__(
        self,
        rles: Sequence[_ldls.Rle],
        image_size: tuple[int, int],
        *,
        categories: ArrayLike | None = None,
        scores: ArrayLike | None = None,
        names: Mapping[int, str] | None = None,
    ) -> None:
        """Masks from run lengths; `from_...` make them from arrays and other programs, `ldls.read_masks` from files."""
        height, width = checked_size(image_size)
        self.core = _ldls.Masks(height, width, list(rles))
        if categories is None:
            categories, names = np.ones(len(rles), np.int32), names or {1: "object"}
        given = COCO_NAMES if names is None else names
        # those of NumPy become Python's own
        self.names = {int(category): as_python(name) for category, name in given.items()}
        self.categories = _per_mask("categories", _ids(categories, self.names), len(rles), np.int32)
        self.scores = _per_mask("scores", 1.0 if scores is None else scores, len(rles), np.float32)
        self._check()

    @classmethod
    @checked
    def from_array(
        cls,
        masks: ArrayLike | Iterable[ArrayLike],
        *,
        categories: ArrayLike | None = None,
        scores: ArrayLike | None = None,
        names: Mapping[int, str] | None = None,
        image_size: tuple[int, int] | None = None,
        instance_axis: int | None = None,
    ) -> Self:
        """Masks from pixels.

        Args:
            masks: (M, H, W) array, or M arrays of (H, W): bool, 0 and 1, 0 and 255, or probabilities (at least 0.5
                is the object).
            categories: (M,) category ids, or names; without them all are category 1, "object".
            scores: (M,) scores from 0 to 1; all 1 without them.
            names: Name of each category id; COCO's 91-entry list without them.
            image_size: (H, W) of the image; only needed where M may be 0.
            instance_axis: The axis of an array that counts the masks: 0, the default, or -1 for (H, W, M). An array
                that looks like (H, W, M) is refused without it.

        Raises:
            MaskError: Masks of different sizes, values that are no mask, an unknown category id or a bad score.
            ParameterError: A name among `categories` that no id has.
        """
        rles = [encode(i, mask) for i, mask in enumerate(_one_by_one(masks, instance_axis))]
        if image_size is None:
            image_size = _image_size(masks, rles)
        return cls(rles, image_size, categories=categories, scores=scores, names=names)

    @classmethod
    @checked
    def from_coco(
        cls,
        content: Mapping[str, Any] | Sequence[Mapping[str, Any]],
        *,
        image_id: int | str | None = None,
        image_size: tuple[int, int] | None = None,
        names: Mapping[int, str] | None = None,
    ) -> Self:
        """Masks from parsed COCO JSON: a data set, or a bare list of results.

        Polygons and both kinds of RLE are understood; polygons cover the pixels that the COCO tools give them.

        Args:
            content: The parsed JSON; `ldls.read_masks` reads files.
            image_id: Which image, where there are several.
            image_size: (height, width) in pixels, where the content does not say.
            names: Name of each category id, where the content does not say; COCO's own list without them.

        Raises:
            MaskError: An annotation that cannot be used, by its id: runs that do not sum to height * width, another
                size than the image, an unknown category, a bad score.
            CorruptFileError: It is not COCO's.
        """
        with within("masks"):
            return cls(**coco.arguments(content, image_id=image_id, image_size=image_size, names=names))

    @classmethod
    @checked
    def from_instance_image(
        cls,
        image: ArrayLike,
        *,
        categories: ArrayLike | None = None,
        scores: ArrayLike | None = None,
        names: Mapping[int, str] | None = None,
        class_divisor: int | None = None,
    ) -> Self:
        """Masks from (H, W) whole numbers, in ascending order of the numbers; see `instance_image.arguments`."""
        arguments = instance_image.arguments(
            image, categories=categories, scores=scores, names=names, class_divisor=class_divisor
        )
        return cls._named("instance image", arguments)

    @classmethod
    @checked
    def from_boxes(
        cls,
        boxes: ArrayLike,
        image_size: tuple[int, int],
        *,
        categories: ArrayLike | None = None,
        scores: ArrayLike | None = None,
        names: Mapping[int, str] | None = None,
    ) -> Self:
        """Rectangular masks from (M, 4) left, top, right, bottom in pixels.

        A mask has the pixels whose centres, at whole numbers, lie within the box; outside the image there are none.

        Raises:
            MaskError: A box that is none, an unknown category id or a bad score.
            ParameterError: A name among `categories` that no id has.
        """
        rles = rectangles(adapters.to_numpy(boxes), image_size)
        return cls(rles, image_size, categories=categories, scores=scores, names=names)

    @classmethod
    @checked
    def from_torchvision(
        cls, output: Mapping[str, Any], *, threshold: float = 0.5, names: Mapping[int, str] | None = None
    ) -> Self:
        """Masks from what a torchvision network returns for one image; see `adapters.from_torchvision`."""
        return cls._named("torchvision output", adapters.from_torchvision(output, threshold=threshold, names=names))

    @classmethod
    @checked
    def from_supervision(
        cls,
        detections: Any,  # noqa: ANN401
        *,
        names: Mapping[int, str] | None = None,
        image_size: tuple[int, int] | None = None,
    ) -> Self:
        """Masks from `supervision.Detections`; see `adapters.from_supervision`."""
        return cls._named("detections", adapters.from_supervision(detections, names=names, image_size=image_size))

    @classmethod
    @checked
    def from_ultralytics(cls, result: Any) -> Self:  # noqa: ANN401
        """Masks from Ultralytics' `Results` of one image; see `adapters.from_ultralytics`."""
        return cls._named("result", adapters.from_ultralytics(result))

    @classmethod
    @checked
    def from_sam(
        cls,
        records: Sequence[Mapping[str, Any]],
        *,
        categories: ArrayLike | None = None,
        names: Mapping[int, str] | None = None,
        image_size: tuple[int, int] | None = None,
    ) -> Self:
        """Masks from the list that a mask generator of Segment Anything returns; see `adapters.from_sam`."""
        arguments = adapters.from_sam(records, categories=categories, names=names, image_size=image_size)
        return cls._named("records", arguments)

    @property
    def height(self) -> int:
        """Rows of the image."""
        return self.core.height

    @property
    def width(self) -> int:
        """Columns of the image."""
        return self.core.width

    @property
    def image_size(self) -> tuple[int, int]:
        """(height, width) of the image in pixels."""
        return self.height, self.width

    def __eq__(self, other: object) -> bool:
        """True for masks of the same pixels, categories, scores and names."""
        if type(other) is not type(self):
            return NotImplemented
        return all(same(value, getattr(other, name)) for name, value in vars(self).items())

    def __hash__(self) -> int:
        return hash((type(self), self.image_size, len(self)))

    def __len__(self) -> int:
        return len(self.core)

    @checked
    def __getitem__(self, index: int) -> InstanceMask:
        category = int(self.categories[index])  # an index out of range raises here
        rle = self.core.rle(index % len(self))
        return InstanceMask(category, self.names[category], float(self.scores[index]), rle)

    def __iter__(self) -> Iterator[InstanceMask]:
        return (self[i] for i in range(len(self)))

    def __repr__(self) -> str:
        return f"InstanceMasks({len(self)} instances in {self.height} x {self.width} pixels)"

    def to_array(self) -> NDArray[np.bool_]:
        """(M, H, W) pixels; M * H * W bytes."""
        pixels = np.zeros((len(self), self.height, self.width), np.bool_)
        self.core.paint(pixels, None)
        return pixels

    def to_instance_image(self) -> NDArray[np.uint8] | NDArray[np.uint16]:
        """(H, W) numbers, m + 1 on the pixels of mask m and 0 elsewhere: uint8 up to 255 masks, else uint16.

        Raises:
            MaskError: Two masks share a pixel; `resolve_overlaps` leaves it to one.
        """
        return instance_image.join([mask.rle for mask in self], self.image_size)

    @checked
    def to_coco(self, *, image_id: int = 1, file_name: str | None = None) -> dict[str, Any]:
        """COCO's data set of this one image, with compressed run lengths; its `annotations` are results as well."""
        image_id = as_python(image_id)
        image: dict[str, Any] = {"id": image_id, "height": self.height, "width": self.width}
        if file_name is not None:
            image["file_name"] = file_name
        results = coco.results(self, self.image_size, image_id)
        return {
            "images": [image],
            "categories": [{"id": category, "name": name} for category, name in self.names.items()],
            "annotations": [{"id": i, "iscrowd": 0, **result} for i, result in enumerate(results, start=1)],
        }

    @checked
    def select(self, indices: ArrayLike) -> Self:
        """The masks at `indices`, whole numbers or one bool a mask, in that order."""
        chosen = np.arange(len(self))[_as_index(indices, len(self))]
        return self._with([self.core.rle(int(i)) for i in chosen], chosen)

    @checked
    def filter(
        self,
        *,
        min_score: float = 0.0,
        categories: Iterable[int | str] | None = None,
        min_area: int = 0,
    ) -> Self:
        """The masks that are wanted, in their order.

        Args:
            min_score: Lowest score that is kept, 0 to 1.
            categories: Ids or names of the categories that are kept; all without them.
            min_area: Fewest pixels that are kept.

        Raises:
            ParameterError: A bound outside its range, or a category that `names` does not have.
        """
        if not 0 <= min_score <= 1:
            raise ParameterError(f"min_score: got {min_score!r}, expected 0 to 1")
        kept = self.scores >= np.float32(min_score)
        if categories is not None:
            kept &= np.isin(self.categories, find_categories(categories, self.names))
        if min_area > 0:
            kept &= np.array(self.core.areas()) >= min_area
        return self if kept.all() else self.select(kept)

    @checked
    def resolve_overlaps(self, by: Literal["score", "area", "order"] = "score") -> Self:
        """These masks, each pixel left to one of them; a mask may become empty.

        Args:
            by: Who keeps a pixel: the highest "score", the smallest "area" (what lies in front is often smaller), or
                the first in "order". The first also wins where scores or areas are equal.

        Raises:
            ParameterError: `by` is none of these.
        """
        keys = {
            "score": -self.scores,
            "area": np.array(self.core.areas()),
            "order": np.arange(len(self)),
        }
        return self._with(uncovered([mask.rle for mask in self], np.argsort(keys[by], kind="stable")))

    @checked
    def grow(self, radius: int) -> Self:
        """These masks with every pixel at most `radius` pixels from them, centre to centre."""
        pixels = whole_number("radius", radius, 0, MAX_RADIUS)
        return self._with([mask.rle.grow(pixels) for mask in self])

    @checked
    def shrink(self, radius: int) -> Self:
        """These masks without the pixels at most `radius` pixels from what is beside them; a mask may become empty.

        Masks of networks bleed over edges; points behind an object then fall on its mask. At the edge of the image
        nothing is taken away.
        """
        pixels = whole_number("radius", radius, 0, MAX_RADIUS)
        return self._with([mask.rle.shrink(pixels) for mask in self])

    def _with(self, rles: Sequence[_ldls.Rle], chosen: Any = ...) -> Self:  # noqa: ANN401
        return type(self)(
            rles,
            self.image_size,
            categories=self.categories[chosen],
            scores=self.scores[chosen],
            names=self.names,
        )

    @classmethod
    def _named(cls, source: str, arguments: Mapping[str, Any]) -> Self:
        """Masks from arguments of which errors name the source."""
        with within(source):
            return cls(**arguments)

    def _check(self) -> None:
        for i, (category, score) in enumerate(zip(self.categories, self.scores, strict=True)):
            if category < 1:
                raise MaskError(
                    f"mask {i}: category is {category}, expected 1 or more, for 0 stands for background in results; "
                    "pass the name of each class for categories, or number them from 1"
                )
            if int(category) not in self.names:
                raise MaskError(
                    f"mask {i}: category {category} is unknown; expected one of "
                    f"{_some(self.names)}, or pass names={{{category}: '...'}}"
                )
            name = self.names[int(category)]
            if not is_object(name):
                raise MaskError(
                    f"mask {i}: category {category} is named {name!r}, expected the name of a class of objects, for "
                    "what is none has no mask; leave the mask out, or name its category otherwise"
                )
            if not 0 <= score <= 1:
                raise MaskError(f"mask {i}: score is {score}, expected 0 to 1")


def _image_size(masks: object, rles: Sequence[_ldls.Rle]) -> tuple[int, int]:
    if rles:
        return rles[0].height, rles[0].width
    shape: tuple[int, ...] = getattr(masks, "shape", ())
    if len(shape) == 3:
        return int(shape[1]), int(shape[2])
    raise MaskError("masks: none given; pass image_size=(height, width) or an array of (0, H, W)")


def _ids(categories: ArrayLike, names: Mapping[int, str]) -> ArrayLike:
    """Category ids of category names, which must be among `names`; numbers as they are."""
    given: object = categories
    if not isinstance(given, Sequence):
        array = as_array("categories", given, MaskError)
        given = array.tolist() if array.dtype.kind in TEXT_KINDS else ()
    listed = [given] if isinstance(given, str) else given
    if not isinstance(listed, Sequence) or not any(isinstance(each, str) for each in listed):
        return categories
    with within("masks"):
        ids = [find_categories([each], names)[0] for each in listed]
    return ids[0] if isinstance(given, str) else ids


def _per_mask(name: str, values: ArrayLike, count: int, dtype: type[np.generic]) -> NDArray[Any]:
    array = as_array(name, values, MaskError)
    if array.ndim and array.shape != (count,):
        raise MaskError(f"{name}: expected one for each of {count} masks, got shape {array.shape}")
    # of a list, which has no type of its own, messages show what is in it
    given = values if array.ndim else np.full(count, array)
    array = numbers(name, given if count else [], dtype, ("M",), error=MaskError).copy()
    array.flags.writeable = False
    return array


def _one_by_one(masks: ArrayLike | Iterable[ArrayLike], instance_axis: int | None) -> Iterable[ArrayLike]:
    """The masks of an array or list, or of what yields one after another."""
    if instance_axis not in (0, -1, None):
        raise ParameterError(f"instance_axis: got {instance_axis!r}, expected 0 or -1")
    if instance_axis is None:
        _refuse_last_axis(np.shape(masks) if isinstance(masks, np.ndarray) else ())
        instance_axis = 0
    if isinstance(masks, np.ndarray) or instance_axis or not isinstance(masks, Iterable):
        array = as_array("masks", masks, MaskError)
        if array.ndim == 0 or (instance_axis and array.ndim != 3):
            expected = "(height, width, M)" if instance_axis else "(M, height, width)"
            raise MaskError(f"masks: expected {expected} or a list of arrays, got {shown(masks)}")
        masks = np.moveaxis(array, instance_axis, 0)
    if isinstance(masks, Sized) and len(masks) > MAX_INSTANCES:
        raise LimitError(f"masks: {len(masks)} instances exceed the limit of {MAX_INSTANCES}")
    return masks


def _refuse_last_axis(shape: tuple[int, ...]) -> None:
    """Refuse (H, W, M) where (M, H, W) is expected: images are no strips, and masks not as many as rows."""
    if len(shape) == 3 and max(LEAST_SIDE, STRIP * shape[2]) < min(shape[:2]):
        height, width, n_masks = shape
        raise MaskError(
            f"masks: shape {shape} looks like {n_masks} masks of {height} x {width}; pass instance_axis=-1, or "
            f"instance_axis=0 if it is {height} masks of {width} x {n_masks}"
        )


def _as_index(indices: ArrayLike, count: int) -> NDArray[Any]:
    array = as_array("indices", indices)
    if array.dtype.kind == "b":
        return np.flatnonzero(numbers("indices", array, np.bool_, (count,)))
    chosen = numbers("indices", array if array.size else [], np.int64, ("n",))
    if chosen.size and not (chosen.min() >= -count and chosen.max() < count):
        raise InputError(f"indices: got {chosen.min()} to {chosen.max()}, expected -{count} to {count - 1}")
    return chosen


def _some(names: Mapping[int, str]) -> str:
    listed = ", ".join(f"{category} {name}" for category, name in list(names.items())[:5])
    return listed + (", ..." if len(names) > 5 else "")
