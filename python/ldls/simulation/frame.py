"""A simulated frame: a sweep, the images taken with it, what a segmenter finds in them, and the truth of it all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera
from ldls.masks import InstanceMasks
from ldls.simulation.cameras import MountedCamera
from ldls.simulation.errors import SegmenterErrors, SensorErrors
from ldls.simulation.objects import SceneObject
from ldls.simulation.photograph import PixelTruth, photograph
from ldls.simulation.raycasting import RayCaster
from ldls.simulation.rig import Rig, make_rig
from ldls.simulation.scanning import scan
from ldls.simulation.scenes import Scene, make_scene
from ldls.simulation.segmenting import segmented, true_masks


@dataclass(frozen=True, eq=False)
class View:
    """One camera's part of a frame.

    Attributes:
        camera: The calibration as a user is given it, with its error.
        true_camera: The calibration as it is.
        image: (H, W, 3) uint8 RGB.
        pixels: The object of each pixel.
        true_masks: Masks of every object that the image shows.
        masks: What a segmenter finds.
    """

    camera: Camera
    true_camera: Camera
    image: NDArray[np.uint8]
    pixels: PixelTruth
    true_masks: InstanceMasks
    masks: InstanceMasks


@dataclass(frozen=True, eq=False)
class SceneFrame:
    """One frame of N points with its truth; the lidar is at the origin, x ahead, y left, z up, metres.

    Attributes:
        points: (N, 4) float32 x, y, z and intensity.
        rings: (N,) int32 beam of each point, 0 the highest.
        instances: (N,) int32 object of each point: 0 background, m `objects[m - 1]`.
        categories: (N,) int32 COCO id of each point, 0 for background.
        objects: Objects with their boxes in the lidar frame, at the time of the sweep.
        views: One for each camera, the one that looks ahead first.
    """

    points: NDArray[np.float32]
    rings: NDArray[np.int32]
    instances: NDArray[np.int32]
    categories: NDArray[np.int32]
    objects: tuple[SceneObject, ...]
    views: tuple[View, ...]

    @property
    def camera(self) -> Camera:
        """Calibration, as given, of the camera that looks ahead."""
        return self.views[0].camera

    @property
    def image(self) -> NDArray[np.uint8]:
        """(H, W, 3) RGB image ahead."""
        return self.views[0].image

    @property
    def true_masks(self) -> InstanceMasks:
        """Masks of every object in the image ahead."""
        return self.views[0].true_masks

    @property
    def masks(self) -> InstanceMasks:
        """What a segmenter finds in the image ahead."""
        return self.views[0].masks


def scene_frame(
    seed: int = 0,
    *,
    kind: str = "street",
    rig: Rig | None = None,
    segmenter: SegmenterErrors | None = None,
    sensors: SensorErrors | None = None,
) -> SceneFrame:
    """The frame of a seed, the same every time.

    Args:
        seed: Which scene, and which noise.
        kind: `street` or `campus`.
        rig: Lidar and cameras; KITTI's by default.
        segmenter: How wrong the masks are; `SegmenterErrors()` by default.
        sensors: How wrong calibration and clocks are; `SensorErrors()` by default.

    Raises:
        ParameterError: There is no such kind.
        ImportError: `ldls[sim]` is not installed.
    """
    rig = make_rig() if rig is None else rig
    sensors = SensorErrors() if sensors is None else sensors
    drift = sensors.calibrated(np.eye(4), np.random.default_rng((seed, 1)))
    return frame_of(make_scene(seed, kind=kind), rig, seed, drift=drift, delay_s=sensors.delay_s, segmenter=segmenter)


def frame_of(
    scene: Scene,
    rig: Rig,
    seed: int,
    *,
    drift: NDArray[np.float64],
    delay_s: float,
    segmenter: SegmenterErrors | None = None,
) -> SceneFrame:
    """The frame that a rig at the scene's origin takes.

    Args:
        scene: The scene at the time of the images.
        rig: Lidar and cameras.
        seed: Which noise.
        drift: (4, 4) error of the calibration, after the true transform.
        delay_s: The sweep is this much later than the images.
        segmenter: How wrong the masks are; `SegmenterErrors()` by default.

    Raises:
        ImportError: `ldls[sim]` is not installed.
    """
    photographed, scanned = RayCaster(scene.shape), scene.after(delay_s)
    caster = photographed if scanned is scene else RayCaster(scanned.shape)
    sweep = scan(scanned, caster, rig.lidar, rig.height_m, np.random.default_rng((seed, 0)))
    return SceneFrame(
        points=sweep.points,
        rings=sweep.rings,
        instances=sweep.instances,
        categories=np.append(np.int32(0), scene.categories)[sweep.instances].astype(np.int32),
        objects=tuple(o.below(rig.height_m) for o in scanned.objects),
        views=tuple(
            _view(scene, photographed, mounted, rig.height_m, drift, segmenter, seed + 7919 * k)
            for k, mounted in enumerate(rig.cameras)
        ),
    )


def _view(
    scene: Scene,
    caster: RayCaster,
    mounted: MountedCamera,
    height_m: float,
    drift: NDArray[np.float64],
    segmenter: SegmenterErrors | None,
    seed: int,
) -> View:
    image, pixels = photograph(scene, caster, mounted, height_m)
    true, size = mounted.T_camera_lidar(), (mounted.model.height, mounted.model.width)
    projection = mounted.model.projection()
    return View(
        camera=Camera(projection=projection, T_camera_lidar=drift @ true, image_size=size),
        true_camera=Camera(projection=projection, T_camera_lidar=true, image_size=size),
        image=image,
        pixels=pixels,
        true_masks=true_masks(pixels),
        masks=segmented(pixels, errors=segmenter, seed=seed),
    )
