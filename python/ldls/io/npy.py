"""Arrays in NumPy's own format, opened with care."""

from __future__ import annotations

import math
import tokenize
from os import PathLike
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from ldls.errors import CorruptFileError, FileFormatError, TruncatedFileError, UnsafeFileError
from ldls.io.regular_file import regular_file


def read_npy(path: str | PathLike[str]) -> NDArray[Any]:
    """The array of an `.npy` file.

    Raises:
        FileFormatError: It is not a whole `.npy` file, or holds Python objects.
    """
    path = regular_file(path)
    try:
        with path.open("rb") as file:
            return read_array(file, path.stat().st_size)
    except FileFormatError as error:
        raise type(error)(f"{path}: {error}") from None


def read_array(file: IO[bytes], n_bytes: int) -> NDArray[Any]:
    """The array of an open file or archive member of `n_bytes`; nothing is allocated for bytes that are not there.

    Raises:
        UnsafeFileError: It holds Python objects.
        TruncatedFileError: It ends before its array does.
        CorruptFileError: It is no `.npy` file.
    """
    try:
        version = npy.read_magic(file)
        read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, _, dtype = read_header(file)
        if dtype.hasobject:
            raise UnsafeFileError("object arrays are not loaded")
        # an entry of no bytes, as dtype U0 has it, counts as one: there could be any number of them
        expected = file.tell() + math.prod(shape) * max(dtype.itemsize, 1)
        if expected > n_bytes:
            raise TruncatedFileError(f"shape {shape} of {dtype} needs {expected} bytes, got {n_bytes}")
        file.seek(0)
        return np.asarray(npy.read_array(file, allow_pickle=False))
    except FileFormatError:
        raise
    except (ValueError, TypeError, SyntaxError, EOFError, tokenize.TokenError) as error:
        raise CorruptFileError(f"not a whole .npy file ({error})") from None
