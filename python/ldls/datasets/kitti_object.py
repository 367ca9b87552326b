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
from ldls.datasets.files import IMAGE_SUFFIXES, POINT_SUFFIXES, choose, find_files, whole_frames
from ldls.datasets.frame import CameraImage, Frame
from ldls.datasets.kitti_cameras import camera_numbers, image_from_file
from ldls.datasets.truth import of_points
from ldls.evaluation import label_by_boxes, read_annotations
from ldls.io import read_camera, read_points
from ldls.io.kitti_objects import read_kitti_objects
from ldls.labeling import Labeling

SPLITS = ("training", "testing")


class KittiObjectSource:
    """Frames of KITTI's object data.

    Truth is that of the point annotations, else of the boxes, which hold some ground beside their objects; points
    out of the first camera's view are then ignored.

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
        truth: bool = True,
    ) -> None:
        """Look for the frames.

        Args:
            path: Folder of the frames, or its parent.
            camera: Number of the camera, 0 to 3, or several.
            split: "training" or "testing", if `path` is the parent of both.
            truth: Whether frames have their truth, where it is there.

        Raises:
            SourceError: A folder is missing, or no frame is whole.
            ParameterError: There is no such camera.
        """
        self.path = _training(Path(path), split)
        self.cameras = camera_numbers(camera)
        self._points = find_files(self.path / "velodyne", POINT_SUFFIXES)
        self._calib = find_files(self.path / "calib", (".txt",))
        self._images = {n: find_files(self.path / f"image_{n}", IMAGE_SUFFIXES) for n in self.cameras}
        images = {f"image_{n}": files for n, files in self._images.items()}
        frames = whole_frames(self.path, {"velodyne": self._points, "calib": self._calib, **images})
        self.names, self.left_out = frames.names, frames.left_out
        self.stamps: tuple[float | None, ...] = (None,) * len(self.names)
        self._truth = truth

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Whether `path` looks like KITTI's object data."""
        return any(_is_frames(folder) for folder in (path, *(path / split for split in SPLITS)))

    def __len__(self) -> int:
        return len(self.names)

    @property
    def camera_names(self) -> tuple[str, ...]:
        """Name of the camera of each image of a frame."""
        return tuple(f"image_{number}" for number in self.cameras)

    def files(self, index: int) -> tuple[Path, ...]:
        """The files that a frame is read from."""
        name = self.names[index]
        return (self._points[name], self._calib[name], *(files[name] for files in self._images.values()))

    def __getitem__(self, index: int) -> Frame:
        name = self.names[index]
        points = read_points(self._points[name])
        images = tuple(self._image(name, number) for number in self.cameras)
        truth = self._read_truth(name, points, images[0].camera) if self._truth else None
        return Frame(name=name, points=points, images=images, truth=truth)

    def _image(self, name: str, number: int) -> CameraImage:
        calib = self._calib[name]
        return image_from_file(
            f"image_{number}",
            self._images[number][name],
            lambda size: read_camera(calib, format="kitti", camera=number, image_size=size),
        )

    def _read_truth(self, name: str, points: Points, camera: Camera) -> Labeling | None:
        annotations, boxes = (self.path / folder / f"{name}.txt" for folder in ("annotations", "label_2"))
        if annotations.exists():
            return of_points(read_annotations(annotations), points, annotations)
        return label_by_boxes(read_kitti_objects(boxes), points, camera) if boxes.exists() else None


def _is_frames(path: Path) -> bool:
    return (path / "velodyne").is_dir() and (path / "calib").is_dir()


def _training(path: Path, split: str | None) -> Path:
    """The folder that has the frames: `path` or one below it."""
    below = [name for name in SPLITS if (path / name).is_dir()]
    if split is None and (_is_frames(path) or not below):
        return path
    return path / choose(path, "split", below, split)
