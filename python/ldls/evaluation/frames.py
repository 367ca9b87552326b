"""Pairs of labelings read from files, one frame at a time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.cloud import Points
from ldls.evaluation.formats import FORMATS, guess_format, read_labeling
from ldls.evaluation.frame_inputs import FrameInputs, ranges_of
from ldls.evaluation.pair import Pair
from ldls.evaluation.pairing import FrameFiles
from ldls.evaluation.squeezeseg import read_squeezeseg_ranges
from ldls.labeling import Labeling


def read_pairs(
    files: Iterable[FrameFiles],
    *,
    prediction_format: str | None = None,
    truth_format: str | None = None,
    inputs: FrameInputs | None = None,
) -> Iterator[Pair]:
    """Prediction and truth of each frame; with `ranges_m` where points are given or SqueezeSeg's truth has them.

    Raises:
        FileFormatError: A file is broken.
        InputError: A format needs points or calibration that `inputs` does not name.
        ShapeError: Prediction and truth of a frame differ in length.
    """
    inputs = inputs or FrameInputs()
    for frame in files:
        points = None if inputs.points is None else inputs.read_points(frame.name)
        prediction = _read(frame.name, frame.prediction, prediction_format, inputs, points)
        truth = _read(frame.name, frame.truth, truth_format, inputs, points)
        yield Pair(frame.name, prediction, truth, _ranges(frame, truth_format, points))


def _read(name: str, path: Path, format: str | None, inputs: FrameInputs, points: Points | None) -> Labeling:
    chosen = format or guess_format(path)
    if not FORMATS[chosen].needs_points:
        return read_labeling(path, format=chosen)
    cloud = inputs.read_points(name) if points is None else points
    return read_labeling(path, format=chosen, points=cloud, camera=inputs.read_camera(name))


def _ranges(frame: FrameFiles, truth_format: str | None, points: Points | None) -> NDArray[np.float64] | None:
    if points is not None:
        return ranges_of(points)
    if (truth_format or guess_format(frame.truth)) == "squeezeseg":
        return read_squeezeseg_ranges(frame.truth)
    return None
