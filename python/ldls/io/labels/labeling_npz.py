"""Labels in `.npz` files: what `ldls.save` writes, and plain arrays of anyone's own."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls.errors import CorruptFileError, InputError, UnsupportedFormatError
from ldls.io.arrays import open_npz, write_npz
from ldls.labeling import Labeling


def read_labeling_npz(path: str | PathLike[str]) -> Labeling:
    """Labels of an `.npz` file.

    It holds a segmentation's arrays, whose instances are its labels, or its tracks where it is tracked; or `classes`,
    `names` and, if there are any, `instances` and `ignored`.

    Raises:
        UnsupportedFormatError: The arrays are of neither kind.
        CorruptFileError: It is not a whole `.npz` file, or its arrays do not fit one another.
        FileNotFoundError: There is no such file.
    """
    with open_npz(path) as arrays:
        try:
            if {"labels", "object_name"} <= arrays.keys():
                return Labeling.from_instance_labels(
                    arrays["labels"], arrays["object_name"].tolist(), instance_ids=arrays.get("object_track")
                )
            if {"classes", "names"} <= arrays.keys():
                return _by_array(arrays)
        except InputError as error:
            raise CorruptFileError(str(error)) from None
        raise UnsupportedFormatError(
            f"found arrays {arrays.listed()}, expected labels and object_name (ldls.save), or classes and names"
        )


def read_confidence_npz(path: str | PathLike[str]) -> NDArray[np.floating] | None:
    """(N,) `confidence` of an `.npz` file, 0 to 1; None where it holds none.

    Raises:
        CorruptFileError: It is not a whole `.npz` file, or these are no numbers.
        FileNotFoundError: There is no such file.
    """
    with open_npz(path) as arrays:
        confidence = arrays.get("confidence")
        if confidence is not None and confidence.dtype.kind != "f":
            raise CorruptFileError(f"confidence is {confidence.dtype}, expected floating point")
        return confidence


def write_labeling(path: str | PathLike[str], labeling: Labeling) -> None:
    """Write the arrays of `labeling` to an `.npz` file under their names."""
    arrays = {"classes": labeling.classes, "instances": labeling.instances, "ignored": labeling.ignored}
    write_npz(path, arrays | {"names": np.array(labeling.names, np.str_)})


def _by_array(arrays: Mapping[str, NDArray[Any]]) -> Labeling:
    none = np.zeros(arrays["classes"].shape, np.int32)
    return Labeling(
        arrays["classes"],
        arrays.get("instances", none),
        arrays.get("ignored", none.astype(bool)),
        tuple(arrays["names"].tolist()),
    )
