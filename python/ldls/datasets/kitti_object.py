"""KITTI's object data: single frames, each with a calibration of its own.

FOLDER/velodyne/NNNNNN.bin, FOLDER/image_2/NNNNNN.png, FOLDER/calib/NNNNNN.txt and, for truth,
FOLDER/annotations/NNNNNN.txt (a class a point) or FOLDER/label_2/NNNNNN.txt (boxes); FOLDER is `training` or `testing`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from os import PathLike
from pathlib import Path

from ldls.checks import checked
from ldls.datasets.file_source import IMAGE_SUFFIXES, POINT_SUFFIXES, FileSource, choose, find_files, image_from_file
from ldls.datasets.frame import CameraImage
from ldls.errors import ParameterError, SourceError
from ldls.io import read_camera, read_masks
from ldls.io.cameras.kitti import camera_numbers
from ldls.io.images import read_image_size

SPLITS = ("training", "testing")
TRUTHS = {"annotations": ("annotations", "annotations"), "kitti-boxes": ("label_2", "kitti-boxes")}
"""Folder and format of each kind of truth, in the order in which they are looked for."""


class KittiObjectSource(FileSource):
    """Frames of KITTI's object data.

    Truth is that of the point annotations, else of the boxes, which hold some ground beside their objects; points
    out of the first camera's view are then ignored. With stored masks the images may be missing.

    Attributes:
        kind: "kitti-object".
        path: Folder with velodyne, image_2 and calib.
        names: Numbers of the frames, as "000571".
        stamps: None for each frame, as the data set has none.
        left_out: Parts that incomplete frames lack, by name of the frame.
        stored_masks: Folder of the stored masks, by camera, if there are any.
    """

    kind = "kitti-object"
    looks_for = "velodyne/ and calib/, in the folder or in training/ or testing/ below it"

    @checked
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
            truth: Give frames their truth, where it is there; "annotations" or "kitti-boxes": take the frames that
                have it.

        Raises:
            SourceError: A folder is missing, or no frame is whole.
            ParameterError: There is no such camera or truth, or there are masks and several cameras.
        """
        path = _training(Path(path), split)
        self._numbers = camera_numbers(camera)
        self._masks = masks
        self.stored_masks = {} if masks is None else dict.fromkeys(self._numbers, masks)
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
            folder = _truth_folder(path, truth)
            parts[folder] = find_files(path / folder, (".txt",))
        self._truths = [TRUTHS[truth]] if isinstance(truth, str) else [*TRUTHS.values()]
        super().__init__(path, parts, self._numbers, truth=bool(truth))

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """True for a path that looks like KITTI's object data."""
        return any(_is_frames(folder) for folder in (path, *(path / split for split in SPLITS)))

    def _image(self, camera: str, index: int) -> CameraImage:
        name = self.names[index]
        masks = None if self._masks is None else read_masks(self._parts[self._masks][name])
        path = self._images.get(camera, {}).get(name, self.path / camera / f"{name}.png")
        size = read_image_size(path) if masks is None else masks.image_size
        calib = read_camera(self._parts["calib"][name], format="kitti", camera=self._numbers[camera], image_size=size)
        return image_from_file(camera, path, calib, masks=masks)

    def _truth_files(self, name: str) -> Iterable[tuple[Path, str]]:
        return [(self.path / folder / f"{name}.txt", format) for folder, format in self._truths]


def _truth_folder(path: Path, truth: str) -> str:
    """The folder of one kind of truth.

    Raises:
        ParameterError: There is no such kind.
        SourceError: The frames have another kind alone.
    """
    if truth not in TRUTHS:
        raise ParameterError(f"truth: got {truth!r}, expected true, false, {' or '.join(TRUTHS)}")
    there = {word: folder for word, (folder, _) in TRUTHS.items() if (path / folder).is_dir()}
    folder, _ = TRUTHS[truth]
    if there and truth not in there:
        word, other = next(iter(there.items()))
        raise SourceError(f"{path}: has no folder {folder}, but {other}; take it by truth={word}")
    return folder


def _is_frames(path: Path) -> bool:
    return (path / "velodyne").is_dir() and (path / "calib").is_dir()


def _training(path: Path, split: str | None) -> Path:
    """The folder that has the frames: `path` or one below it."""
    below = [name for name in SPLITS if (path / name).is_dir()]
    if split is None and (_is_frames(path) or not below):
        return path
    return path / choose(path, "split", below, split)
