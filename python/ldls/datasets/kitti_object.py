"""KITTI's object data: single frames, each with a calibration of its own.

FOLDER/velodyne/NNNNNN.bin, FOLDER/image_2/NNNNNN.png, FOLDER/calib/NNNNNN.txt and, for truth,
FOLDER/annotations/NNNNNN.txt (a class a point) or FOLDER/label_2/NNNNNN.txt (boxes); FOLDER is `training` or `testing`.
"""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from ldls.camera import Camera
from ldls.cloud import Points
from ldls.datasets.file_source import (
    IMAGE_SUFFIXES,
    POINT_SUFFIXES,
    FileSource,
    check_truth,
    choose,
    find_files,
    image_from_file,
)
from ldls.datasets.frame import CameraImage, Frame
from ldls.datasets.kitti_common import camera_numbers
from ldls.errors import ParameterError
from ldls.io import read_camera, read_masks, read_points
from ldls.io.images import read_image_size
from ldls.io.labels.annotations import read_annotations
from ldls.io.labels.kitti_objects import read_kitti_boxes
from ldls.labeling import Labeling

SPLITS = ("training", "testing")
TRUTHS = {"annotations": "annotations", "boxes": "label_2"}
"""Folder of each kind of truth, the one that is taken first first."""


class KittiObjectSource(FileSource):
    """Frames of KITTI's object data.

    Truth is that of the point annotations, else of the boxes, which hold some ground beside their objects; points
    out of the first camera's view are then ignored. With stored masks the images may be missing.

    Attributes:
        kind: "kitti-object".
        path: Folder with velodyne, image_2 and calib.
        names: Numbers of the frames, as "000571".
        stamps: None for each frame, as the data set has none.
        left_out: What frames lack that have only some of their files, by name.
    """

    kind = "kitti-object"
    looks_for = "velodyne/ and calib/, in the folder or in training/ or testing/ below it"

    def __init__(
        self,
        path: str | PathLike[str],
        *,
        camera: int | Sequence[int] = 2,
        split: str | None = None,
        masks: str | None = None,
        truth: bool | str = True,
    ) -> None:
        """Look for the frames.

        Args:
            path: Folder of the frames, or its parent.
            camera: Number of the camera, 0 to 3, or several.
            split: "training" or "testing", if `path` is the parent of both.
            masks: Folder of stored masks beside the others, as "masks", with a `.json` a frame; of one camera.
            truth: Give frames their truth, where it is there; "annotations" or "boxes": take the frames that have it.

        Raises:
            SourceError: A folder is missing, or no frame is whole.
            ParameterError: There is no such camera or truth, or there are masks and several cameras.
        """
        path = _training(Path(path), split)
        self._numbers = {f"image_{n}": n for n in camera_numbers(camera)}
        self._masks, self._truth = masks, truth
        parts = {
            "velodyne": find_files(path / "velodyne", POINT_SUFFIXES),
            "calib": find_files(path / "calib", (".txt",)),
        }
        there = [name for name in self._numbers if masks is None or (path / name).is_dir()]
        self._images = {name: find_files(path / name, IMAGE_SUFFIXES) for name in there}
        if masks is None:
            parts |= self._images
        elif len(self._numbers) == 1:
            parts[masks] = find_files(path / masks, (".json",))
        else:
            raise ParameterError(f"masks: got {masks!r} for {len(self._numbers)} cameras, expected one camera")
        if isinstance(truth, str):
            if truth not in TRUTHS:
                raise ParameterError(f"truth: got {truth!r}, expected true, false, {' or '.join(TRUTHS)}")
            parts[TRUTHS[truth]] = find_files(path / TRUTHS[truth], (".txt",))
        super().__init__(path, parts, self._numbers)
        self.stamps: tuple[float | None, ...] = (None,) * len(self.names)

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """True for a path that looks like KITTI's object data."""
        return any(_is_frames(folder) for folder in (path, *(path / split for split in SPLITS)))

    def __getitem__(self, index: int) -> Frame:
        name = self.names[index]
        points = read_points(self._points[name])
        images = tuple(self._image(camera, name) for camera in self.camera_names)
        return Frame(name=name, points=points, images=images, truth=self._read_truth(name, points, images[0].camera))

    def _image(self, camera: str, name: str) -> CameraImage:
        masks = None if self._masks is None else read_masks(self._parts[self._masks][name])
        path = self._images.get(camera, {}).get(name, self.path / camera / f"{name}.png")
        size = read_image_size(path) if masks is None else masks.image_size
        calib = read_camera(self._parts["calib"][name], format="kitti", camera=self._numbers[camera], image_size=size)
        return image_from_file(camera, path, calib, masks=masks)

    def _read_truth(self, name: str, points: Points, camera: Camera) -> Labeling | None:
        wanted = [self._truth] if isinstance(self._truth, str) else [*TRUTHS] if self._truth else []
        for kind in wanted:
            path = self.path / TRUTHS[kind] / f"{name}.txt"
            if path.exists() and kind == "boxes":
                return read_kitti_boxes(path, points=points, camera=camera)
            if path.exists():
                return check_truth(read_annotations(path), points, path)
        return None


def _is_frames(path: Path) -> bool:
    return (path / "velodyne").is_dir() and (path / "calib").is_dir()


def _training(path: Path, split: str | None) -> Path:
    """The folder that has the frames: `path` or one below it."""
    below = [name for name in SPLITS if (path / name).is_dir()]
    if split is None and (_is_frames(path) or not below):
        return path
    return path / choose(path, "split", below, split)
