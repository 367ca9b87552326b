"""The paper's experiments on labelled frames: methods against one another, range, and the number of iterations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ldls._ldls import default_threads
from ldls.checks import checked
from ldls.datasets import Frame, Source
from ldls.errors import InputError
from ldls.evaluation.classes import ClassSet
from ldls.evaluation.evaluation import Evaluation, evaluate
from ldls.evaluation.instance import ObjectScore, object_scores
from ldls.evaluation.methods import FULL, PAPER, compare
from ldls.evaluation.pair import Pair, ranges_of
from ldls.label_diffusion import segment
from ldls.labeling import Labeling
from ldls.params import Params

ITERATIONS: tuple[int, ...] = (1, 5, 10, 20, 50, 100, 200, 500)
RANGES_M: tuple[float, ...] = (10, 15, 20, 25, 30, 40, 50, 60, 70)


@dataclass(frozen=True, eq=False)
class Experiment:
    """Scores of the methods on the same frames.

    Attributes:
        methods: Scores of each method over all points in view.
        by_range: Scores of the full method over the points up to each range in metres.
        by_iterations: Scores of the full method after each number of iterations.
        objects: Score of the full method for each true object.
    """

    methods: Mapping[str, Evaluation]
    by_range: Mapping[float, Evaluation]
    by_iterations: Mapping[int, Evaluation]
    objects: tuple[ObjectScore, ...]


@dataclass(frozen=True, eq=False)
class LabelledPairs:
    """Labels of one frame by each method, beside its truth, of the points in view.

    Attributes:
        methods: By method.
        iterations: By the full method after each number of iterations.
    """

    methods: Mapping[str, Pair]
    iterations: Mapping[int, Pair]


def label(
    frames: Source, *, classes: ClassSet, params: Params | None = None, iterations: Sequence[int] = ITERATIONS
) -> Iterator[LabelledPairs]:
    """The labels of every method for each frame, in order, one frame a thread.

    Args:
        frames: Frames whose first image has masks, and that have truth.
        classes: The scored classes, by which the bound is found.
        params: Parameters of the full method; their threads are frames at a time.
        iterations: Numbers of iterations after which the labels of the full method are taken too.

    Raises:
        InputError: A frame has no masks or no truth, or truth has a class that `classes` does not know.
    """
    params = params or Params()
    one_thread = replace(params, threads=1)
    with ThreadPoolExecutor(params.threads or default_threads()) as workers:
        yield from workers.map(lambda at: _label(frames[at], classes, one_thread, iterations), range(len(frames)))


@checked
def score(labelled: Sequence[LabelledPairs], *, classes: ClassSet, ranges_m: Sequence[float] = RANGES_M) -> Experiment:
    """The scores of every method over all frames.

    Args:
        labelled: The pairs that `label` yields.
        classes: The scored classes.
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
        objects=tuple(one for pair in full for one in object_scores(pair, classes=classes)),
    )


def _label(frame: Frame, classes: ClassSet, params: Params, iterations: Sequence[int]) -> LabelledPairs:
    image = frame.images[0]
    masks, camera = image.masks, image.camera
    if masks is None or frame.truth is None:
        raise InputError(f"frame {frame.name}: has no {'masks' if masks is None else 'truth'}; both are needed")
    full, paper = (segment(frame.points, masks, camera, params=each) for each in (params, Params.paper(threads=1)))
    found, confidence = compare(full, paper, frame.truth, classes), {PAPER: paper.confidence, FULL: full.confidence}
    truth = _rows(frame.truth, full.in_view)
    names = [mask.name for mask in masks]
    ranges_m = ranges_of(frame.points[full.in_view])

    def pair(labels: NDArray[np.int32], sure: NDArray[np.float32] | None = None) -> Pair:
        labeling = Labeling.from_instance_labels(labels[full.in_view], names)
        return Pair(frame.name, labeling, truth, ranges_m, None if sure is None else sure[full.in_view])

    def after(count: int) -> NDArray[np.int32]:
        return segment(frame.points, masks, camera, params=replace(params, iterations=count)).labels

    return LabelledPairs(
        methods={name: pair(labels, confidence.get(name)) for name, labels in found.items()},
        iterations={count: pair(after(count)) for count in iterations},
    )


def _rows(labeling: Labeling, rows: NDArray[np.int64]) -> Labeling:
    return Labeling(labeling.classes[rows], labeling.instances[rows], labeling.ignored[rows], labeling.names)
