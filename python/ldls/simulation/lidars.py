"""Lidars: where their beams point, how often they fire, how they err."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ldls.errors import ParameterError


@dataclass(frozen=True)
class Lidar:
    """A spinning lidar.

    Attributes:
        name: Its name, as `ldls simulate --lidar` takes it.
        elevations_deg: Elevation of each beam, from the highest to the lowest.
        firings: Azimuth steps a turn.
        min_range_m: Nearer returns are not reported.
        max_range_m: Farther returns are not reported.
        range_noise_m: Standard deviation of a range.
        range_step_m: Ranges are reported in multiples of this.
        dropout: Share of returns lost for no reason.
        sensitivity: The return of a surface of reflectance rho, seen at an angle of cosine c from r metres, is lost
            with probability exp(-sensitivity * rho * c * (max_range_m / r)^2): far, dark and grazed surfaces go first.
    """

    name: str
    elevations_deg: tuple[float, ...]
    firings: int
    min_range_m: float
    max_range_m: float
    range_noise_m: float
    range_step_m: float
    dropout: float
    sensitivity: float

    def __post_init__(self) -> None:
        if not self.elevations_deg or self.firings < 1:
            raise ParameterError(
                f"lidar: got {len(self.elevations_deg)} beams and {self.firings} firings, expected some"
            )
        if not 0 <= self.min_range_m < self.max_range_m:
            raise ParameterError(f"lidar: ranges {self.min_range_m} to {self.max_range_m} m, expected rising ones")
        if not (0 <= self.dropout < 1 and self.range_noise_m >= 0 and self.range_step_m >= 0 and self.sensitivity > 0):
            raise ParameterError("lidar: expected dropout in [0, 1), noise and step of 0 or more, sensitivity above 0")

    def directions(self) -> NDArray[np.float64]:
        """(firings * beams, 3) unit vectors as fired: a turn clockwise from behind, beams from the top."""
        azimuth = np.linspace(np.pi, -np.pi, self.firings, endpoint=False)[:, None]
        rise = np.radians(self.elevations_deg)
        flat = np.cos(rise)
        toward = np.broadcast_arrays(np.cos(azimuth) * flat, np.sin(azimuth) * flat, np.sin(rise))
        return np.stack(toward, axis=-1).reshape(-1, 3)

    def firing_times(self, turn_s: float) -> NDArray[np.float64]:
        """(firings,) seconds of each azimuth step, of a turn from behind to behind that looks ahead at 0."""
        return np.linspace(-turn_s / 2, turn_s / 2, self.firings, endpoint=False)

    def rings(self) -> NDArray[np.int32]:
        """(firings * beams,) number of the beam of each direction, 0 the highest."""
        return np.tile(np.arange(len(self.elevations_deg), dtype=np.int32), self.firings)


def _even(high_deg: float, low_deg: float, beams: int) -> tuple[float, ...]:
    return tuple(np.linspace(high_deg, low_deg, beams).tolist())


HDL_64E = Lidar(
    name="hdl-64e",
    elevations_deg=_even(2.0, -8.33, 32) + _even(-8.83, -24.8, 32),
    firings=2083,
    min_range_m=0.9,
    max_range_m=120.0,
    range_noise_m=0.02,
    range_step_m=0.002,
    dropout=0.03,
    sensitivity=12.0,
)
"""Velodyne HDL-64E S2 at 10 Hz, as KITTI's: two blocks of 32 beams, 1/3 and 1/2 degree apart."""

HDL_32E = Lidar(
    name="hdl-32e",
    elevations_deg=_even(10.67, -30.67, 32),
    firings=1085,
    min_range_m=1.0,
    max_range_m=100.0,
    range_noise_m=0.02,
    range_step_m=0.002,
    dropout=0.02,
    sensitivity=10.0,
)
"""Velodyne HDL-32E at 20 Hz, as nuScenes': 1.33 degrees between beams."""

VLP_16 = Lidar(
    name="vlp-16",
    elevations_deg=_even(15.0, -15.0, 16),
    firings=1800,
    min_range_m=0.5,
    max_range_m=100.0,
    range_noise_m=0.015,
    range_step_m=0.002,
    dropout=0.02,
    sensitivity=10.0,
)
"""Velodyne VLP-16 at 10 Hz: 2 degrees between beams, 0.2 degrees a firing."""

OS1_128 = Lidar(
    name="os1-128",
    elevations_deg=_even(22.5, -22.5, 128),
    firings=1024,
    min_range_m=0.5,
    max_range_m=120.0,
    range_noise_m=0.012,
    range_step_m=0.001,
    dropout=0.02,
    sensitivity=10.0,
)
"""Ouster OS1-128 with 1024 columns a turn: 45 degrees, evenly."""

LIDARS: dict[str, Lidar] = {lidar.name: lidar for lidar in (HDL_64E, HDL_32E, VLP_16, OS1_128)}
"""Every lidar by its name."""
