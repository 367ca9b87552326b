"""Image files."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ldls.checks import checked
from ldls.errors import CorruptFileError, LimitError


@checked
def read_image(path: str | PathLike[str]) -> NDArray[np.uint8]:
    """(H, W, 3) RGB pixels.

    Raises:
        CorruptFileError: It is no image, or not a whole one.
        LimitError: It has more pixels than Pillow takes.
        FileNotFoundError: There is no such file.
    """
    with _opened(Path(path)) as image:
        return np.asarray(image.convert("RGB"))


@checked
def read_image_size(path: str | PathLike[str]) -> tuple[int, int]:
    """(height, width) in pixels, by the head of the file.

    Raises:
        CorruptFileError: It is no image.
        LimitError: It has more pixels than Pillow takes.
        FileNotFoundError: There is no such file.
    """
    with _opened(Path(path)) as image:
        return image.height, image.width


@contextmanager
def _opened(path: Path) -> Iterator[Image.Image]:
    try:
        with Image.open(path) as image:
            yield image
    except Image.DecompressionBombError as error:
        raise LimitError(f"{path}: {error}") from None
    except (FileNotFoundError, PermissionError, IsADirectoryError):
        raise
    except (OSError, SyntaxError, ValueError) as error:
        raise CorruptFileError(f"{path}: not a whole image ({error})") from None
