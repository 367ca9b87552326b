"""Stored masks of the images of a source: a file for each, or one file for all."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from ldls.datasets.frame import Frame, Source
from ldls.errors import InputError, some
from ldls.io import read_masks
from ldls.io.masks.data_set import SHOWN, MaskDataSet
from ldls.masks import InstanceMasks

FRAME = "{frame}"
"""What stands in a path where the name of a frame does."""
PLACES = (
    "a folder with a file a frame, a path such as masks/{frame}.json, or one .json with the masks of all images and "
    "their file names"
)
SUFFIXES = (".json", ".npz", ".png", ".npy", ".txt")
"""Suffixes looked for in a folder of masks, in this order."""


class StoredMasks:
    """The masks of the frames of a source, wherever they lie.

    Attributes:
        place: A folder with FRAME.json (or .npz, .png, .npy, .txt), for several cameras CAMERA/FRAME.json; a path with
            {frame} and {camera} in it; or a JSON file with the masks of all images, by their names.
        data_set: That one file, if it is one.
    """

    def __init__(self, place: str) -> None:
        """Masks at `place`; one file of all masks is read here.

        Raises:
            InputError: It is nothing of the kind.
            FileFormatError: The one file cannot be read, or is of one image alone.
            MaskError: Annotations in it are of no image.
        """
        self.place = place
        path = Path(place)
        if FRAME not in place and not path.is_dir() and not (path.suffix == ".json" and path.is_file()):
            if not path.exists():
                raise InputError(f"masks: there is no {place!r}; expected {PLACES}")
            raise InputError(f"masks: {place!r} is no folder and has no {{frame}} in it; expected {PLACES}")
        self.data_set = MaskDataSet(path) if path.is_file() else None

    def check_names(self, source: Source) -> None:
        """Refuse one file of which no image is of the source.

        Raises:
            InputError: None is; the message has names of both.
        """
        if self.data_set is None:
            return
        names: list[str] = []
        for index, frame in enumerate(source.names):
            own = [frame, *(path.name for path in source.files(index))]
            if any(self.data_set.has(name) for name in own):
                return
            names.append(frame)
        raise InputError(
            f"{self.data_set.path}: no file name in it is that of a frame or an image of {source.path}; it has "
            f"{self.data_set.examples()}, the frames are {some([repr(name) for name in names], SHOWN)}; name the "
            "images by their frames"
        )

    def files(self, frame: str, cameras: Iterable[str]) -> tuple[Path, ...]:
        """The file of the masks of each image of a frame; none where one file has all.

        Raises:
            InputError: The folder has none.
        """
        cameras = tuple(cameras)
        return () if self.data_set else tuple(self._file(frame, camera, len(cameras) == 1) for camera in cameras)

    def read(self, frame: Frame) -> tuple[InstanceMasks, ...]:
        """The masks of each image of a frame.

        Raises:
            InputError: An image has none.
            FileFormatError: They cannot be read.
            MaskError: They cannot be used, or are of an image of another size.
        """
        sizes = [image.camera.image_size for image in frame.images]
        if self.data_set is None:
            paths = self.files(frame.name, (image.name for image in frame.images))
            return tuple(read_masks(path, image_size=size) for path, size in zip(paths, sizes, strict=True))
        images = {image.name: image.path for image in frame.images}
        found = [self.data_set.find(frame.name, camera, images) for camera in images]
        return tuple(self.data_set.masks(image_id, size) for image_id, size in zip(found, sizes, strict=True))

    def _file(self, frame: str, camera: str, only_camera: bool) -> Path:
        if FRAME in self.place:
            return Path(fill(self.place, frame, camera))
        folders = [Path(self.place) / camera, *([Path(self.place)] if only_camera else [])]
        for folder in folders:
            for suffix in SUFFIXES:
                if (folder / f"{frame}{suffix}").is_file():
                    return folder / f"{frame}{suffix}"
        looked = " or ".join(str(folder) for folder in folders)
        raise InputError(f"masks: no file {frame} with one of {' '.join(SUFFIXES)} in {looked}")


def own_category_names(source: Source) -> tuple[Mapping[int, str], ...]:
    """Name of each category id of each file of all masks that a source has itself."""
    names: tuple[Mapping[int, str], ...] = getattr(source, "category_names", ())
    return names


def fill(pattern: str, frame: str, camera: str) -> str:
    """The pattern with the names of a frame and a camera in the places of {frame} and {camera}."""
    return pattern.replace(FRAME, frame).replace("{camera}", camera)


def own_masks(source: Source) -> Mapping[str, str]:
    """The places of the masks that a source has itself, by camera, as `CameraImage.masks`; empty without any."""
    places: Mapping[str, str] = getattr(source, "stored_masks", {})
    return places
