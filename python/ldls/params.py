"""The parameters of the method."""

from __future__ import annotations

import operator
from dataclasses import dataclass

import ldls._ldls as _ldls
from ldls.errors import ParameterError


@dataclass(frozen=True, kw_only=True)
class Params:
    """Parameters of the method; the defaults are the paper's. Checked when made.

    Attributes:
        neighbors: K, the nearest neighbours that every point is joined to; 1 to 255.
        sigma: sigma of the weight exp(-d^2 / sigma) of the edge between two points, in square metres.
        pixel_weight: lambda, the weight of an edge from a pixel to a point.
        window: Side in pixels of the square window that joins pixels to a point; odd, 1 to 101.
        iterations: Number of products z <- A z + b, 1 to 100000; `None` for the converged solution.
        remove_outliers: Whether an instance keeps only its largest connected component.
        threads: Threads to use; `None` for the environment variable `LDLS_NUM_THREADS` or else all cores that the
            process may use. Results do not depend on it.

    Raises:
        ParameterError: A value is out of range or of the wrong type.
    """

    neighbors: int = 10
    sigma: float = 1.0
    pixel_weight: float = 0.001
    window: int = 5
    iterations: int | None = 200
    remove_outliers: bool = True
    threads: int | None = None

    def __post_init__(self) -> None:
        for name in ("neighbors", "window"):
            check_whole_number(name, getattr(self, name))
        for name in ("iterations", "threads"):
            if getattr(self, name) is not None:
                check_whole_number(name, getattr(self, name))
        for name in ("sigma", "pixel_weight"):
            _number(name, getattr(self, name))
        if not isinstance(self.remove_outliers, bool):
            raise ParameterError(f"remove_outliers: got {self.remove_outliers!r}, expected a bool")
        _ldls.check_params(self.as_tuple(), self.threads)

    @classmethod
    def paper(cls) -> Params:
        """The parameters of Wang et al. 2019, which are the defaults."""
        return cls()

    def as_tuple(self) -> tuple[int, float, float, int, int | None, bool]:
        """The parameters of the core, in its order."""
        return (
            self.neighbors,
            self.sigma,
            self.pixel_weight,
            self.window,
            self.iterations,
            self.remove_outliers,
        )


def check_whole_number(name: str, value: object) -> None:
    """Refuse what is no whole number from 0 to 2^31 - 1.

    Raises:
        ParameterError: `value` is another one, or of another type; bool counts as such.
    """
    try:
        number = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        raise ParameterError(f"{name}: got {value!r}, expected a whole number") from None
    if isinstance(value, bool) or not 0 <= number < 2**31:
        raise ParameterError(f"{name}: got {value!r}, expected a whole number in range")


def _number(name: str, value: object) -> None:
    try:
        float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise ParameterError(f"{name}: got {value!r}, expected a number") from None
