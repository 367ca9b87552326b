"""The objects of a drive: one number for each in all sweeps, through gaps of some seconds.

Seen from above, an object goes on as itself where its points lie near those that a track had in the last seconds, all
moved to one moment by its velocity. Pairs are chosen together (linear assignment), so that neighbours do not swap.
Tracks of one object are joined, and labels of one object have one track. Within sweeps that were segmented together an
object keeps its label, and so its number; a label that begins later goes on with a track that has none then, or in
whose very place it is. Other moments say more of points that images overlook, or give to another object
(propagation.py).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ldls._optional import require
from ldls.checks import checked
from ldls.cloud import Floats, Ints
from ldls.errors import InputError
from ldls.segmentation import Instance, Segmentation
from ldls.segmentation.segmentation import by_name
from ldls.sequences.comparison import compared
from ldls.sequences.moment import Moment
from ldls.sequences.propagation import CONFIDENCE, mistaken, overlooked
from ldls.sequences.sweeps import Sweep, check_order, check_points
from ldls.sequences.track import MEMORY_S, Footprint, Sighting, Track
from ldls.sequences.trajectory import SAME_S

KEPT_S = 10.0
"""Time without a point after which a track ends."""
TWO_OBJECTS = 4
"""Sweeps of the last two seconds with masks of both, from which on two tracks are two objects, however near."""
TWO_LABELS = 2
"""Sweeps of a call with masks of both, from which on two labels are of two objects."""
MOST_POINTS = 48
"""Points that stand for an object in a sweep; of more, some."""


class Tracker:
    """Numbers the objects of a drive, sweep after sweep.

    Memory is that of the objects of the last seconds.

    Examples:
        >>> tracker = ldls.Tracker()  # doctest: +SKIP
        >>> for sweeps in windows:  # doctest: +SKIP
        ...     results = tracker.track(sweeps, ldls.segment_sweeps(sweeps))
    """

    def __init__(self) -> None:
        """Start a drive.

        Raises:
            ImportError: `ldls[eval]` is not installed.
        """
        self._assign = require("scipy.optimize", "eval").linear_sum_assignment
        self._tracks: list[Track] = []
        self._moments: list[Moment] = []
        self._count = 0
        self._names: dict[int, str] = {}
        self._stamp = -np.inf

    @checked
    def track(self, sweeps: Sequence[Sweep], results: Sequence[Segmentation]) -> tuple[Segmentation, ...]:
        """Return the results with track and velocity of each instance that has points in any of the sweeps.

        An object that images overlook has points where it was, or went by its velocity, within two seconds of a sweep
        that shows it: if five images did before, or three where the images of the sweep show nothing at all. Confidence
        there is 0.82, and where the parameters `abstain` from labels of no more, there are none; `diffused_labels`
        stay; objects without a label among these sweeps are added to the
        instances. A point around which earlier points are of another object that stands has the label of that. Two
        instances in one place are one object, and so is one of three points or fewer with that on which they lie, or
        near another of so few, by the length of their category: they have one number, and the points of both the label
        of the first. A category goes by its name: instances have the id that it had first in the drive.

        Args:
            sweeps: The next sweeps of the drive, in the order of their stamps.
            results: What `segment_sweeps` says of them together.

        Raises:
            InputError: There is no sweep, or not one result a sweep; a sweep is not later than the one before it, or
                results are not of one call of `segment_sweeps`, or one is of other points.
            ShapeError: A result has more or fewer points than its sweep.
        """
        if len(sweeps) != len(results) or not sweeps:
            raise InputError(f"results: got {len(results)} for {len(sweeps)} sweeps, expected one a sweep")
        check_order(sweeps, self._stamp)
        if len({tuple(_named(result)) for result in results}) > 1:
            raise InputError("results: their instances differ, expected those of one call of segment_sweeps")
        for sweep, result in zip(sweeps, results, strict=True):
            check_points(sweep, result)
        self._stamp = sweeps[-1].stamp
        results = [by_name(result, self._names) for result in results]
        instances = {instance.label: instance for instance in results[0].instances}
        seen = [_sightings(sweep, result) for sweep, result in zip(sweeps, results, strict=True)]
        by_label = self._advanced(instances, [sweep.stamp for sweep in sweeps], seen)
        numbers = {label: track.number for label, track in by_label.items()}
        of_number = {number: label for label, number in sorted(numbers.items(), reverse=True)}
        results = [_relabelled(result, {label: of_number[numbers[label]] for label in numbers}) for result in results]
        moments = [Moment.of(sweep, result, numbers) for sweep, result in zip(sweeps, results, strict=True)]
        known = [moment for moment in self._moments if moments[0].stamp - moment.stamp <= MEMORY_S + SAME_S]
        self._moments = known + moments
        # of points with a label, and of those without
        others = mistaken(moments, known, self._tracks)
        found = others
        if results[0].params.abstain <= CONFIDENCE:
            found = [
                overlooked(m, self._moments, self._tracks) + other for m, other in zip(moments, others, strict=True)
            ]
        new = np.unique(np.concatenate([each[each > 0] for each in found]))
        added = self._added(new, of_number, len(results[0].instances))
        tracked = []
        for result, moment, rows in zip(results, moments, found, strict=True):
            own = (i if (t := by_label.get(i.label)) is None else t.as_instance(i) for i in result.instances)
            tracked.append(replace(_completed(result, moment, rows, of_number), instances=(*own, *added)))
        return tuple(tracked)

    def _added(self, found: Ints, of_number: dict[int, int], known: int) -> list[Instance]:
        """Instances after the `known` ones, for what was `found` of objects that have no label among these.

        Their labels are added to `of_number`, the label of each track.
        """
        tracks = {track.number: track for track in self._tracks}
        added: list[Instance] = []
        for number in found.tolist():
            if number not in of_number:
                of_number[number] = known + len(added) + 1
                track = tracks[number]
                added.append(track.as_instance(replace(track.instance, label=of_number[number], sources=())))
        return added

    def _advanced(
        self, instances: Mapping[int, Instance], stamps: Sequence[float], seen: Sequence[Mapping[int, Sighting]]
    ) -> dict[int, Track]:
        """The track of each label of sweeps that were segmented together, which it has gone through."""
        last = {label: at for at, own in enumerate(seen) for label in own}
        by_label: dict[int, Track] = {}
        for at, (stamp, own) in enumerate(zip(stamps, seen, strict=True)):
            begin = [label for label in own if label not in by_label]
            new = {label: [each[label] for each in seen[at:] if label in each] for label in begin}
            going_on = {track for label, track in by_label.items() if last[label] >= at}
            by_label |= self._matched(instances, new, stamp, going_on)
            for label, sighting in own.items():
                by_label[label].advance(instances[label], sighting)
        return by_label

    def _matched(
        self,
        instances: Mapping[int, Instance],
        sightings: Mapping[int, Sequence[Sighting]],
        stamp: float,
        going_on: Set[Track],
    ) -> dict[int, Track]:
        """The track of each label that is first seen at a moment: a known one, or a new one.

        Args:
            instances: That of each label.
            sightings: What is seen of each label, then and later.
            stamp: The moment, in seconds.
            going_on: Tracks that have a label at the moment or later. Another label goes on with one if it is in its
                place or a few points on it, and they are joined with no other.
        """
        self._tracks = [track for track in self._tracks if stamp - track.stamp <= KEPT_S + SAME_S]
        if not sightings:
            return {}
        labels = list(sightings)
        objects = [(instances[label].category, sightings[label]) for label in labels]
        apart, same, part = compared(objects, self._tracks, stamp)
        goes_on = np.array([track in going_on for track in self._tracks], bool)
        apart[goes_on & ~(same | part)] = np.inf
        # to stay alone is as dear as the worst pair: two bad pairs do not outweigh a good one
        rows, columns = self._assign(np.minimum(apart, 1.0))
        pairs = {i: j for i, j in zip(rows.tolist(), columns.tolist(), strict=True) if np.isfinite(apart[i, j])}
        shown = [{each.stamp for each in sightings[label] if each.shown} for label in labels]
        twins = self._twins(pairs, shown, apart, same)
        known = self._joined(pairs, same & ~goes_on)
        known |= {i: known[other] for i, other in twins.items()}
        return {label: known.get(i) or self._begin(instances[label]) for i, label in enumerate(labels)}

    def _twins(
        self, pairs: Mapping[int, int], shown: Sequence[Set[float]], apart: Floats, same: NDArray[np.bool_]
    ) -> dict[int, int]:
        """The other label of its object for each that has one, both by their place in the order.

        A label is of the object of another if it is the `same` as the track of that, and nearer to it than to its own,
        and images show neither the labels apart nor the tracks.

        Args:
            pairs: The track of each label, both by their place in the order.
            shown: Stamps of the sweeps whose images have a mask of each label, in seconds.
            apart: (labels, tracks) how far apart they are, as `compared` says.
            same: (labels, tracks) True where they are too near to be two objects.
        """
        twins = {}
        for i in range(len(shown)):
            own = pairs.get(i)
            nearer = [
                (apart[i, j], other)
                for other, j in pairs.items()
                if same[i, j]
                and len(shown[i] & shown[other]) < TWO_LABELS
                and (own is None or (apart[i, j] < apart[i, own] and not self._are_two(own, j)))
            ]
            if nearer:
                twins[i] = min(nearer)[1]
        return twins

    def _joined(self, pairs: Mapping[int, int], same: NDArray[np.bool_]) -> dict[int, Track]:
        """The track of each label that is paired with one, by its place, after tracks of one object are joined.

        An object that had two labels for a while has two tracks, and would go on by the one or the other. Where a label
        and its track are the `same` as tracks that have no label now, both move or both stand, and images do not show
        them apart, the one that most images showed goes on, and the others end.

        Args:
            pairs: The track of each label, both by their place in the order.
            same: (labels, tracks) True where they are too near to be two objects, and the track has no label now or
                later.
        """
        free = set(range(len(self._tracks))) - set(pairs.values())
        joined, ended = {}, set()
        for i, j in pairs.items():
            near = [other for other in sorted(free) if same[i, other]] if same[i, j] else []
            # what moves and would be here by now, if it has gone on, is not what stands here
            alike = [other for other in near if self._tracks[other].moves == self._tracks[j].moves]
            others = [other for other in alike if not self._are_two(j, other)]
            free.difference_update(others)
            one, *doubles = sorted((self._tracks[k] for k in (j, *others)), key=lambda each: -each.n_images)
            joined[i] = one
            for double in doubles:
                ended.add(double)
                self._moments = [moment.renumbered(double.number, one.number) for moment in self._moments]
                # an earlier label of these sweeps may have it
                double.number = one.number
        self._tracks = [track for track in self._tracks if track not in ended]
        return joined

    def _are_two(self, one: int, other: int) -> bool:
        """True if images show two tracks apart."""
        return self._tracks[one].shown_with(self._tracks[other]) >= TWO_OBJECTS

    def _begin(self, instance: Instance) -> Track:
        self._count += 1
        self._tracks.append(Track(self._count, instance))
        return self._tracks[-1]


def _named(result: Segmentation) -> Iterator[tuple[int, int, str, float]]:
    """What all sweeps of a call say alike of each instance."""
    return ((each.label, each.category, each.name, each.score) for each in result.instances)


def _relabelled(result: Segmentation, label_of: Mapping[int, int]) -> Segmentation:
    """The result with points of one label for each object."""
    if all(label == new for label, new in label_of.items()):
        return result
    # the last one is that of -1
    new = np.append(np.arange(len(result.instances) + 1, dtype=np.int32), np.int32(-1))
    new[list(label_of)] = list(label_of.values())
    return replace(result, labels=new[result.labels])


def _completed(result: Segmentation, moment: Moment, found: Ints, of_number: Mapping[int, int]) -> Segmentation:
    """The result with the labels of what was `found` at its moment."""
    new = np.flatnonzero(found)
    if not len(new):
        return result
    labels, confidence, rows = result.labels.copy(), result.confidence.copy(), moment.rows[new]
    confidence[rows] = np.where(labels[rows] > 0, confidence[rows], CONFIDENCE)
    labels[rows] = [of_number[number] for number in found[new].tolist()]
    return replace(result, labels=labels, confidence=confidence)


def _sightings(sweep: Sweep, result: Segmentation) -> dict[int, Sighting]:
    """That of each label that has points."""
    sightings: dict[int, Sighting] = {}
    labelled = np.flatnonzero(result.labels > 0)
    labelled = labelled[np.argsort(result.labels[labelled], kind="stable")]
    labels, starts = np.unique(result.labels[labelled], return_index=True)
    for label, rows in zip(labels.tolist(), np.split(labelled, starts)[1:], strict=True):
        some = rows[:: -(-len(rows) // MOST_POINTS)]
        xyz = result.points[some, :3].astype(np.float64)
        xy = xyz @ sweep.pose[:2, :3].T + sweep.pose[:2, 3]
        shown = bool(result.instances[label - 1].sources)
        sightings[label] = Sighting(sweep.stamp, Footprint(xy), shown)
    return sightings
