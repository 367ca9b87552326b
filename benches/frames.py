"""The frames that are measured."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import ldls
from ldls.simulation import street_scene


@dataclass(frozen=True)
class Frame:
    """One lidar sweep with the masks and the camera of an image."""

    name: str
    points: NDArray[np.float32]
    masks: ldls.InstanceMasks
    camera: ldls.Camera


def frame() -> Frame:
    """KITTI object frame 000571 where `LDLS_TEST_DATA` names the folder of real frames, else a simulated street."""
    folder = os.environ.get("LDLS_TEST_DATA")
    if folder is None:
        return _simulated()
    training = Path(folder) / "kitti/training"
    return Frame(
        name="KITTI object 000571",
        points=np.asarray(ldls.read_points(training / "velodyne/000571.bin"), np.float32),
        masks=ldls.InstanceMasks.from_coco(training / "masks/000571.json"),
        camera=ldls.Camera.from_kitti(training / "calib/000571.txt"),
    )


def _simulated() -> Frame:
    scene = street_scene()
    masks = ldls.InstanceMasks.from_array(scene.masks, categories=scene.categories, scores=scene.scores)
    camera = ldls.Camera(projection=scene.projection, T_camera_lidar=scene.T_camera_lidar)
    return Frame("simulated street (LDLS_TEST_DATA is not set)", scene.points, masks, camera)
