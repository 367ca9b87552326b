"""Labels of the points of a cloud, and the objects they make."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import ldls._ldls as _ldls
from ldls.by_value import ByValue
from ldls.categories import class_id
from ldls.checks import as_array, checked, shown
from ldls.cloud import Points
from ldls.errors import DtypeError, InputError, ShapeError
from ldls.masks import InstanceMasks
from ldls.params import Params
from ldls.segmentation.objects import COLUMNS, Row, SegmentedObject, first_seen
from ldls.segmentation.oriented_box import fit_upright_box
from ldls.view import SeenView, camera_names


@dataclass(frozen=True, kw_only=True)
class Instance:
    """The instance that a label stands for.

    Attributes:
        label: The label, from 1.
        category: Category id: that of its masks, but one for each name where views name their categories differently.
        name: Category name.
        score: Highest score of its masks, 0 to 1.
        sources: Its masks: number of the view and of the mask in it, both from 0; one a view that shows it, and none
            where only images of other sweeps do.
        track: Number of the object in its drive, from 1, the same in all sweeps; 0 where nobody tracked it.
        velocity: Metres a second along x and y of the world in which the sweeps' poses are; 0 of what stands still, and
            where nobody tracked it.
    """

    label: int
    category: int
    name: str
    score: float
    sources: tuple[tuple[int, int], ...]
    track: int = 0
    velocity: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Report:
    """Counts and measures of one segmentation.

    Attributes:
        n_points: Points given.
        n_in_view: Points that the image sees; the method works on these.
        n_nonfinite: Points with a coordinate that is NaN or infinite; left out.
        n_origin: Points at exactly (0, 0, 0), taken for missing returns; left out.
        n_behind: Points behind the camera or nearer than its smallest depth.
        n_outside: Points in front of the camera but beside the image.
        n_duplicates: Points of the graph that share their place with another of them.
        k_effective: Neighbours that each point has: K, or one less than the points of the graph.
        n_refined: Points at which two labels were too near to one another for single precision.
        sweeps: Sweeps over the graph that were computed; a series saves most of the products.
        residual: Largest change of any likelihood that one more product would make; None where the number of
            iterations was given.
        converged: True if that change is at most 1e-5 and a hundredth of the largest weight of pixel edges to a label;
            False where the number of iterations was given.
        empty_masks: Labels of instances whose mask has no pixel.
        n_sweeps: Sweeps that were labelled together; all but `n_points`, `n_in_view` and `empty_masks` is of all of
            them.
    """

    n_points: int
    n_in_view: int
    n_nonfinite: int
    n_origin: int
    n_behind: int
    n_outside: int
    n_duplicates: int
    k_effective: int
    n_refined: int
    sweeps: int
    residual: float | None
    converged: bool
    empty_masks: tuple[int, ...]
    n_sweeps: int = 1


@dataclass(frozen=True, eq=False, kw_only=True)
class Segmentation(ByValue):
    """Labels of the points of a cloud, in the order of its N points.

    Attributes:
        labels: (N,) int32: -1 out of view, 0 background, m instance m, which is `instances[m - 1]`, and with one camera
            and one sweep `masks[m - 1]`.
        diffused_labels: (N,) int32: the same before outlier removal, and before a tracker.
        confidence: (N,) float32 in [0, 1]: probability that the label is of the right class, or, where the parameters
            are not `calibrated`, likelihood of the diffused label over the sum of all; 0 out of view, and 0.82 where a
            tracker gave the label.
        in_view: (n,) int64: indices of the points that any camera sees, ascending.
        instances: What the labels 1, 2, ... stand for.
        views: Each camera's masks, points and pixels.
        report: What was noticed about the input and the run.
        timings: Seconds that each step took; for `neighbors`, those after `depth`, beside which they are searched.
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
    timings: Mapping[str, float] = field(compare=False)
    points: Points
    params: Params

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

    @cached_property
    def instance_ids(self) -> NDArray[np.int64]:
        """(M + 1,) int64: number of the instance of each label 0, 1, ..., by which files name it; 0 for 0.

        It is the label, or where the result is tracked the track, which is 0 of what has no points.
        """
        tracks = [instance.track for instance in self.instances]
        return np.array([0, *(tracks if any(tracks) else range(1, len(tracks) + 1))], np.int64)

    @property
    def sources(self) -> tuple[tuple[tuple[int, int], ...], ...]:
        """For each label 1, 2, ...: the views that show it, and its mask in each, both from 0."""
        return tuple(instance.sources for instance in self.instances)

    @cached_property
    def categories(self) -> NDArray[np.int32]:
        """(N,) int32: category id of each point; 0 for background and out of view."""
        return self.per_point(np.array([0, *(instance.category for instance in self.instances)], np.int32))

    @checked
    def per_point(self, values: ArrayLike, *, out_of_view: ArrayLike | None = None) -> NDArray[Any]:
        """(N, ...) the value of each point's label.

        Args:
            values: (M + 1, ...): `values[0]` is that of the background, `values[m]` that of `instances[m - 1]`.
            out_of_view: Value of points out of view; by default that of the background.

        Raises:
            ShapeError: There is not one value a label, or that out of view is of another shape.
            DtypeError: Values of that type cannot hold the one out of view.
        """
        by_label = as_array("values", values)
        if by_label.ndim == 0 or len(by_label) != len(self.instances) + 1:
            raise ShapeError(f"values: expected ({len(self.instances) + 1}, ...), one a label, got {by_label.shape}")
        last = by_label[:1]
        if out_of_view is not None:
            try:
                with np.errstate(over="raise"):
                    last = np.asarray(out_of_view, by_label.dtype)[None]
                if by_label.dtype.kind in "biuSU" and not np.array_equal(last[0], np.asarray(out_of_view)):
                    raise ValueError("it would be cut")
            except (TypeError, ValueError, ArithmeticError) as problem:
                raise DtypeError(
                    f"out_of_view: expected {by_label.dtype}, got {shown(out_of_view)}; {problem}"
                ) from None
            if last.shape[1:] != by_label.shape[1:]:
                raise ShapeError(f"out_of_view: expected shape {by_label.shape[1:]}, got {last.shape[1:]}")
        # label -1 picks the last entry
        of_points: NDArray[Any] = np.concatenate([by_label, last])[self.labels]
        return of_points

    @property
    def abstained(self) -> NDArray[np.bool_]:
        """(N,) bool: True where a label that diffusion gave is left out, for it is too doubtful (`Params.abstain`).

        Those that outlier removal left out are among them where they are as doubtful.
        """
        lost = (self.labels == 0) & (self.diffused_labels > 0)
        doubtful: NDArray[np.bool_] = lost & (self.confidence.astype(np.float64) < self.params.abstain)
        return doubtful

    @cached_property
    def direct_labels(self) -> NDArray[np.int32]:
        """(N,) int32: direct projection, for comparison: the label of the pixel nearest to each point, -1 out of view.

        Of several masks that cover the pixel, the first counts; of several cameras, the first that sees an instance.
        """
        labels = np.full(len(self.labels), -1, np.int32)
        for seen in reversed(self.views):
            # label 0, the background, stays
            names = np.concatenate([np.zeros(1, np.int32), seen.labels])
            of_masks = names[_ldls.direct_labels(seen.pixels, seen.view.masks.core)]
            kept = np.maximum(labels[seen.in_view], 0)
            labels[seen.in_view] = np.where(of_masks > 0, of_masks, kept)
        return labels

    @cached_property
    def objects(self) -> tuple[SegmentedObject, ...]:
        """One record for each instance, in their order."""
        inside = self.in_view[np.argsort(self.labels[self.in_view], kind="stable")]
        labels = np.arange(1, len(self.instances) + 1)
        starts = np.searchsorted(self.labels[inside], labels, side="left")
        ends = np.searchsorted(self.labels[inside], labels, side="right")
        rows = (inside[start:end] for start, end in zip(starts, ends, strict=True))
        return tuple(self._object(*parts) for parts in zip(self.instances, rows, strict=True))

    def to_table(self) -> list[Row]:
        """Return a row for each object with points, in their order, as `pandas.DataFrame` takes them.

        A row is a dict of plain values; its columns, in this order:

        - `label`, `track`, `category`, `name`, `score`, `n_points` and `distance_m`, as of `objects`;
        - `centroid_x_m`, `centroid_y_m`, `centroid_z_m`: mean of its points in the lidar frame;
        - `box_x_m`, `box_y_m`, `box_z_m`, `length_m`, `width_m`, `height_m`, `yaw_rad`: its box in the lidar frame;
        - `velocity_x_m_s`, `velocity_y_m_s`: its velocity in the world of the poses;
        - `camera`: name of the first camera that shows it, and `mask_left_px`, `mask_top_px`, `mask_width_px`,
          `mask_height_px`: the smallest box around its mask there.
        """
        cameras, rows = camera_names(self.views), []
        for each, sources in zip(self.objects, self.sources, strict=True):
            if each.centroid is None or each.box is None:
                continue
            shown = first_seen(sources, self.views)
            camera, box = ("", (None,) * 4) if shown is None else (cameras[shown[0]], shown[1].bounding_box)
            top, left, height, width = box
            values = (
                each.label, each.track, each.category, each.name, float(each.score), each.n_points, each.distance_m,
                *each.centroid.tolist(),
                *each.box.center.tolist(), *each.box.size.tolist(), float(each.box.yaw),
                *each.velocity,
                camera, left, top, width, height,
            )  # fmt: skip
            rows.append(dict(zip(COLUMNS, values, strict=True)))
        return rows

    def _object(self, instance: Instance, rows: NDArray[np.int64]) -> SegmentedObject:
        xyz = self.points[rows, :3].astype(np.float64)
        return SegmentedObject(
            label=instance.label,
            category=instance.category,
            name=instance.name,
            score=instance.score,
            track=instance.track,
            velocity=instance.velocity,
            n_points=len(rows),
            centroid=xyz.mean(axis=0) if len(rows) else None,
            box=fit_upright_box(xyz) if len(rows) else None,
        )

    def _repr_html_(self) -> str:
        # pictures lie above the nouns; the package, above all, knows where
        from ldls import _html_of

        return _html_of(self)

    def __repr__(self) -> str:
        n_found = sum(o.n_points > 0 for o in self.objects)
        return (
            f"Segmentation({len(self.labels)} points, {len(self.in_view)} in view, "
            f"{n_found} of {len(self.instances)} objects found)"
        )


def by_name(result: Segmentation, known: dict[int, str]) -> Segmentation:
    """The result as one of several, in all of which a class has one id and one spelling; adds its own to `known`."""
    ids = [class_id(each.category, each.name, known) for each in result.instances]
    named = [(own, known[own]) for own in ids]
    if named == [(each.category, each.name) for each in result.instances]:
        return result
    pairs = zip(result.instances, named, strict=True)
    return replace(result, instances=tuple(replace(each, category=own, name=name) for each, (own, name) in pairs))
