"""NumPy's `.npy` files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ldls.cloud import Points, as_points
from ldls.errors import CorruptFileError, InputError, UnsafeFileError


def read(path: Path) -> Points:
    """(N, >= 3) points of an `.npy` file, in its own precision.

    Raises:
        CorruptFileError: It is not a whole `.npy` file.
        UnsafeFileError: It holds Python objects.
        ShapeError: The array is not (N, >= 3).
        DtypeError: The values are not float32 or float64.
    """
    try:
        array = np.load(path, allow_pickle=False)
    except ValueError as error:
        if "pickle" in str(error) or "Object arrays" in str(error):
            raise UnsafeFileError(f"{path.name}: object arrays are not loaded") from None
        raise CorruptFileError(f"{path.name}: not a whole .npy file ({error})") from None
    except EOFError:
        raise CorruptFileError(f"{path.name}: expected a .npy file, got an empty one") from None
    try:
        return as_points(array)
    except InputError as error:
        raise type(error)(f"{path.name}: {error}") from None
