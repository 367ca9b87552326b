"""A drive: the rig goes straight through one scene, in which objects move, and takes ten frames a second.

Objects move straight on and do not mind one another; those that would come too near to the rig are taken away before.
The rig stays upright, at its height above the ground, and stands still between an image and its sweep.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ldls.errors import ParameterError
from ldls.simulation.errors import SegmenterErrors, SensorErrors
from ldls.simulation.frame import SceneFrame, frame_of
from ldls.simulation.ground import Ground
from ldls.simulation.objects import SceneObject
from ldls.simulation.plan import Plan
from ldls.simulation.rig import Rig, make_rig
from ldls.simulation.scenes import Scene, build, make_plan

PERIOD_S = 0.1
SPEED_M_S = 5.0
LONGEST_M = 40.0
"""How far a drive goes at most, for scenes end; longer ones go slower."""
CLEAR_M = 1.5
"""No object comes nearer to the lidar than this."""


@dataclass(frozen=True, kw_only=True)
class Drive:
    """A drive to be made.

    Attributes:
        n_frames: How many frames it has.
        seed: Seed of the scene and all noise.
        kind: `street` or `campus`.
        lidar: Name of a lidar.
        camera: Name of a camera; a ring has more than KITTI's raw layout takes.
        segmenter: How wrong the masks are.
        sensors: How wrong calibration and clocks are, the same in all frames.

    Raises:
        ParameterError: There is no frame, or the camera is a ring.
    """

    n_frames: int = 20
    seed: int = 0
    kind: str = "street"
    lidar: str = "hdl-64e"
    camera: str = "kitti"
    segmenter: SegmenterErrors = field(default_factory=SegmenterErrors)
    sensors: SensorErrors = field(default_factory=SensorErrors)

    def __post_init__(self) -> None:
        if self.n_frames < 1:
            raise ParameterError(f"n_frames: got {self.n_frames}, expected 1 or more")
        if len(self.rig().cameras) > 1:
            raise ParameterError(f"camera: got {self.camera!r}, expected kitti or robot, for a drive has one camera")

    @property
    def speed_m_s(self) -> float:
        """How fast the rig goes, in metres a second."""
        return min(SPEED_M_S, LONGEST_M / (self.n_frames * PERIOD_S))

    def rig(self) -> Rig:
        """Lidar and camera."""
        return make_rig(lidar=self.lidar, camera=self.camera)

    def drift(self) -> NDArray[np.float64]:
        """(4, 4) error of the calibration, after the true transform."""
        return self.sensors.calibrated(np.eye(4), np.random.default_rng((self.seed, 1)))


def drive_frame(drive: Drive, number: int) -> SceneFrame:
    """Frame `number` of a drive, from 0; the same every time.

    Raises:
        ParameterError: There is no such frame.
        ImportError: `ldls[sim]` is not installed.
    """
    if not 0 <= number < drive.n_frames:
        raise ParameterError(f"number: got {number}, expected 0 to {drive.n_frames - 1}")
    plan = make_plan(drive.seed, kind=drive.kind)
    plan.remove(in_the_way(drive, plan))
    seconds = number * PERIOD_S
    scene = moment(build(plan), plan.ground, seconds, drive.speed_m_s * seconds)
    return frame_of(
        scene,
        drive.rig(),
        1000 * drive.seed + number,
        drift=drive.drift(),
        delay_s=drive.sensors.delay_s,
        segmenter=drive.segmenter,
    )


def moment(scene: Scene, ground: Ground, seconds: float, way_m: float) -> Scene:
    """The scene `seconds` later, seen from `way_m` farther along x; objects keep to the ground."""
    by_m = np.zeros((len(scene.objects) + 1, 3))
    by_m[1:] = [_moved_m(thing, ground, seconds) for thing in scene.objects]
    return scene.moved(by_m - [way_m, 0.0, ground.height_m(way_m, 0.0)])


def in_the_way(drive: Drive, plan: Plan) -> set[int]:
    """Numbers of the objects that come within `CLEAR_M` of the lidar's axis at any time of the drive."""
    seconds = PERIOD_S * np.arange(drive.n_frames, dtype=np.float64)
    found = enumerate(plan.objects, start=1)
    return {number for number, thing in found if _nearest_m(thing, seconds, drive.speed_m_s) < CLEAR_M}


def _moved_m(thing: SceneObject, ground: Ground, seconds: float) -> tuple[float, float, float]:
    x, y, _ = thing.centre_m
    dx, dy = (speed * seconds for speed in thing.velocity_m_s)
    return dx, dy, ground.height_m(x + dx, y + dy) - ground.height_m(x, y)


def _nearest_m(thing: SceneObject, seconds: NDArray[np.float64], speed_m_s: float) -> float:
    """Least distance between the lidar's axis and the box of an object."""
    (x, y, _), (vx, vy) = thing.centre_m, thing.velocity_m_s
    towards = np.stack([x + (vx - speed_m_s) * seconds, y + vy * seconds])
    c, s = np.cos(thing.yaw), np.sin(thing.yaw)
    along, across = np.abs(np.array([[c, s], [-s, c]]) @ towards)
    beyond = np.maximum([along - thing.length_m / 2, across - thing.width_m / 2], 0)
    return float(np.hypot(*beyond).min())
