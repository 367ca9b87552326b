"""Pictures as files."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from os import PathLike
from pathlib import Path

from PIL import Image

from ldls.errors import UnsupportedFormatError
from ldls.io.files import whole_file
from ldls.segmentation import Segmentation
from ldls.viewing.birds_eye import birds_eye_view
from ldls.viewing.comparison import comparison
from ldls.viewing.overlay import overlay
from ldls.viewing.shown import Images


def save_pictures(path: str | PathLike[str], result: Segmentation, images: Images = None) -> list[Path]:
    """Write the overlay to `path`, and beside it NAME-birds-eye.png and NAME-comparison.png; return their paths.

    Args:
        path: `NAME.png`.
        result: The segmentation.
        images: As for `overlay`.

    Raises:
        UnsupportedFormatError: The name does not end in `.png`.
        InputError: There are more or fewer images than cameras, or one has not the size of the masks.
    """
    path = Path(path)
    drawn: dict[Path, Callable[[], Image.Image]] = {
        path: lambda: overlay(result, images),
        path.with_name(f"{path.stem}-birds-eye{path.suffix}"): lambda: birds_eye_view(result),
        path.with_name(f"{path.stem}-comparison{path.suffix}"): lambda: comparison(result, images),
    }
    # one is packed while the next is drawn
    with ThreadPoolExecutor(1) as packing:
        saved = [packing.submit(save_picture, file, draw()) for file, draw in drawn.items()]
    for each in saved:
        each.result()
    return list(drawn)


def save_picture(path: str | PathLike[str], picture: Image.Image) -> None:
    """Write a picture; the file appears only when it is whole.

    Raises:
        UnsupportedFormatError: The name does not end in `.png`.
    """
    path = Path(path)
    if path.suffix.lower() != ".png":
        raise UnsupportedFormatError(f"{path}: cannot write {path.suffix!r} pictures, expected .png")
    with whole_file(path) as file:
        # a quarter of the time of the default level, and 6 % larger
        picture.save(file, "PNG", compress_level=1)
