"""The paper's experiments on labelled frames: methods against one another, range, and the number of iterations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ldls._ldls import default_threads
from ldls.errors import InputError
from ldls.evaluation.classes import ClassSet
from ldls.evaluation.evaluate import Evaluation, evaluate
from ldls.evaluation.frame_inputs import ranges_of
from ldls.evaluation.kitti_frames import LabelledFrame
from ldls.evaluation.methods import FULL, OUT_OF_VIEW, compare
from ldls.evaluation.object_scores import ObjectScore, object_scores
from ldls.evaluation.pair import Pair
from ldls.label_diffusion import segment
from ldls.labeling import Labeling
from ldls.params import Params

ITERATIONS: tuple[int, ...] = (1, 5, 10, 20, 50, 100, 200, 500)
RANGES_M: tuple[float, ...] = (10, 15, 20, 25, 30, 40, 50, 60, 70)


@dataclass(frozen=True, eq=False)
class Experiment:
    """What the methods score on the same frames.

    Attributes:
        methods: Scores of each method over all points in view.
        by_range: Scores of the full method over the points up to each range in metres.
        by_iterations: Scores of the full method after each number of iterations.
        objects: How well the full method found each true object.
    """

    methods: Mapping[str, Evaluation]
    by_range: Mapping[float, Evaluation]
    by_iterations: Mapping[int, Evaluation]
    objects: tuple[ObjectScore, ...]


@dataclass(frozen=True, eq=False)
class LabelledPairs:
    """What the methods say of one frame, beside its truth, over the points in view.

    Attributes:
        methods: By method.
        iterations: By the full method after each number of iterations.
    """

    methods: Mapping[str, Pair]
    iterations: Mapping[int, Pair]


class Frames(Protocol):
    """Labelled frames by number."""

    def __len__(self) -> int: ...
    def __getitem__(self, at: int, /) -> LabelledFrame: ...


def label(
    frames: Frames, *, params: Params | None = None, iterations: Sequence[int] = ITERATIONS
) -> Iterator[LabelledPairs]:
    """The labels of every method for each frame, in order, one frame a thread.

    Args:
        frames: Frames with masks and truth.
        params: Parameters of the diffusion; their threads are frames at a time.
        iterations: Numbers of iterations after which the full method is asked too.
    """
    params = params or Params()
    one_thread = replace(params, threads=1)
    with ThreadPoolExecutor(params.threads or default_threads()) as workers:
        yield from workers.map(lambda at: _label(frames[at], one_thread, iterations), range(len(frames)))


def score(labelled: Sequence[LabelledPairs], *, classes: ClassSet, ranges_m: Sequence[float] = RANGES_M) -> Experiment:
    """The scores of every method over all frames.

    Args:
        labelled: What `label` yields.
        classes: What is scored.
        ranges_m: Maximum ranges for which the full method is scored.

    Raises:
        InputError: There is no frame, or truth has a class that `classes` does not know.
    """
    if not labelled:
        raise InputError("labelled: got no frame, expected one or more")
    methods = {name: [one.methods[name] for one in labelled] for name in labelled[0].methods}
    after = {count: [one.iterations[count] for one in labelled] for count in labelled[0].iterations}
    full = methods[FULL]
    return Experiment(
        methods={name: evaluate(pairs, classes=classes) for name, pairs in methods.items()},
        by_range={limit: evaluate(full, classes=classes, max_range_m=limit) for limit in ranges_m},
        by_iterations={count: evaluate(pairs, classes=classes) for count, pairs in after.items()},
        objects=tuple(found for pair in full for found in object_scores(pair, classes=classes)),
    )


def _label(frame: LabelledFrame, params: Params, iterations: Sequence[int]) -> LabelledPairs:
    found = compare(frame.points, frame.masks, frame.camera, params=params)
    in_view = np.flatnonzero(next(iter(found.values())) != OUT_OF_VIEW)
    truth = _rows(frame.truth, in_view)
    names = [mask.name for mask in frame.masks]
    ranges_m = ranges_of(frame.points[in_view])

    def pair(labels: NDArray[np.int32]) -> Pair:
        return Pair(frame.name, Labeling.from_instance_labels(labels[in_view], names), truth, ranges_m)

    def after(count: int) -> NDArray[np.int32]:
        counted = replace(params, iterations=count)
        return segment(frame.points, frame.masks, frame.camera, params=counted).labels

    return LabelledPairs(
        methods={name: pair(labels) for name, labels in found.items()},
        iterations={count: pair(after(count)) for count in iterations},
    )


def _rows(labeling: Labeling, rows: NDArray[np.intp]) -> Labeling:
    return Labeling(labeling.classes[rows], labeling.instances[rows], labeling.ignored[rows], labeling.names)
