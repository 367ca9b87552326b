"""Names by which an image is found in a file about many."""

from __future__ import annotations

import re
from os import PathLike
from pathlib import PureWindowsPath
from typing import NamedTuple

ENDINGS = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".ppm", ".pgm")
EXPORTED = re.compile(r"_(png|jpe?g|bmp|tiff?|webp)\.rf\.\w+$", re.IGNORECASE)
"""End that Roboflow gives the names of images: 000571_png.rf.0a1b2c.jpg."""


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
