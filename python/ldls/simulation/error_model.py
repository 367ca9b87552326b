"""Errors of segmenters and sensors, by their strengths; every strength of 0 means perfect."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from ldls.checks import hold_python_values
from ldls.errors import ParameterError


@dataclass(frozen=True, kw_only=True)
class SegmenterErrors:
    """Errors of an image segmenter.

    Attributes:
        mask_cells: A mask is drawn on this many cells across its box and enlarged, as networks do; 0 for pixels.
        box_slip: Each side of the box is off by this share of the box's side (standard deviation).
        bleed_px: Mean distance by which a mask reaches over the object's edge, in pixels; each instance has its own.
        bleed_cells: How much further a mask reaches on average, in cells of which 28 make the shorter side of its box:
            the larger an object, the coarser a network draws it.
        ragged_px: How far an edge wavers, in pixels (standard deviation); never more than a quarter of the object.
        missed: Probability that a large, wholly visible object is not found; small ones up to six times
            that, hidden ones three times.
        merged: Probability that an object whose box meets that of another of its category is found as one with it.
        invented: How many things an image has, on average, that are not there.
        wrong_class: Probability of a wrong category.
        score_noise: How far scores fall below what the size of an object deserves (standard deviation).
    """

    mask_cells: int = 28
    box_slip: float = 0.02
    bleed_px: float = 1.8
    bleed_cells: float = 0.3
    ragged_px: float = 1.0
    missed: float = 0.05
    merged: float = 0.05
    invented: float = 0.4
    wrong_class: float = 0.03
    score_noise: float = 0.08

    def __post_init__(self) -> None:
        _check_strengths(self, probabilities=("missed", "merged", "wrong_class"))

    @classmethod
    def none(cls) -> SegmenterErrors:
        """Of a perfect segmenter."""
        return cls(**{f.name: 0 for f in fields(cls)})


@dataclass(frozen=True, kw_only=True)
class SensorErrors:
    """Errors of a calibration and of a pair of clocks.

    Attributes:
        rotation_deg: Angle of the calibration's error, about an axis drawn from the seed, in degrees.
        translation_m: Length of the calibration's error, in a direction drawn from the seed, in metres.
        delay_s: The sweep is this much later than the image, in seconds; may be negative. Objects move in between.
    """

    rotation_deg: float = 0.25
    translation_m: float = 0.03
    delay_s: float = 0.03

    def __post_init__(self) -> None:
        _check_strengths(self, signed=("delay_s",))

    @classmethod
    def none(cls) -> SensorErrors:
        """Of perfect sensors."""
        return cls(rotation_deg=0, translation_m=0, delay_s=0)

    def drift(self, seed: int) -> NDArray[np.float64]:
        """(4, 4) error of the calibration that a user is given, to be applied after the true transform."""
        axis, direction = (v / np.linalg.norm(v) for v in np.random.default_rng((seed, 1)).normal(size=(2, 3)))
        error = np.eye(4)
        error[:3, :3] = _rotation(axis, np.radians(self.rotation_deg))
        error[:3, 3] = self.translation_m * direction
        return error


def _rotation(axis: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """(3, 3) rotation about a unit axis, by Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turn: NDArray[np.float64] = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return turn


def _check_strengths(
    errors: SegmenterErrors | SensorErrors, *, probabilities: tuple[str, ...] = (), signed: tuple[str, ...] = ()
) -> None:
    hold_python_values(errors)
    for field in fields(errors):
        value = getattr(errors, field.name)
        low, high = (-np.inf if field.name in signed else 0), (1 if field.name in probabilities else np.inf)
        if not (np.isfinite(value) and low <= value <= high):
            raise ParameterError(f"{field.name}: got {value}, expected a finite number from {low} to {high}")
