"""A moment of a drive: one lidar sweep, and the images that go with it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera
from ldls.checks import checked
from ldls.cloud import Points
from ldls.errors import within
from ldls.labeling import Labeling
from ldls.masks import InstanceMasks
from ldls.sequences import Trajectory

POSES_LEFT_OUT = "they are left out by --option poses=false"
"""What sources opened with `poses=False` have as `why_no_poses`."""
LEAVE_POSES_OUT = "or leave poses out by --option poses=false, and where they are needed give --poses FILE"
"""What errors of the poses of a source end with."""


@dataclass(frozen=True, eq=False, kw_only=True)
class CameraImage:
    """An image of a frame and the camera that took it.

    Attributes:
        name: Name of the camera, as "image_2" or "CAM_FRONT".
        camera: The camera, its size included.
        read: Reads the (H, W, 3) uint8 RGB pixels; only whoever needs them pays for them.
        stamp: Time at which it was taken, in seconds; None where the source does not say.
        path: Its file, where it has one.
        masks: Instance masks of the image, where the source has them.
        moved: True if T_camera_lidar is from the lidar at its stamp to the camera at its own, else it leaves out how
            the two moved in between.
    """

    name: str
    camera: Camera
    read: Callable[[], NDArray[np.uint8]]
    stamp: float | None = None
    path: Path | None = None
    masks: InstanceMasks | None = None
    moved: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Frame:
    """A lidar sweep and the images that go with it.

    Attributes:
        name: Name of the frame, unique in its source, fit for a file name.
        points: (N, >= 3) x y z first, in metres in the lidar frame: at its stamp, or at their own `times`.
        times: (N,) float64, when each point was measured, in seconds after `stamp`, negative before it; None where the
            source does not say, or where they were all measured, or moved to where they were, at the stamp.
        stamp: Time of the sweep in seconds; None where the source does not say.
        pose: (4, 4) T_world_lidar at its stamp, in metres; the world is the same for all frames of a drive. None where
            the source does not say.
        trajectory: The poses around its stamp, where the source knows them between stamps, too.
        images: One for each camera.
        truth: True labels of the points, where the source has them.
    """

    name: str
    points: Points
    times: NDArray[np.float64] | None = None
    stamp: float | None = None
    pose: NDArray[np.float64] | None = None
    trajectory: Trajectory | None = None
    images: tuple[CameraImage, ...] = ()
    truth: Labeling | None = None

    @checked
    def deskewed(self, trajectory: Trajectory | None = None) -> Frame:
        """Return the frame as it was at its stamp: points where they were then, cameras from where the lidar was then.

        Points have no `times` any more, and images are `moved`, so that nothing is moved twice. A frame without stamp
        or trajectory stays as it is; so do points without times and images without stamps.

        Args:
            trajectory: Poses of the lidar by the clock of the frame; its own by default.

        Raises:
            PoseError: The poses do not say how the lidar moved between the stamp and a time, or one is over a second.
            ShapeError: There is not one time a point.
        """
        trajectory = self.trajectory if trajectory is None else trajectory
        if trajectory is None or self.stamp is None:
            return self
        points = self.points if self.times is None else trajectory.deskew(self.points, self.times, self.stamp)
        images = tuple(_moved(image, self.stamp, trajectory) for image in self.images)
        return replace(self, points=points, times=None, images=images)


def _moved(image: CameraImage, stamp: float, trajectory: Trajectory) -> CameraImage:
    """The image with its camera from the lidar at `stamp`."""
    if image.moved or image.stamp is None:
        return image
    if image.stamp == stamp:
        return replace(image, moved=True)
    with within(f"image of {image.name}"):
        T_camera_lidar = image.camera.T_camera_lidar @ trajectory.motion(stamp, image.stamp)
    return replace(image, camera=replace(image.camera, T_camera_lidar=T_camera_lidar), moved=True)


class Source(Protocol):
    """Frames one after the other; reading one does not read the others.

    Attributes:
        kind: Name in the registry, as "kitti-object".
        path: Where it lies.
        names: Name of each frame, known without reading any.
        stamps: Time of each sweep in seconds, known without reading any; None where the source does not say.
        camera_names: Name of the camera of each image of a frame.
    """

    kind: str
    path: Path
    names: tuple[str, ...]
    stamps: tuple[float | None, ...]
    camera_names: tuple[str, ...]

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.names)

    def __iter__(self) -> Iterator[Frame]:
        """Read the frames one after the other."""
        return map(self.__getitem__, range(len(self)))

    def files(self, index: int) -> tuple[Path, ...]:
        """The files that a frame is read from, found without reading them, and folders of files."""
        ...

    def __getitem__(self, index: int) -> Frame:
        """Read a frame.

        Raises:
            IndexError: There is no such frame.
            LdlsError: The frame cannot be read.
        """
        ...
