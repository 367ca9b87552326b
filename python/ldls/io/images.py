"""Image files: PNG and JPEG."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from typing import IO

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

import ldls._ldls as _ldls
from ldls.checks import checked
from ldls.errors import CorruptFileError, LimitError, TruncatedFileError, UnsupportedFormatError
from ldls.io.files import open_file, parsing

MAX_BYTES = 1 << 30
SIGNATURES = {"PNG": b"\x89PNG\r\n\x1a\n", "JPEG": b"\xff\xd8\xff"}
"""First bytes of each format that is opened: Pillow knows more of them, and starts programs for some."""
CHANNELS = {"L": 1, "LA": 2, "RGB": 3, "RGBA": 4}
"""Bytes of a pixel by the mode of a picture."""
DEFLATE_RATIO = 1032
"""Nothing in a PNG unpacks to more than so many times its size."""
PIXELS_A_BYTE = 1024
"""Most pixels that a byte of a JPEG can hold: a block of 64 takes a bit, and often more."""


@checked
def read_image(path: str | PathLike[str]) -> NDArray[np.uint8]:
    """(H, W, 3) RGB pixels of a PNG or JPEG file, whatever its name ends in.

    Raises:
        UnsupportedFormatError: It is of another format.
        CorruptFileError: It is not a whole image.
        LimitError: It has more pixels than Pillow takes.
        FileNotFoundError: There is no such file.
    """
    with open_file(path, "image", limit=MAX_BYTES) as file:
        return decode(file, file.size)


@checked
def read_image_size(path: str | PathLike[str]) -> tuple[int, int]:
    """(height, width) in pixels of a PNG or JPEG file, by its head.

    Raises:
        UnsupportedFormatError: It is of another format.
        CorruptFileError: It is no image.
        LimitError: It has more pixels than Pillow takes.
        FileNotFoundError: There is no such file.
    """
    with open_file(path, "image", limit=MAX_BYTES) as file, _opened(file) as image:
        return image.height, image.width


def decode(file: IO[bytes], n_bytes: int) -> NDArray[np.uint8]:
    """(H, W, 3) RGB pixels of a PNG or JPEG of `n_bytes`.

    Raises:
        FileFormatError: It is of another format, or not whole.
        LimitError: It has more pixels than Pillow takes.
    """
    with parsing("image"), _opened(file) as image:
        check_pixels(image, n_bytes)
        return np.asarray(image.convert("RGB"))


def png_of(picture: Image.Image) -> bytes:
    """The PNG file of a picture; one of another mode than Pillow's L, LA, RGB and RGBA becomes RGBA."""
    if picture.mode not in CHANNELS:
        picture = picture.convert("RGBA")
    return _ldls.pack_png(*picture.size, CHANNELS[picture.mode], picture.tobytes())


def check_pixels(image: Image.Image, n_bytes: int) -> None:
    """Hold the size of an image against the bytes that there are, before memory is taken for its pixels.

    Raises:
        TruncatedFileError: So many pixels cannot come of them.
    """
    pixels, bands = image.width * image.height, len(image.getbands())
    png_bytes = pixels * (bands if bands > 1 else 1 / 8)
    if png_bytes > DEFLATE_RATIO * n_bytes if image.format == "PNG" else pixels > PIXELS_A_BYTE * n_bytes:
        raise TruncatedFileError(f"{image.width} x {image.height} pixels cannot come of {n_bytes:,} bytes")


@contextmanager
def _opened(file: IO[bytes]) -> Iterator[Image.Image]:
    start = file.read(max(map(len, SIGNATURES.values())))
    file.seek(0)
    formats = [name for name, signature in SIGNATURES.items() if start.startswith(signature)]
    if start and not formats:
        raise UnsupportedFormatError(
            f"not a whole image: begins with {start!r}, expected a JPEG or PNG; convert it to one"
        )
    try:
        with Image.open(file, formats=formats) as image:
            yield image
    except UnidentifiedImageError:
        raise CorruptFileError("not a whole image (its head is broken)") from None
    except (Image.DecompressionBombError, Image.DecompressionBombWarning) as error:
        raise LimitError(str(error)) from None
