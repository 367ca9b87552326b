"""The points and cameras of frames, by name, where labels alone do not suffice."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera
from ldls.cloud import Points
from ldls.errors import InputError
from ldls.io import read_camera, read_points
from ldls.io.images import read_image_size

POINT_ENDINGS = (".bin", ".pcd.bin", ".npy")


@dataclass(frozen=True, kw_only=True)
class FrameInputs:
    """Folders of what frames were made of; None where a folder is not known.

    Attributes:
        points: Folder of lidar sweeps.
        calib: Folder of KITTI calibration files.
        images: Folder of images, of which only the size is read.
    """

    points: Path | None = None
    calib: Path | None = None
    images: Path | None = None

    def read_points(self, name: str) -> Points:
        """(N, >= 3) points of the frame `name`, in metres.

        Raises:
            InputError: The folder is not known.
            FileNotFoundError: It has no such sweep.
        """
        if self.points is None:
            raise InputError(f"frame {name}: needs its points; name their folder (--points)")
        paths = [self.points / f"{name}{ending}" for ending in POINT_ENDINGS]
        return read_points(next((path for path in paths if path.exists()), paths[0]))

    def read_camera(self, name: str) -> Camera:
        """Camera of the frame `name`, with the size of its image where there is one.

        Raises:
            InputError: The folder is not known.
            CalibrationError: The file is broken.
            FileNotFoundError: There is no such file.
        """
        if self.calib is None:
            raise InputError(f"frame {name}: needs its calibration; name the folder (--calib)")
        camera = read_camera(self.calib / f"{name}.txt", format="kitti")
        return replace(camera, image_size=self._image_size(name))

    def _image_size(self, name: str) -> tuple[int, int] | None:
        path = None if self.images is None else self.images / f"{name}.png"
        return read_image_size(path) if path is not None and path.exists() else None


def ranges_of(points: Points) -> NDArray[np.float64]:
    """(N,) distances of the points from the lidar, in metres."""
    distances: NDArray[np.float64] = np.linalg.norm(points[:, :3].astype(np.float64), axis=1)
    return distances
