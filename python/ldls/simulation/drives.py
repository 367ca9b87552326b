"""Drives through one scene, in which objects move, ten frames a second: a car's, and a robot's.

Objects move straight on and do not mind one another. The rig stays upright. All stands still during a sweep, or the
lidar spins: then all moves during the 0.1 s of its turn. The world of a drive's poses is the lidar's own frame at the
first sweep.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ldls.camera.extrinsic import turn_of
from ldls.camera.rigid import from_parts, inverse
from ldls.checks import checked, hold_python_values
from ldls.errors import ParameterError
from ldls.simulation.error_model import SegmenterErrors, SensorErrors
from ldls.simulation.ground import Ground
from ldls.simulation.lidars import VLP_16
from ldls.simulation.plan import Plan
from ldls.simulation.rigs import ROBOT_LENS, MountedCamera, Rig, make_rig
from ldls.simulation.scanning import Motion
from ldls.simulation.scene_object import SceneObject
from ldls.simulation.scenes import Scene, build, make_plan, make_scene
from ldls.simulation.simulated_frame import SimulatedFrame, take_frame

PERIOD_S = 0.1
"""Time from sweep to sweep, and of a turn of a lidar that spins."""
SPEED_M_S = 5.0
LONGEST_M = 40.0
"""Longest way of a drive, for scenes end; longer drives go slower."""
FASTEST_TURN_DEG_S = 90.0
CLEAR_M = 1.5
"""Nothing comes nearer to the lidar than this."""
ROBOT = Rig(VLP_16, 0.75, (MountedCamera(ROBOT_LENS, (0.10, 0.0, -0.12)),))
"""A VLP-16 over a camera with a lens."""
ROBOT_SEGMENTER = SegmenterErrors(wrong_class=0)
"""Gives whatever it finds its right category: a drive is there to look at, and a wrong name passes from the mask to all
points of the object, whatever the method does."""
ROBOT_SPEED_M_S = 1.2
ROBOT_IMAGE_DELAY_S = 0.012
"""Time from a robot's sweep to its image."""


@checked
@dataclass(frozen=True, kw_only=True)
class Drive:
    """A car's drive: what would come too near to the rig is taken away before.

    The rig keeps its height above the ground, and stands still between an image and the stamp of its sweep.

    Attributes:
        n_frames: Number of frames.
        seed: Seed of the scene and all noise.
        kind: `street` or `campus`.
        lidar: Name of a lidar.
        camera: Name of a camera; a ring has more than KITTI's raw layout takes.
        segmenter: Errors of the masks.
        sensors: Errors of calibration and clocks, the same in all frames.
        turn_deg_s: Degrees a second by which the rig turns to the left all the way, -90 to 90.
        spinning: The lidar takes 0.1 s for a sweep, while rig and objects move. It turns clockwise seen from above,
            from behind to behind, as KITTI's does, and looks ahead at the stamp of the sweep.

    Raises:
        ParameterError: There is no frame, the seed is negative, the rig turns too fast, or the camera is a ring.
        InputError: An argument is of another type.
    """

    n_frames: int = 20
    seed: int = 0
    kind: str = "street"
    lidar: str = "hdl-64e"
    camera: str = "kitti"
    segmenter: SegmenterErrors = field(default_factory=SegmenterErrors)
    sensors: SensorErrors = field(default_factory=SensorErrors)
    turn_deg_s: float = 0.0
    spinning: bool = False

    def __post_init__(self) -> None:
        hold_python_values(self)
        if self.n_frames < 1:
            raise ParameterError(f"n_frames: got {self.n_frames}, expected 1 or more")
        if self.seed < 0:
            raise ParameterError(f"seed: got {self.seed}, expected 0 or more")
        if not abs(self.turn_deg_s) <= FASTEST_TURN_DEG_S:
            limit = f"{FASTEST_TURN_DEG_S:g} degrees a second"
            raise ParameterError(f"turn_deg_s: got {self.turn_deg_s}, expected -{limit} to {limit}")
        if len(self.rig().cameras) > 1:
            raise ParameterError(f"camera: got {self.camera!r}, expected kitti or robot, for a drive has one camera")

    @property
    def speed_m_s(self) -> float:
        """Speed of the rig, in metres a second."""
        return min(SPEED_M_S, LONGEST_M / (self.n_frames * PERIOD_S))

    def rig(self) -> Rig:
        """Lidar and camera."""
        return make_rig(lidar=self.lidar, camera=self.camera)


@checked
def drive_frame(drive: Drive, number: int) -> SimulatedFrame:
    """Frame `number` of a drive, from 0; the same every time.

    Raises:
        ParameterError: There is no such frame.
        ImportError: `ldls[sim]` is not installed.
    """
    if not 0 <= number < drive.n_frames:
        raise ParameterError(f"number: got {number}, expected 0 to {drive.n_frames - 1}")
    plan = drive_plan(drive)
    poses = _poses(drive, plan.ground, _sweep_seconds(drive))
    taken, seed = number * PERIOD_S, 1000 * drive.seed + number
    swept = taken + drive.sensors.delay_s
    world, pose = build(plan), poses[number]
    photographed, motion = _from_the_rig(world, plan.ground, taken, pose), None
    scanned = photographed.after(drive.sensors.delay_s)
    if drive.spinning:
        scanned = _from_the_rig(world, plan.ground, swept, pose)
        motion = _motion(drive, world, plan.ground, number)
    return take_frame(
        photographed,
        scanned,
        drive.rig(),
        name=f"{number:010d}",
        stamps=(taken, swept),
        sweep_noise=(seed, 0),
        mask_seed=seed,
        drift=drive.sensors.drift(drive.seed),
        pose=pose,
        segmenter=drive.segmenter,
        motion=motion,
    )


def drive_plan(drive: Drive) -> Plan:
    """What stands and moves in a drive, without what would come too near to the rig; a longer one may have less.

    Raises:
        ParameterError: There is no such kind of scene.
    """
    plan = make_plan(drive.seed, kind=drive.kind)
    way_m = _poses(drive, plan.ground, _sweep_seconds(drive))[:, :2, 3]
    plan.remove({m for m, thing in enumerate(plan.objects, start=1) if _nearest_m(thing, way_m) < CLEAR_M})
    plan.clear(way_m, CLEAR_M)
    return plan


def drive_poses(drive: Drive) -> NDArray[np.float64]:
    """(n_frames, 4, 4) true T_world_lidar at each sweep of a drive.

    Raises:
        ParameterError: There is no such kind of scene.
    """
    return poses_after(drive, _sweep_seconds(drive))


def poses_after(drive: Drive, seconds: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 4, 4) true T_world_lidar of a drive, so many seconds (n,) after its first sweep; of any time.

    Raises:
        ParameterError: There is no such kind of scene.
    """
    return _poses(drive, make_plan(drive.seed, kind=drive.kind).ground, seconds)


def robot_drive(
    frames: int,
    *,
    seed: int = 0,
    segmenter: SegmenterErrors | None = None,
    spinning: bool = False,
) -> Iterator[SimulatedFrame]:
    """The frames of a robot's drive along x through a campus; its calibration has no error.

    Objects do not make way, so keep it to some seconds. Stamps count from the begin of the drive.

    Args:
        frames: Number of frames.
        seed: Seed of the scene and its noise.
        segmenter: Errors of the masks; by default the usual ones, but for wrong categories.
        spinning: The lidar takes 0.1 s for a sweep while all moves, as in a `Drive`.

    Raises:
        ParameterError: `frames` is below 1.
        ImportError: `ldls[sim]` is not installed.
    """
    if frames < 1:
        raise ParameterError(f"frames: got {frames}, expected 1 or more")
    scene = make_scene(seed, kind="campus")
    for number in range(frames):
        swept = number * PERIOD_S
        taken = swept + ROBOT_IMAGE_DELAY_S
        yield take_frame(
            _from_the_robot(scene, taken),
            _from_the_robot(scene, swept),
            ROBOT,
            name=f"{number:06d}",
            stamps=(taken, swept),
            sweep_noise=(seed, 0, number),
            mask_seed=seed + 7919 * number,
            drift=np.eye(4),
            pose=from_parts(np.eye(3), np.array([ROBOT_SPEED_M_S * swept, 0, 0])),
            segmenter=ROBOT_SEGMENTER if segmenter is None else segmenter,
            motion=_robot_motion(scene) if spinning else None,
            moved=False,
        )


def _from_the_robot(scene: Scene, seconds: float) -> Scene:
    """The scene at a time, its origin below the robot that has driven on."""
    way = [ROBOT_SPEED_M_S * seconds, 0.0, 0.0]
    return scene.after(seconds).moved(-np.tile(way, (len(scene.objects) + 1, 1)))


def _robot_motion(scene: Scene) -> Motion:
    """What moves on straight is the same in all turns."""
    times = ROBOT.lidar.firing_times(PERIOD_S)
    rig = np.tile(np.eye(4), (len(times), 1, 1))
    rig[:, 0, 3] = ROBOT_SPEED_M_S * times
    ways = np.zeros((len(scene.objects), len(times), 3))
    velocities = np.array([thing.velocity_m_s for thing in scene.objects]).reshape(-1, 1, 2)
    ways[:, :, :2] = velocities * times[:, None]
    return Motion(times, rig, ways)


def _sweep_seconds(drive: Drive) -> NDArray[np.float64]:
    return PERIOD_S * np.arange(drive.n_frames, dtype=np.float64)


def _poses(drive: Drive, ground: Ground, seconds: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 4, 4) from the ground below the rig so long after the first sweep to that at it; the lidar is as high above.

    The way is an arc: its chord leads where the rig heads at half of the time.
    """
    yaw = np.radians(drive.turn_deg_s) * seconds
    chord_m = drive.speed_m_s * seconds * np.sinc(yaw / (2 * np.pi))
    x_m, y_m = chord_m * np.cos(yaw / 2), chord_m * np.sin(yaw / 2)
    places = np.stack([x_m, y_m, ground.height_m(x_m, y_m)], axis=1)
    return np.array([from_parts(turn_of(0, 0, turn), place) for turn, place in zip(yaw, places, strict=True)])


def _motion(drive: Drive, world: Scene, ground: Ground, number: int) -> Motion:
    """Rig and objects during the turn of a sweep, as seen from the rig at its stamp."""
    times = drive.rig().lidar.firing_times(PERIOD_S)
    since = number * PERIOD_S
    (pose,) = _poses(drive, ground, np.array([since]))
    swept = since + drive.sensors.delay_s
    ways = np.array([_moved_m(o, ground, swept + times) - _moved_m(o, ground, swept) for o in world.objects])
    rig = inverse(pose) @ _poses(drive, ground, since + times)
    return Motion(times, rig, ways.reshape(-1, len(times), 3) @ pose[:3, :3])


def _from_the_rig(scene: Scene, ground: Ground, seconds: float, pose: NDArray[np.float64]) -> Scene:
    """The scene `seconds` later, seen from the pose of the rig; objects keep to the ground."""
    by_m = np.zeros((len(scene.objects) + 1, 3))
    by_m[1:] = [_moved_m(thing, ground, seconds) for thing in scene.objects]
    return scene.moved(by_m - pose[:3, 3]).turned(-float(np.arctan2(pose[1, 0], pose[0, 0])))


def _moved_m(thing: SceneObject, ground: Ground, seconds: float | NDArray[np.float64]) -> NDArray[np.float64]:
    """(..., 3) way of an object that keeps to the ground, after so many seconds (...)."""
    (x, y, _), (vx, vy) = thing.centre_m, thing.velocity_m_s
    dx, dy = np.multiply(vx, seconds), np.multiply(vy, seconds)
    return np.stack([dx, dy, ground.height_m(x + dx, y + dy) - ground.height_m(x, y)], axis=-1)


def _nearest_m(thing: SceneObject, way_m: NDArray[np.float64]) -> float:
    """Least distance between the lidar's axis, at the places (n, 2) of the frames, and the box of an object."""
    seconds = PERIOD_S * np.arange(len(way_m), dtype=np.float64)
    (x, y, _), (vx, vy) = thing.centre_m, thing.velocity_m_s
    towards = np.stack([x + vx * seconds, y + vy * seconds]) - way_m.T
    c, s = np.cos(thing.yaw), np.sin(thing.yaw)
    along, across = np.abs(np.array([[c, s], [-s, c]]) @ towards)
    beyond = np.maximum([along - thing.length_m / 2, across - thing.width_m / 2], 0)
    return float(np.hypot(*beyond).min())
