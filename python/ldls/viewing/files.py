"""Pictures as files."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from os import PathLike
from pathlib import Path

from PIL import Image

from ldls.io.files import whole_file
from ldls.io.images import png_of
from ldls.io.options import of_ending
from ldls.segmentation import Segmentation
from ldls.viewing.birds_eye import birds_eye_view
from ldls.viewing.comparison import comparison
from ldls.viewing.overlay import overlay
from ldls.viewing.shown import Images, images_of


def save_pictures(path: str | PathLike[str], result: Segmentation, images: Images = None) -> list[Path]:
    """Write the overlay to `path`, and beside it NAME-birds-eye.png and NAME-comparison.png; return their paths.

    Args:
        path: `NAME.png`.
        result: The segmentation.
        images: As for `overlay`.

    Raises:
        UnsupportedFormatError: The name does not end in `.png`.
        InputError: As for `overlay`.
    """
    check_picture(path)
    # images that do not fit are refused before one of the pictures is written
    images = images_of(result, images)
    path, birds_eye, compared = picture_files(path)
    # the one that takes longest first
    drawn: dict[Path, Callable[[], Image.Image]] = {
        compared: lambda: comparison(result, images),
        birds_eye: lambda: birds_eye_view(result),
        path: lambda: overlay(result, images),
    }
    with ThreadPoolExecutor(2) as threads:
        list(threads.map(lambda file: save_picture(file, drawn[file]()), drawn))
    return [path, birds_eye, compared]


def picture_files(path: str | PathLike[str] | None) -> list[Path]:
    """The files of `save_pictures`: the overlay at `path`, the bird's-eye view and the comparison; none of None."""
    if path is None:
        return []
    path = Path(path)
    return [path, *(path.with_name(f"{path.stem}-{what}{path.suffix}") for what in ("birds-eye", "comparison"))]


def check_picture(path: str | PathLike[str] | None) -> None:
    """Refuse a file of another format than pictures are written in, before one is drawn; None is no picture.

    Raises:
        UnsupportedFormatError: The name does not end in `.png`.
    """
    if path is not None:
        of_ending(path, {".png": png_of}, "write", "pictures")


def save_picture(path: str | PathLike[str], picture: Image.Image) -> None:
    """Write a picture; the file appears only when it is whole.

    Raises:
        UnsupportedFormatError: The name does not end in `.png`.
    """
    check_picture(path)
    with whole_file(path) as file:
        file.write(png_of(picture))
