"""Image files: PNG and JPEG."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from os import PathLike
from typing import IO

import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags, Image, UnidentifiedImageError
from PIL.Image import Transpose

import ldls._ldls as _ldls
from ldls.checks import checked
from ldls.errors import CorruptFileError, LimitError, TruncatedFileError, UnsupportedFormatError
from ldls.io.arrays import DEFLATE_RATIO
from ldls.io.files import open_file, parsing

MAX_BYTES = 1 << 30
SIGNATURES = {"PNG": b"\x89PNG\r\n\x1a\n", "JPEG": b"\xff\xd8\xff"}
"""First bytes of each format that is opened: Pillow knows more of them, and starts programs for some."""
CHANNELS = {"L": 1, "LA": 2, "RGB": 3, "RGBA": 4}
"""Bytes of a pixel by the mode of a picture."""
PIXELS_A_BYTE = 1024
"""Most pixels that a byte of a JPEG can hold: a block of 64 takes a bit, and often more."""
TURNS = {
    2: Transpose.FLIP_LEFT_RIGHT, 3: Transpose.ROTATE_180, 4: Transpose.FLIP_TOP_BOTTOM, 5: Transpose.TRANSPOSE,
    6: Transpose.ROTATE_270, 7: Transpose.TRANSVERSE, 8: Transpose.ROTATE_90,
}  # fmt: skip
"""How a picture is to be turned, by the orientation in its EXIF."""
SIDEWAYS = (5, 6, 7, 8)


@checked
def read_image(path: str | PathLike[str]) -> NDArray[np.uint8]:
    """(H, W, 3) RGB pixels of a PNG or JPEG file, whatever its name ends in.

    A JPEG is turned upright by its EXIF; of 16 bits the upper 8 are taken.

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
    """(height, width) in pixels of a PNG or JPEG file, by its head, of the upright picture.

    Raises:
        UnsupportedFormatError: It is of another format.
        CorruptFileError: It is no image.
        LimitError: It has more pixels than Pillow takes.
        FileNotFoundError: There is no such file.
    """
    with open_file(path, "image", limit=MAX_BYTES) as file, _opened(file) as image:
        size = image.height, image.width
        return size[::-1] if _orientation(image) in SIDEWAYS else size


def decode(file: IO[bytes], n_bytes: int) -> NDArray[np.uint8]:
    """(H, W, 3) RGB pixels of a PNG or JPEG of `n_bytes`, as those of `read_image`.

    Raises:
        FileFormatError: It is of another format, or not whole.
        LimitError: It has more pixels than Pillow takes.
    """
    with parsing("image"), _opened(file) as image:
        check_pixels(image, n_bytes)
        turn = TURNS.get(_orientation(image))
        # of 16 bits of grey Pillow makes white from 255 on
        grey = Image.fromarray((np.asarray(image) >> 8).astype(np.uint8)) if image.mode.startswith("I") else image
        rgb = grey.convert("RGB")
        return np.asarray(rgb if turn is None else rgb.transpose(turn))


def _orientation(image: Image.Image) -> int:
    """Orientation of a JPEG by its EXIF, as OpenCV takes it: 1 to 8, and 1 where it does not say or is broken."""
    if image.format != "PNG":
        with suppress(Exception):  # whatever Pillow raises on it, the picture may be whole
            return int(image.getexif().get(ExifTags.Base.Orientation, 1))
    return 1


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
        raise TruncatedFileError(f"{image.height} x {image.width} pixels cannot come of {n_bytes:,} bytes")


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
