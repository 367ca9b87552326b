"""Labels of the points of a cloud, and the objects they make."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from ldls import _ldls
from ldls.camera import Camera
from ldls.cloud import Points, as_points
from ldls.errors import CorruptFileError, InputError, LdlsError
from ldls.io import result_npz, results
from ldls.masks import InstanceMasks
from ldls.params import Params
from ldls.segmentation.objects import SegmentedObject
from ldls.segmentation.oriented_box import fit_upright_box
from ldls.segmentation.report import Report
from ldls.view import SeenView, View


@dataclass(frozen=True, kw_only=True)
class Instance:
    """What a label stands for.

    Attributes:
        label: The label, from 1.
        category: Category id.
        name: Category name.
        score: Highest score of its masks, 0 to 1.
        sources: Its masks: number of the view and of the mask in it, both from 0; one a view that shows it.
    """

    label: int
    category: int
    name: str
    score: float
    sources: tuple[tuple[int, int], ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class Segmentation:
    """Labels of the points of a cloud, in the order of its N points.

    Attributes:
        labels: (N,) int32: -1 out of view, 0 background, m instance m, which is `instances[m - 1]`, and with one camera
            `masks[m - 1]`.
        diffused_labels: (N,) int32: the same before outlier removal.
        confidence: (N,) float32 in [0, 1]: likelihood of the diffused label over the sum of all; 0 out of view.
        in_view: (n,) int64: indices of the points that any camera sees, ascending.
        instances: What the labels 1, 2, ... stand for.
        views: Each camera's masks, points and pixels.
        report: What was noticed about the input and the run.
        timings: Seconds that each step took.
        points: (N, >= 3) the points given, x y z first, in metres.
        params: The parameters used.
    """

    labels: NDArray[np.int32]
    diffused_labels: NDArray[np.int32]
    confidence: NDArray[np.float32]
    in_view: NDArray[np.int64]
    instances: tuple[Instance, ...]
    views: tuple[SeenView, ...]
    report: Report
    timings: Mapping[str, float]
    points: Points
    params: Params

    # what notebooks show; the package gives it
    _repr_html_: ClassVar[Callable[[Segmentation], str]]

    @classmethod
    def from_npz(cls, path: str | PathLike[str]) -> Self:
        """The segmentation that `save` wrote to an `.npz` file.

        Raises:
            UnsupportedFormatError: It is no such file, or one of a version that did not store the points.
            CorruptFileError: It is not whole, or its arrays do not fit one another.
            FileNotFoundError: There is no such file.
        """
        stored = result_npz.read(path)
        try:
            result = cls(
                labels=stored.labels,
                diffused_labels=stored.diffused_labels,
                confidence=stored.confidence,
                in_view=stored.in_view,
                instances=_stored_instances(stored),
                views=tuple(_stored_view(view) for view in stored.views),
                report=Report(**stored.report | {"empty_masks": tuple(stored.report["empty_masks"])}),
                timings=stored.timings,
                points=as_points(stored.points),
                params=Params(**stored.params),
            )
            result._check()
        except (LdlsError, KeyError, TypeError, ValueError) as error:
            raise CorruptFileError(f"{path}: not a whole result ({error})") from None
        return result

    def _check(self) -> None:
        """Refuse arrays that do not fit one another; only a file can have such.

        Raises:
            InputError: They do not.
        """
        n, most = len(self.points), len(self.instances)
        _expect("labels", self.labels, np.int32, (n,), -1, most)
        _expect("diffused_labels", self.diffused_labels, np.int32, (n,), -1, most)
        _expect("confidence", self.confidence, np.float32, (n,), 0, 1)
        _expect("in_view", self.in_view, np.int64, (len(self.in_view),), 0, n - 1)
        for seen in self.views:
            _expect("in_view of a view", seen.in_view, np.int64, (len(seen.in_view),), 0, n - 1)
            _expect("pixels", seen.pixels, np.float64, (len(seen.in_view), 2), -np.inf, np.inf)
            _expect("labels of a view", seen.labels, np.int32, (len(seen.view.masks),), 1, most)

    @property
    def masks(self) -> InstanceMasks:
        """The masks given, of the one camera there is.

        Raises:
            InputError: There are several cameras.
        """
        return self._only_view("masks", "view.masks").view.masks

    @property
    def pixels(self) -> NDArray[np.float64]:
        """(n, 2) float64: u (right) and v (down) in pixels of the points in view, of the one camera there is.

        Raises:
            InputError: There are several cameras.
        """
        return self._only_view("pixels", "pixels").pixels

    def _only_view(self, name: str, instead: str) -> SeenView:
        if len(self.views) != 1:
            raise InputError(f"{name}: there are {len(self.views)} cameras; take result.views[i].{instead}")
        return self.views[0]

    @property
    def sources(self) -> tuple[tuple[tuple[int, int], ...], ...]:
        """For each label 1, 2, ...: the views that show it, and its mask in each, both from 0."""
        return tuple(instance.sources for instance in self.instances)

    @cached_property
    def categories(self) -> NDArray[np.int32]:
        """(N,) int32: category id of each point; 0 for background and out of view."""
        # label -1 picks the last entry
        by_label = np.array([0, *(instance.category for instance in self.instances), 0], np.int32)
        return by_label[self.labels]

    @cached_property
    def direct_labels(self) -> NDArray[np.int32]:
        """(N,) int32: direct projection, for comparison: the label of the pixel nearest to each point, -1 out of view.

        Of several masks that cover the pixel, the first counts; of several cameras, the first that sees an instance.
        """
        labels = np.full(len(self.labels), -1, np.int32)
        for seen in reversed(self.views):
            # label 0, the background, stays
            names = np.concatenate([np.zeros(1, np.int32), seen.labels])
            found = names[_ldls.direct_labels(seen.pixels, seen.view.masks.core)]
            kept = np.maximum(labels[seen.in_view], 0)
            labels[seen.in_view] = np.where(found > 0, found, kept)
        return labels

    @cached_property
    def objects(self) -> tuple[SegmentedObject, ...]:
        """One record for each instance, in their order."""
        inside = self.in_view[np.argsort(self.labels[self.in_view], kind="stable")]
        labels = np.arange(1, len(self.instances) + 1)
        starts = np.searchsorted(self.labels[inside], labels, side="left")
        ends = np.searchsorted(self.labels[inside], labels, side="right")
        rows = (inside[start:end] for start, end in zip(starts, ends, strict=True))
        return tuple(self._object(*found) for found in zip(self.instances, rows, strict=True))

    def _object(self, instance: Instance, rows: NDArray[np.int64]) -> SegmentedObject:
        xyz = self.points[rows, :3].astype(np.float64)
        return SegmentedObject(
            label=instance.label,
            category=instance.category,
            name=instance.name,
            score=instance.score,
            n_points=len(rows),
            centroid=xyz.mean(axis=0) if len(rows) else None,
            box=fit_upright_box(xyz) if len(rows) else None,
        )

    def save(self, path: str | PathLike[str]) -> None:
        """Write the labels; the ending of the name chooses the format.

        `.npz` has all fields, `.label` is SemanticKITTI's, `_lidarseg.bin` and `_panoptic.npz` are nuScenes'. `.ply`,
        `.pcd`, `.las` and `.laz` are point clouds with labels, confidence and colour; `.parquet` and `.csv` tables with
        a row a point. docs/formats.md says what is in each. The file appears only when it is whole.

        Raises:
            UnsupportedFormatError: No format has this ending.
            LimitError: The format cannot hold so many instances, so wide a cloud or so large a category id.
            NonFiniteError: The format cannot hold points that are not finite.
            ImportError: The format needs an extra that is not installed; the message names it.
        """
        results.write(path, self)

    def __repr__(self) -> str:
        found = sum(o.n_points > 0 for o in self.objects)
        return (
            f"Segmentation({len(self.labels)} points, {len(self.in_view)} in view, "
            f"{found} of {len(self.instances)} objects found)"
        )


def _stored_view(stored: result_npz.StoredView) -> SeenView:
    view = View(InstanceMasks.of_records(stored.masks), Camera.of_found(stored.camera), stored.name)
    return SeenView(view=view, in_view=stored.in_view, pixels=stored.pixels, labels=stored.labels)


def _stored_instances(stored: result_npz.StoredResult) -> tuple[Instance, ...]:
    sources: list[list[tuple[int, int]]] = [[] for _ in stored.names]
    for number, view in enumerate(stored.views):
        for mask, label in enumerate(view.labels.tolist()):
            sources[label - 1].append((number, mask))
    parts = zip(stored.categories, stored.names, stored.scores, sources, strict=True)
    return tuple(
        Instance(label=label, category=category, name=name, score=score, sources=tuple(own))
        for label, (category, name, score, own) in enumerate(parts, start=1)
    )


def _expect(name: str, array: NDArray[Any], kind: type, shape: tuple[int, ...], low: float, high: float) -> None:
    if array.dtype != kind or array.shape != shape:
        raise InputError(f"{name}: expected {shape} {np.dtype(kind)}, got {array.shape} {array.dtype}")
    if array.size and not (array.min() >= low and array.max() <= high):
        raise InputError(f"{name}: expected {low} to {high}, got {array.min()} to {array.max()}")
