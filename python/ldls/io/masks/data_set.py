"""One JSON file with the masks of many images, found by the names of the images: COCO's, and COCO panoptic.

The text of the file is kept, and where each annotation begins in it; those of an image are parsed when they are asked
for. So the file takes about as much memory as it has bytes, where parsed it would take many times that.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections import defaultdict
from collections.abc import Mapping
from os import PathLike
from pathlib import Path, PureWindowsPath
from typing import Any, NamedTuple

from ldls.errors import CorruptFileError, InputError, MaskError, UnsupportedFormatError, some, within
from ldls.io.files import MAX_TEXT_BYTES, open_file, parsing
from ldls.io.masks import json_file
from ldls.masks import InstanceMasks
from ldls.masks.coco import by_id, category_names
from ldls.masks.pixels import check_same_size

ENDINGS = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".ppm", ".pgm")
"""Those of images, which their names in the file may have or not."""
EXPORTED = re.compile(r"_(png|jpe?g|bmp|tiff?|webp)\.rf\.\w+$", re.IGNORECASE)
"""End that Roboflow gives the names of images: 000571_png.rf.0a1b2c.jpg."""
BLANK = re.compile(r"[ \t\n\r]*")
SHOWN = 3
"""Names that an error shows of those there are."""


class ImageName(NamedTuple):
    """The name of an image without its ending, and the folders before it, the nearest last."""

    folders: tuple[str, ...]
    stem: str

    @classmethod
    def of(cls, path: str | PathLike[str]) -> ImageName:
        """The name of a path with slashes of any system."""
        *folders, file = PureWindowsPath(path).parts or ("",)
        suffix = PureWindowsPath(file).suffix
        stem = file.removesuffix(suffix) if suffix.lower() in ENDINGS else file
        return cls(tuple(folders), EXPORTED.sub("", stem))

    def agreement(self, other: ImageName) -> tuple[int, int]:
        """The number of folders before both that are the same, and of those of `self` that `other` has anywhere."""
        near = 0
        for own, its in zip(reversed(self.folders), reversed(other.folders), strict=False):
            if own != its:
                break
            near += 1
        return near, len(set(self.folders) & set(other.folders))


class MaskDataSet:
    """The masks of many images in one file.

    Attributes:
        path: The file.
        sha256: Digest of its bytes, in hexadecimal digits.
        names: Name of each image as the file has it, by image id; the id itself in a bare list of results.
        category_names: Name of each category id; none where the file has no table of them.
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        """Read the file and look where the annotations of each image are.

        Raises:
            UnsupportedFormatError: It is a file of one image, or names no image.
            MaskError: An annotation is of no image, or of one that is not there.
            CorruptFileError: It is not JSON, or of none of these formats.
            LimitError: It is too large.
            FileNotFoundError: There is no such file.
        """
        self.path = Path(path)
        self._decode = json.JSONDecoder(parse_constant=json_file.refuse_constant).raw_decode
        self._head: dict[str, Any] = {}
        self._starts: defaultdict[int | str, list[int]] = defaultdict(list)
        self.names: dict[int | str, str] = {}
        with open_file(self.path, "JSON file", limit=MAX_TEXT_BYTES) as file:
            content = file.read()
            self.sha256 = hashlib.sha256(content).hexdigest()
            self._text = content.decode("utf-8-sig")
            del content
            self._scan()
            self._images: dict[int | str, dict[str, Any]] = by_id("images", self._head.get("images", []), (int, str))
            self.category_names = category_names(self._head)
            self._name()
        self._named: defaultdict[str, list[tuple[ImageName, int | str]]] = defaultdict(list)
        for image_id, name in self.names.items():
            own = ImageName.of(name)
            self._named[own.stem].append((own, image_id))

    def __reduce__(self) -> tuple[type[MaskDataSet], tuple[Path]]:
        """Another process reads the file anew."""
        return MaskDataSet, (self.path,)

    def has(self, name: str | PathLike[str]) -> bool:
        """True if an image has this name, whatever its folders and ending."""
        return bool(self._candidates(ImageName.of(name).stem))

    def find(self, frame: str, camera: str, paths: Mapping[str, Path | None]) -> int | str:
        """The id of the image that a camera took in a frame.

        Args:
            frame: Name of the frame, which is looked for where no image has the name of the camera's file.
            camera: Name of the camera.
            paths: File of the image of each camera of the frame; None for one without.

        Raises:
            InputError: No image has its name, or several have, or it may be another camera's as well.
        """
        own = _known_as(frame, camera, paths[camera])
        candidates = self._candidates(own.stem) or self._candidates(frame)
        image = f"the image of camera {camera} in frame {frame}"
        if not candidates:
            raise InputError(f"{self.path}: has no {own.stem}, {image}; its file names are {self.examples()}")
        ranks = [name.agreement(own) for name, _ in candidates]
        best = [candidate for rank, candidate in zip(ranks, candidates, strict=True) if rank == max(ranks)]
        listed = some([repr(self.names[image_id]) for _, image_id in best], SHOWN)
        if len(best) > 1:
            raise InputError(
                f"{self.path}: {listed} may all be {image}; file names must tell them apart by the folders of the "
                "images, or by the name of the camera"
            )
        name, image_id = best[0]
        others = [_known_as(frame, other, path) for other, path in paths.items() if other != camera]
        if any(other.stem == own.stem and name.agreement(other) >= max(ranks) for other in others):
            raise InputError(
                f"{self.path}: {listed} may be of another camera of frame {frame} than {camera}; file names must have "
                f"the folder of the images or the name of the camera, as {camera}/{own.stem}.png"
            )
        return image_id

    def masks(self, image_id: int | str, image_size: tuple[int, int] | None = None) -> InstanceMasks:
        """The masks of an image; none where the file has no annotation of it.

        Raises:
            MaskError: An annotation cannot be used, or the image is of another size than `image_size`.
            CorruptFileError: An annotation is none.
        """
        with within(self.path), parsing("JSON file"):
            annotations = [self._decode(self._text, start)[0] for start in self._starts.get(image_id, ())]
            images = [self._images[image_id]] if self._images else []
            content = self._head | {"images": images, "annotations": annotations} if self._head else annotations
            masks = json_file.parse(content, self.path, image_size=image_size)
            if image_size is not None:
                check_same_size(masks.image_size, image_size)
            return masks

    def examples(self) -> str:
        """The first names of images, for messages."""
        return some([repr(name) for name in self.names.values()], SHOWN)

    def _candidates(self, stem: str) -> list[tuple[ImageName, int | str]]:
        """The images of a name; where numbers name them, 571 is 000571."""
        found = self._named.get(stem, [])
        return found or (self._named.get(str(int(stem)), []) if not self._images and stem.isdecimal() else [])

    def _scan(self) -> None:
        """Find images, categories and the places of annotations in the text."""
        at = self._skip(0)
        if self._text[at : at + 1] == "[":
            self._annotations(at)
            return
        at = self._expect("{", at)
        while self._text[at : at + 1] != "}":
            key, at = self._decode(self._text, at)
            at = self._expect(":", self._skip(at))
            if key == "annotations" and self._text[at : at + 1] == "[":
                at = self._annotations(at)
            else:
                value, at = self._decode(self._text, at)
                if key in ("images", "categories"):
                    self._head[key] = value
            at = self._skip(at)
            if self._text[at : at + 1] != "}":
                at = self._expect(",", at)

    def _annotations(self, at: int) -> int:
        """Note the list of annotations that begins here; where it ends."""
        at = self._expect("[", at)
        while self._text[at : at + 1] != "]":
            start = at
            annotation, at = self._decode(self._text, at)
            if not isinstance(annotation, dict):
                raise CorruptFileError("expected annotations to be a list of objects")
            image_id = annotation.get("image_id")
            if not isinstance(image_id, int | str) or isinstance(image_id, bool):
                raise UnsupportedFormatError(
                    f"annotation {annotation.get('id', '')} has no image_id, so that the file is of one image; give a "
                    "file for each frame, as masks/{frame}.json, or one with file names"
                )
            self._starts[image_id].append(start)
            if "file_name" in annotation:
                self.names.setdefault(image_id, str(annotation["file_name"]))
            at = self._skip(at)
            if self._text[at : at + 1] != "]":
                at = self._expect(",", at)
        return at + 1

    def _skip(self, at: int) -> int:
        return BLANK.match(self._text, at).end()  # type: ignore[union-attr]  # it matches nothing, too

    def _expect(self, character: str, at: int) -> int:
        """The place after a character and what is blank behind it."""
        if self._text[at : at + 1] != character:
            raise json.JSONDecodeError(f"Expecting {character!r}", self._text, at)
        return self._skip(at + 1)

    def _name(self) -> None:
        """Name the images, by their records or, where there are none, by what annotations say of them."""
        if not self._images:
            self.names = {image_id: self.names.get(image_id, str(image_id)) for image_id in self._starts}
        else:
            missing = next((image_id for image_id in self._starts if image_id not in self._images), None)
            if missing is not None:
                raise MaskError(
                    f"an annotation has image_id {missing!r}, which no image has; mend the id or leave it out"
                )
            records = self._images.items()
            self.names = {image_id: str(image["file_name"]) for image_id, image in records if image.get("file_name")}
        if not self.names:
            raise UnsupportedFormatError(
                "has no file names of images, by which frames could be found in it; give a file for each frame, as "
                "masks/{frame}.json, or COCO's data set with images and their file_name"
            )


def _known_as(frame: str, camera: str, path: Path | None) -> ImageName:
    """The name of an image: that of its file, or else of its frame, with its camera for a folder."""
    own = ImageName((), frame) if path is None else ImageName.of(path)
    return ImageName((camera, *own.folders), own.stem)
