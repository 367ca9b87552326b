"""Distortion of a lens."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls.checks import as_array, checked_as, numbers
from ldls.errors import CalibrationError

MODELS: dict[str, tuple[int, ...]] = {
    "none": (0,),
    "plumb_bob": (4, 5),
    "rational_polynomial": (8, 12, 14),
    "equidistant": (4,),
}
"""Coefficients of each: k1 k2 p1 p2 (k3) (k4 k5 k6) (s1 s2 s3 s4) (tx ty), and k1 k2 k3 k4 of the fisheye."""

SPELLINGS = {
    "": "none", "pinhole": "none", "radtan": "plumb_bob", "brown": "plumb_bob", "rational": "rational_polynomial",
    "fisheye": "equidistant", "kannala_brandt": "equidistant", "kb4": "equidistant", "equi": "equidistant",
}  # fmt: skip
"""Names that Kalibr, OpenCV and others give to the models of ROS."""


@checked_as(CalibrationError)
@dataclass(frozen=True)
class Distortion:
    """Lens distortion by the models of ROS and OpenCV.

    Beyond the angle from the axis at which a model folds back on itself, points are not in view.

    Attributes:
        model: "none" (a pinhole, or a rectified image), "plumb_bob", "rational_polynomial" or "equidistant" (fisheye).
        coefficients: k1 k2 p1 p2 k3, of the rational polynomial also k4 k5 k6, a thin prism's s1 s2 s3 s4 and a tilted
            sensor's angles tx ty in radians; or k1 k2 k3 k4 of the fisheye.

    Raises:
        CalibrationError: The model is unknown, or has another number of coefficients, or one is not finite, or that of
            "none" not 0.
    """

    model: str = "none"
    coefficients: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        model = SPELLINGS.get(self.model.strip().lower(), self.model.strip().lower())
        values = _finite(self.coefficients)
        if model not in MODELS:
            raise CalibrationError(
                f"distortion: model {self.model!r} is unknown, expected one of {', '.join(MODELS)}; undistort the "
                "images and leave it out if your camera has another"
            )
        # an empty D means that there is none, under any model's name
        if len(values) == 0:
            model = "none"
        if model == "plumb_bob" and len(values) in MODELS["rational_polynomial"]:
            model = "rational_polynomial"  # as OpenCV, which has one model of as many coefficients as there are
        if model == "none" and any(values):
            raise CalibrationError(
                f"distortion: model {self.model!r} has no coefficients, got {values}; name one of "
                f"{', '.join(list(MODELS)[1:])}, or leave them out where the image is undistorted"
            )
        if model != "none" and len(values) not in MODELS[model]:
            expected = " or ".join(map(str, MODELS[model]))
            raise CalibrationError(f"distortion: {model} has {expected} coefficients, got {len(values)}")
        object.__setattr__(self, "model", model)
        object.__setattr__(self, "coefficients", values if model != "none" else ())

    @classmethod
    @checked_as(CalibrationError)
    def from_opencv(cls, coefficients: ArrayLike, *, fisheye: bool = False) -> Self:
        """Distortion from OpenCV's `distCoeffs` of 4, 5, 8, 12 or 14 numbers, or the 4 of `cv2.fisheye`."""
        values = _finite(coefficients)
        return cls("equidistant" if fisheye else "plumb_bob", values)

    @property
    def is_none(self) -> bool:
        """True if the image is that of a pinhole."""
        return self.model == "none" or (not any(self.coefficients) and self.model != "equidistant")

    def as_core(self) -> tuple[str, NDArray[np.float64]]:
        """The model and coefficients as the core takes them: `plumb_bob` is a rational one without denominator."""
        if self.is_none:
            return "none", np.zeros(0)
        if self.model == "equidistant":
            return "equidistant", np.array(self.coefficients)
        return "rational", np.concatenate([self.coefficients, np.zeros(14 - len(self.coefficients))])


def _finite(coefficients: ArrayLike) -> tuple[float, ...]:
    values = as_array("distortion", coefficients, CalibrationError).ravel()
    values = numbers("distortion", values, np.float64, ("n",), error=CalibrationError)
    if not np.isfinite(values).all():
        raise CalibrationError(f"distortion: expected finite coefficients, got {tuple(values.tolist())}")
    return tuple(values.tolist())
