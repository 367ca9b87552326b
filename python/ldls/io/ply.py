"""Binary PLY with label, instance, confidence and colour."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ldls.io.whole_file import whole_file
from ldls.palette import BACKGROUND, palette

if TYPE_CHECKING:
    from ldls.segmentation import Segmentation

TYPE_NAMES = {"<f4": "float", "<f8": "double", "<u4": "uint", "|u1": "uchar"}


def write(path: Path, result: Segmentation) -> None:
    """Write all points: x y z (and intensity), colour, `label` (category id), `instance` and `confidence`.

    Points out of view have label and instance 0, as the background has.
    """
    real = "<f4" if result.points.dtype == np.float32 else "<f8"
    position = ["x", "y", "z", "intensity"][: result.points.shape[1]]
    fields = [(name, real) for name in position]
    fields += [(name, "|u1") for name in ("red", "green", "blue")]
    fields += [("label", "<u4"), ("instance", "<u4"), ("confidence", "<f4")]
    vertices = np.empty(len(result.labels), fields)
    for column, name in enumerate(position):
        vertices[name] = result.points[:, column]
    # label -1, out of view, picks the last entry
    colors = np.vstack([[BACKGROUND], palette(len(result.instances)), [BACKGROUND]])[result.labels]
    for channel, name in enumerate(("red", "green", "blue")):
        vertices[name] = colors[:, channel]
    vertices["label"] = result.categories
    vertices["instance"] = np.maximum(result.labels, 0)
    vertices["confidence"] = result.confidence
    header = ["ply", "format binary_little_endian 1.0", "comment written by ldls"]
    header += [f"element vertex {len(vertices)}"]
    header += [f"property {TYPE_NAMES[kind]} {name}" for name, kind in fields]
    with whole_file(path) as file:
        file.write("\n".join([*header, "end_header\n"]).encode("ascii"))
        file.write(vertices.tobytes())
