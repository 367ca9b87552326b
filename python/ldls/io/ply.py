"""Binary PLY with label, instance, confidence and colour."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ldls.io.labeled_points import CHANNELS, colors, instances, positions
from ldls.io.whole_file import whole_file

if TYPE_CHECKING:
    from ldls.segmentation import Segmentation

TYPE_NAMES = {"<f4": "float", "<f8": "double", "<u4": "uint", "|u1": "uchar"}


def write(path: Path, result: Segmentation) -> None:
    """Write all points: x y z (and intensity), colour, `label` (category id), `instance` and `confidence`.

    Points out of view have label and instance 0, as the background has.
    """
    position = positions(result)
    columns: dict[str, NDArray[np.number]] = {
        **position,
        **dict(zip(CHANNELS, colors(result).T, strict=True)),
        "label": result.categories,
        "instance": instances(result),
        "confidence": result.confidence,
    }
    real = "<f4" if result.points.dtype == np.float32 else "<f8"
    kinds = dict.fromkeys(position, real) | dict.fromkeys(CHANNELS, "|u1")
    kinds |= {"label": "<u4", "instance": "<u4", "confidence": "<f4"}
    vertices = np.empty(len(result.labels), list(kinds.items()))
    for name, column in columns.items():
        vertices[name] = column
    header = ["ply", "format binary_little_endian 1.0", "comment written by ldls"]
    header += [f"element vertex {len(vertices)}"]
    header += [f"property {TYPE_NAMES[kind]} {name}" for name, kind in kinds.items()]
    with whole_file(path) as file:
        file.write("\n".join([*header, "end_header\n"]).encode("ascii"))
        file.write(vertices.tobytes())
