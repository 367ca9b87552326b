"""Camera images from files."""

from __future__ import annotations

import warnings
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ldls.errors import CorruptFileError, LimitError


def read_image(path: str | PathLike[str]) -> NDArray[np.uint8]:
    """(H, W, 3) RGB pixels of an image file of any format that Pillow reads.

    Raises:
        CorruptFileError: It is no image, or not a whole one.
        LimitError: It has more pixels than Pillow takes for safe (178,956,970).
        FileNotFoundError: There is no such file.
    """
    path = Path(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(path) as image:
                return np.asarray(image.convert("RGB"))
    except Image.DecompressionBombError as error:
        raise LimitError(f"{path}: {error}") from None
    except (FileNotFoundError, PermissionError, IsADirectoryError):
        raise
    except (OSError, SyntaxError, ValueError) as error:
        raise CorruptFileError(f"{path}: not a whole image ({error})") from None
