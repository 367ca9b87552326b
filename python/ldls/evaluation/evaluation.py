"""All scores of predictions against truth, frame by frame."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ldls.checks import checked, shown
from ldls.errors import InputError, ParameterError
from ldls.evaluation.classes import ClassSet
from ldls.evaluation.counts import Counts
from ldls.evaluation.instance import PAPER_THRESHOLDS, InstanceScores
from ldls.evaluation.pair import Pair
from ldls.evaluation.panoptic import PanopticScores
from ldls.evaluation.reliability import Reliability
from ldls.evaluation.semantic import SemanticScores
from ldls.evaluation.tracking import TrackingScores
from ldls.labeling import Labeling

WELL_SEEN_POINTS = 20
"""Points from which on a true instance is well seen: of fewer, chance decides."""


@dataclass(frozen=True)
class FrameCounts:
    """Counts of one frame.

    Attributes:
        name: Name of the frame.
        n_points: Its points.
        n_counted: Those that count.
        classes: Points found, invented and missed of each class.
    """

    name: str
    n_points: int
    n_counted: int
    classes: Mapping[str, Counts]


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Scores of predictions against truth.

    Attributes:
        names: The scored classes.
        semantic: Points by class.
        instance: Instances at each threshold.
        well_seen: The same, of true instances with 20 points or more.
        panoptic: Panoptic quality.
        frames: One record a frame.
        reliability: Confidence against truth; None where a frame has no confidence.
        tracking: Objects over the drive; None where the frames are not said to be one.
    """

    names: tuple[str, ...]
    semantic: SemanticScores
    instance: InstanceScores
    well_seen: InstanceScores
    panoptic: PanopticScores
    frames: tuple[FrameCounts, ...]
    reliability: Reliability | None
    tracking: TrackingScores | None = None


@checked
def evaluate(
    pairs: Iterable[Pair | tuple[str, Labeling, Labeling]],
    *,
    classes: ClassSet,
    thresholds: Sequence[float] = PAPER_THRESHOLDS,
    max_range_m: float | None = None,
    minimum_points: int = 0,
    track: bool = False,
) -> Evaluation:
    """Semantic, instance and panoptic scores over all frames, which are taken one at a time.

    Args:
        pairs: Prediction and truth of each frame, as `Pair` or (name, prediction, truth).
        classes: The scored classes, and the treatment of all others.
        thresholds: IoU from which on a matched instance is found.
        max_range_m: Points farther from the lidar than this do not count; needs `Pair.ranges_m`.
        minimum_points: Smaller true instances, and smaller unmatched segments in panoptic quality, do not count.
        track: Score objects over the drive as well. The frames are the sweeps of one drive in their order, and an
            instance's number means the same object in all of them; of true ones together with the scored class, of
            predicted ones whatever their class. Of several drives evaluate each, and merge their `tracking`.

    Raises:
        ShapeError: Prediction and truth of a frame differ in length.
        InputError: Truth holds an unknown class, or ranges are missing; the message names the frame.
        ParameterError: A parameter is out of range.
    """
    if max_range_m is not None and not max_range_m > 0:
        raise ParameterError(f"max_range_m: got {max_range_m}, expected more than 0")
    semantic = SemanticScores(classes.names)
    instance = InstanceScores(classes.names, thresholds=thresholds, minimum_points=minimum_points)
    well_seen = InstanceScores(
        classes.names, thresholds=thresholds, minimum_points=max(minimum_points, WELL_SEEN_POINTS)
    )
    panoptic = PanopticScores(classes.names, minimum_points=minimum_points)
    tracking = TrackingScores(classes.names, minimum_points=minimum_points) if track else None
    reliability: Reliability | None = Reliability()
    frames = []
    for item in pairs:
        own = _as_pair(item)
        pair = own.mapped(classes, max_range_m=max_range_m)
        of_frame = SemanticScores(classes.names)
        of_frame.add(pair.prediction, pair.truth)
        semantic.merge(of_frame)
        for scores in (instance, well_seen, panoptic):
            scores.add(pair.prediction, pair.truth)
        if tracking is not None:
            tracking.add(_numbered(pair.prediction, own.prediction), _numbered(pair.truth, own.truth))
        if pair.confidence is None:
            reliability = None
        elif reliability is not None:
            reliability.add(pair.prediction, pair.truth, pair.confidence)
        counts = {name: of_frame[name] for name in of_frame.names}
        frames.append(FrameCounts(pair.name, len(pair.truth), int(of_frame.confusion.sum()), counts))
    reliability = reliability if frames else None
    return Evaluation(classes.names, semantic, instance, well_seen, panoptic, tuple(frames), reliability, tracking)


def _numbered(mapped: Labeling, own: Labeling) -> Labeling:
    """`mapped` with the numbers of `own`: classes that become one may have got others, in each frame anew.

    An object whose class is not scored keeps its number, which in predictions still tells it from others.
    """
    return replace(mapped, instances=np.where(own.classes > 0, own.instances, 0))


def _as_pair(item: Pair | tuple[str, Labeling, Labeling]) -> Pair:
    if isinstance(item, Pair):
        return item
    if not isinstance(item, tuple) or len(item) != 3:
        raise InputError(f"pairs: expected Pair or (name, prediction, truth), got {shown(item)}")
    return Pair(*item)
