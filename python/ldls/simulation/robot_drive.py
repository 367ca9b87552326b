"""A robot that drives through a campus: sweeps and photographs at their own times, and the truth of both."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ldls.errors import ParameterError
from ldls.masks import InstanceMasks
from ldls.simulation.errors import SegmenterErrors
from ldls.simulation.lenses import ROBOT_LENS
from ldls.simulation.lidars import VLP_16
from ldls.simulation.photograph import photograph
from ldls.simulation.raycasting import RayCaster
from ldls.simulation.rig import Rig
from ldls.simulation.scanning import Sweep, scan
from ldls.simulation.scenes import Scene, make_scene
from ldls.simulation.segmenting import segmented, true_masks

ROBOT = Rig(VLP_16, 0.75, (ROBOT_LENS,))
"""A VLP-16 over a camera with a lens."""
PERIOD_S = 0.1
IMAGE_DELAY_S = 0.012
"""How much later than its sweep an image is taken."""
SPEED_M_S = 1.2


@dataclass(frozen=True, eq=False)
class Moment:
    """A sweep of the drive, and the image after it.

    Attributes:
        seconds: Time of the sweep since the drive began.
        travelled_m: How far the robot has come.
        sweep: The sweep, in the lidar's frame.
        categories: (N,) int32 COCO id of each of its points, 0 for background.
        image: (H, W, 3) uint8 RGB, as the lens shows it.
        masks: What a segmenter finds in it.
        true_masks: Masks of every object that it shows.
    """

    seconds: float
    travelled_m: float
    sweep: Sweep
    categories: NDArray[np.int32]
    image: NDArray[np.uint8]
    masks: InstanceMasks
    true_masks: InstanceMasks


def robot_drive(
    frames: int, *, seed: int = 0, rig: Rig = ROBOT, segmenter: SegmenterErrors | None = None
) -> Iterator[Moment]:
    """The moments of a drive along x, ten a second; people and vehicles move on meanwhile.

    While a sweep is taken the scene stands still. Objects do not make way, so keep it to some seconds.

    Args:
        frames: How many.
        seed: Which scene, and which noise.
        rig: Lidar and camera.
        segmenter: How wrong the masks are; `SegmenterErrors()` by default.

    Raises:
        ParameterError: `frames` is below 1.
        ImportError: `ldls[sim]` is not installed.
    """
    if frames < 1:
        raise ParameterError(f"frames: got {frames}, expected 1 or more")
    scene = make_scene(seed, kind="campus")
    for number in range(frames):
        yield _moment(scene, number, seed, rig, segmenter)


def _moment(scene: Scene, number: int, seed: int, rig: Rig, segmenter: SegmenterErrors | None) -> Moment:
    seconds = number * PERIOD_S
    scanned, photographed = (_as_seen(scene, seconds + delay) for delay in (0.0, IMAGE_DELAY_S))
    noise = np.random.default_rng((seed, 0, number))
    sweep = scan(scanned, RayCaster(scanned.shape), rig.lidar, rig.height_m, noise)
    image, pixels = photograph(photographed, RayCaster(photographed.shape), rig.cameras[0], rig.height_m)
    return Moment(
        seconds=seconds,
        travelled_m=SPEED_M_S * seconds,
        sweep=sweep,
        categories=np.append(np.int32(0), scene.categories)[sweep.instances].astype(np.int32),
        image=image,
        masks=segmented(pixels, errors=segmenter, seed=seed + 7919 * number),
        true_masks=true_masks(pixels),
    )


def _as_seen(scene: Scene, seconds: float) -> Scene:
    """The scene at a time, its origin below the robot that has driven on."""
    now, way = scene.after(seconds), SPEED_M_S * seconds
    objects = tuple(replace(o, centre_m=(o.centre_m[0] - way, *o.centre_m[1:])) for o in now.objects)
    return replace(now, shape=now.shape.moved((-way, 0.0, 0.0)), objects=objects)
