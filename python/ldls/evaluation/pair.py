"""Prediction and truth of one frame, side by side."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ldls.checks import checked, numbers
from ldls.cloud import Points
from ldls.errors import InputError, ShapeError, within
from ldls.evaluation.classes import ClassSet
from ldls.labeling import Labeling


@checked
@dataclass(frozen=True, eq=False)
class Pair:
    """Prediction and truth of one frame.

    Attributes:
        name: Name of the frame.
        prediction: Labels of the N points by a method.
        truth: Their true labels.
        ranges_m: (N,) distance of each point from the lidar in metres, where it is known. Points whose distance is not
            finite then do not count.
        confidence: (N,) confidence in each predicted label, 0 to 1, where the method tells one.

    Raises:
        ShapeError: The lengths differ.
        InputError: A confidence is not from 0 to 1.
    """

    name: str
    prediction: Labeling
    truth: Labeling
    ranges_m: NDArray[np.floating] | None = None
    confidence: NDArray[np.floating] | None = None

    def __post_init__(self) -> None:
        n_predicted, n_true = len(self.prediction), len(self.truth)
        if n_predicted != n_true:
            raise ShapeError(
                f"frame {self.name}: prediction has {n_predicted:,} points, truth {n_true:,}; "
                "both must label the whole cloud in its order"
            )
        with within(f"frame {self.name}"):
            for name in ("ranges_m", "confidence"):
                if getattr(self, name) is not None:
                    object.__setattr__(self, name, numbers(name, getattr(self, name), np.float64, (n_true,)).copy())
        if self.confidence is not None and not ((self.confidence >= 0) & (self.confidence <= 1)).all():
            raise InputError(f"frame {self.name}: expected confidence from 0 to 1")

    @checked
    def mapped(self, classes: ClassSet, *, max_range_m: float | None = None) -> Pair:
        """This pair in the vocabulary of `classes`; points farther than `max_range_m` are ignored.

        Raises:
            InputError: Truth holds an unknown class, or a range is asked for and none is known.
        """
        with within(f"frame {self.name}"):
            truth = classes.map(self.truth, truth=True)
        if self.ranges_m is not None:
            farthest = np.finfo(np.float64).max if max_range_m is None else max_range_m
            truth = truth.restricted(np.asarray(self.ranges_m) <= farthest)
        elif max_range_m is not None:
            raise InputError(f"max_range_m: frame {self.name} has no ranges of its points; give its ranges_m=")
        return replace(self, prediction=classes.map(self.prediction), truth=truth)


def ranges_of(points: Points) -> NDArray[np.float64]:
    """(N,) distances of the points from the lidar, in metres."""
    distances: NDArray[np.float64] = np.linalg.norm(points[:, :3].astype(np.float64), axis=1)
    return distances
