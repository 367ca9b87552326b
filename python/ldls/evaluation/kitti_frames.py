"""Frames with their truth, from a folder in KITTI's layout."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera
from ldls.errors import InputError
from ldls.evaluation.annotations import read_annotations
from ldls.evaluation.kitti_boxes import read_kitti_boxes
from ldls.io import read_camera, read_masks, read_points
from ldls.labeling import Labeling
from ldls.masks import InstanceMasks


@dataclass(frozen=True, eq=False)
class LabelledFrame:
    """One sweep with the masks of its image and the truth.

    Attributes:
        name: Number of the frame.
        points: (N, >= 3) in metres in the lidar frame.
        masks: What a segmenter says of the image.
        camera: The camera that took it.
        truth: Labels of the N points.
    """

    name: str
    points: NDArray[np.float32]
    masks: InstanceMasks
    camera: Camera
    truth: Labeling


class KittiFrames:
    """The frames of FOLDER/{velodyne,calib,masks} that have a truth in FOLDER/annotations or, if `boxes`, label_2.

    Raises:
        InputError: A folder is missing, or no frame is whole.
    """

    def __init__(self, folder: str | PathLike[str], *, boxes: bool = False) -> None:
        self.folder, self.boxes = Path(folder), boxes
        self._truth = "label_2" if boxes else "annotations"
        parts = {"velodyne": ".bin", "calib": ".txt", "masks": ".json", self._truth: ".txt"}
        for part in parts:
            if not (self.folder / part).is_dir():
                raise InputError(f"{self.folder}: no folder {part}, expected {', '.join(parts)}")
        stems = [{path.stem for path in (self.folder / part).glob(f"*{suffix}")} for part, suffix in parts.items()]
        self.names = sorted(set.intersection(*stems))
        if not self.names:
            raise InputError(f"{self.folder}: no frame has a file in each of {', '.join(parts)}")

    def __len__(self) -> int:
        return len(self.names)

    def __getitem__(self, at: int) -> LabelledFrame:
        name = self.names[at]
        points = np.asarray(read_points(self.folder / "velodyne" / f"{name}.bin"), np.float32)
        masks = read_masks(self.folder / "masks" / f"{name}.json")
        camera = read_camera(self.folder / "calib" / f"{name}.txt", format="kitti")
        camera = replace(camera, image_size=masks.image_size)
        return LabelledFrame(name, points, masks, camera, self._read_truth(name, points, camera))

    def _read_truth(self, name: str, points: NDArray[np.float32], camera: Camera) -> Labeling:
        path = self.folder / self._truth / f"{name}.txt"
        return read_kitti_boxes(path, points=points, camera=camera) if self.boxes else read_annotations(path)

    def __iter__(self) -> Iterator[LabelledFrame]:
        return (self[at] for at in range(len(self)))
