"""A simulated frame: a sweep, the images taken with it, the masks that a segmenter finds in them, and the truth."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera
from ldls.datasets.frame import CameraImage, Frame
from ldls.labeling import Labeling
from ldls.masks import InstanceMasks
from ldls.simulation.error_model import SegmenterErrors, SensorErrors
from ldls.simulation.photograph import PixelTruth, photograph
from ldls.simulation.raycasting import RayCaster
from ldls.simulation.rigs import Rig, make_rig
from ldls.simulation.scanning import Motion, scan, scan_moving
from ldls.simulation.scene_object import CLASS_NAMES, SceneObject
from ldls.simulation.scenes import Scene, make_scene
from ldls.simulation.segmenting import segmented, true_masks


@dataclass(frozen=True, eq=False, kw_only=True)
class SimulatedImage(CameraImage):
    """An image of a simulated frame, "image_2" or, of a ring's other cameras, "image_ring_1" to "image_ring_5".

    `camera` is the calibration that a user is given, with its error, and `masks` are those that a segmenter finds.

    Attributes:
        stamp: Time at which it was taken, in seconds since the scene began.
        true_camera: The calibration without error.
        true_masks: Masks of every object that the image shows.
        pixels: The object of each pixel.
    """

    stamp: float
    masks: InstanceMasks
    true_camera: Camera
    true_masks: InstanceMasks
    pixels: PixelTruth


@dataclass(frozen=True, eq=False, kw_only=True)
class SimulatedFrame(Frame):
    """A simulated frame with its truth; the lidar is at the origin, x ahead, y left, z up, metres.

    `points` are (N, 4) float32 x, y, z and intensity in [0, 1]; instance m of `truth` is `objects[m - 1]`.

    Attributes:
        stamp: Time of the sweep, in seconds since the scene began.
        pose: (4, 4) true T_world_lidar at the time of the sweep; None where there is no drive.
        images: One for each camera, the one that looks ahead first.
        truth: True labels of the points: KITTI's classes or COCO's, and the objects as instances.
        rings: (N,) int32 beam of each point, 0 the highest.
        objects: Objects with their boxes in the lidar frame, at the time of the sweep.
    """

    stamp: float
    images: tuple[SimulatedImage, ...]
    truth: Labeling
    rings: NDArray[np.int32]
    objects: tuple[SceneObject, ...]


def scene_frame(
    seed: int = 0,
    *,
    kind: str = "street",
    rig: Rig | None = None,
    segmenter: SegmenterErrors | None = None,
    sensors: SensorErrors | None = None,
) -> SimulatedFrame:
    """The frame of a seed, the same every time.

    Args:
        seed: Seed of the scene and its noise.
        kind: `street` or `campus`.
        rig: Lidar and cameras; KITTI's by default.
        segmenter: Errors of the masks; `SegmenterErrors()` by default.
        sensors: Errors of calibration and clocks; `SensorErrors()` by default.

    Raises:
        ParameterError: There is no such kind.
        ImportError: `ldls[sim]` is not installed.
    """
    scene, sensors = make_scene(seed, kind=kind), SensorErrors() if sensors is None else sensors
    return take_frame(
        scene,
        scene.after(sensors.delay_s),
        make_rig() if rig is None else rig,
        name=f"{seed:06d}",
        stamps=(0.0, sensors.delay_s),
        sweep_noise=(seed, 0),
        mask_seed=seed,
        drift=sensors.drift(seed),
        segmenter=segmenter,
    )


def take_frame(
    photographed: Scene,
    scanned: Scene,
    rig: Rig,
    *,
    name: str,
    stamps: tuple[float, float],
    sweep_noise: tuple[int, ...],
    mask_seed: int,
    drift: NDArray[np.float64],
    pose: NDArray[np.float64] | None = None,
    segmenter: SegmenterErrors | None = None,
    moved: bool = True,
    motion: Motion | None = None,
) -> SimulatedFrame:
    """The frame that a rig at the origin of the scenes takes.

    Args:
        photographed: The scene at the time of the images.
        scanned: The scene at the time of the sweep.
        rig: Lidar and cameras.
        name: Name of the frame.
        stamps: Times of images and sweep, in seconds.
        sweep_noise: Seed of the noise of the sweep.
        mask_seed: Seed of the errors of the masks.
        drift: (4, 4) error of the calibration, after the true transform.
        pose: (4, 4) T_world_lidar at the time of the sweep, in a drive.
        segmenter: Errors of the masks; `SegmenterErrors()` by default.
        moved: True if calibrations hold from the lidar at the time of the sweep to the camera at that of the images, as
            they do where the rig stands still between them.
        motion: Where rig and objects are at each firing of the lidar; by default all stands still during the sweep.

    Raises:
        ImportError: `ldls[sim]` is not installed.
    """
    camera_rays = RayCaster(photographed.shape)
    rng = np.random.default_rng(sweep_noise)
    if motion is None:
        pulses = camera_rays if scanned is photographed else RayCaster(scanned.shape)
        sweep = scan(scanned, pulses, rig.lidar, rig.height_m, rng)
    else:
        sweep = scan_moving(scanned, rig.lidar, rig.height_m, motion, rng)
    images = []
    for k, mounted in enumerate(rig.cameras):
        rgb, pixels = photograph(photographed, camera_rays, mounted, rig.height_m)
        true_camera = mounted.calibration()
        image = SimulatedImage(
            name=f"image_ring_{k}" if k else "image_2",
            camera=replace(true_camera, T_camera_lidar=drift @ true_camera.T_camera_lidar),
            read=rgb.copy,
            stamp=stamps[0],
            masks=segmented(pixels, errors=segmenter, seed=mask_seed + 7919 * k),
            true_camera=true_camera,
            moved=moved,
            true_masks=true_masks(pixels),
            pixels=pixels,
        )
        images.append(image)
    return SimulatedFrame(
        name=name,
        points=sweep.points,
        stamp=stamps[1],
        pose=pose,
        images=tuple(images),
        truth=Labeling.from_instance_labels(sweep.instances, [CLASS_NAMES[o.category] for o in scanned.objects]),
        rings=sweep.rings,
        objects=tuple(o.below(rig.height_m) for o in scanned.objects),
        times=sweep.times,
    )
