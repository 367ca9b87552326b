"""A moment of a drive: one lidar sweep, and the images that go with it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera
from ldls.cloud import Points
from ldls.labeling import Labeling
from ldls.masks import InstanceMasks


@dataclass(frozen=True, eq=False, kw_only=True)
class CameraImage:
    """An image of a frame and the camera that took it.

    Attributes:
        name: Name of the camera, as "image_2" or "CAM_FRONT".
        camera: The camera, its size included; T_camera_lidar is from the lidar at its stamp to the camera at its own.
        read: Reads the (H, W, 3) uint8 RGB pixels; only whoever needs them pays for them.
        stamp: Time at which it was taken, in seconds; None where the source does not say.
        path: Its file, where it has one.
        masks: Instance masks of the image, where the source has them.
    """

    name: str
    camera: Camera
    read: Callable[[], NDArray[np.uint8]]
    stamp: float | None = None
    path: Path | None = None
    masks: InstanceMasks | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Frame:
    """A lidar sweep and the images that go with it.

    Attributes:
        name: Name of the frame, unique in its source, fit for a file name.
        points: (N, >= 3) x y z first, in metres in the lidar frame.
        stamp: Time of the sweep in seconds; None where the source does not say.
        pose: (4, 4) T_world_lidar at its stamp, in metres; the world is the same for all frames of a drive. None where
            the source does not say.
        images: One for each camera.
        truth: True labels of the points, where the source has them.
    """

    name: str
    points: Points
    stamp: float | None = None
    pose: NDArray[np.float64] | None = None
    images: tuple[CameraImage, ...] = ()
    truth: Labeling | None = None


class Source(Protocol):
    """Frames one after the other; reading one does not read the others.

    Attributes:
        kind: Name in the registry, as "kitti-object".
        path: Where it lies.
        names: Name of each frame, known without reading any.
    """

    kind: str
    path: Path
    names: tuple[str, ...]

    @property
    def stamps(self) -> tuple[float | None, ...]:
        """Time of each sweep in seconds, known without reading any; None where the source does not say."""
        ...

    @property
    def camera_names(self) -> tuple[str, ...]:
        """Name of the camera of each image of a frame."""
        ...

    def __len__(self) -> int:
        """Number of frames."""
        ...

    def __iter__(self) -> Iterator[Frame]:
        """Read the frames one after the other."""
        ...

    def files(self, index: int) -> tuple[Path, ...]:
        """The files that a frame is read from, found without reading them."""
        ...

    def __getitem__(self, index: int) -> Frame:
        """Read a frame.

        Raises:
            IndexError: There is no such frame.
            LdlsError: The frame cannot be read.
        """
        ...
