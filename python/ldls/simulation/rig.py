"""Rigs: a lidar at its height, and the cameras around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ldls.errors import ParameterError
from ldls.simulation.cameras import KITTI, NUSCENES, NUSCENES_BACK, ROBOT, MountedCamera
from ldls.simulation.lidars import LIDARS, Lidar


@dataclass(frozen=True)
class Rig:
    """A lidar and its cameras, the one that looks ahead first.

    Attributes:
        lidar: The lidar.
        height_m: Its height above the ground, in metres.
        cameras: The cameras; `cameras[0]` looks ahead.
    """

    lidar: Lidar
    height_m: float
    cameras: tuple[MountedCamera, ...]


def _ring() -> tuple[MountedCamera, ...]:
    """Six cameras on a circle of 0.6 m: front, front left, back left, back, back right, front right."""
    turns = (0.0, 55.0, 110.0, 180.0, -110.0, -55.0)
    places = [(0.6 * np.cos(a), 0.6 * np.sin(a), -0.3) for a in np.radians(turns)]
    models = [NUSCENES_BACK if yaw == 180.0 else NUSCENES for yaw in turns]
    return tuple(
        MountedCamera(model, (float(x), float(y), z), yaw)
        for model, (x, y, z), yaw in zip(models, places, turns, strict=True)
    )


MOUNTS: dict[str, tuple[float, tuple[MountedCamera, ...]]] = {
    "kitti": (1.73, (MountedCamera(KITTI, (0.27, 0.06, -0.08)),)),
    "robot": (0.75, (MountedCamera(ROBOT, (0.10, 0.0, -0.12)),)),
    "ring": (1.84, _ring()),
}
"""Height of the lidar and the cameras, by the name that `ldls simulate --camera` takes."""


def make_rig(*, lidar: str = "hdl-64e", camera: str = "kitti") -> Rig:
    """A rig by the names of its lidar and of its cameras.

    Raises:
        ParameterError: A name is unknown.
    """
    if lidar not in LIDARS:
        raise ParameterError(f"lidar: got {lidar!r}, expected one of {', '.join(LIDARS)}")
    if camera not in MOUNTS:
        raise ParameterError(f"camera: got {camera!r}, expected one of {', '.join(MOUNTS)}")
    return Rig(LIDARS[lidar], *MOUNTS[camera])
