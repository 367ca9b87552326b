"""Arrays of other programs as NumPy's."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls.errors import MaskError


def to_numpy(values: Any) -> NDArray[Any]:  # noqa: ANN401
    """`values`, an array or a tensor on any device, with or without gradient."""
    if not hasattr(values, "detach"):
        return np.asarray(values)
    tensor = values.detach().cpu()
    try:
        return np.asarray(tensor.numpy())
    except TypeError:  # bfloat16, which NumPy does not have
        return np.asarray(tensor.float().numpy())


def whole_numbers(name: str, values: Any) -> list[int]:  # noqa: ANN401
    """Class indices, which some programs keep as floats.

    Raises:
        MaskError: One of them is no whole number; the message names its instance.
    """
    array = to_numpy(values)
    if array.ndim != 1 or array.dtype.kind not in "iuf":
        raise MaskError(f"{name}: expected one number an instance, got {array.dtype} of shape {array.shape}")
    for i, value in enumerate(array.tolist()):
        if value != value or value % 1 != 0:
            raise MaskError(f"mask {i}: {name} is {value}, expected a whole number")
    return [int(value) for value in array.tolist()]
