"""Binary PCD with label, instance, confidence and colour."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ldls._optional import require
from ldls.io.labeled_points import colors, instances, positions
from ldls.io.whole_file import whole_file

if TYPE_CHECKING:
    from ldls.segmentation import Segmentation


def write(path: Path, result: Segmentation) -> None:
    """Write all points: x y z (and intensity), `label` (category id), `instance`, `confidence` and `rgb`.

    Points out of view have label and instance 0, as the background has. The colour is packed as the Point Cloud
    Library has it: the bits of 0x00RRGGBB as a float.

    Raises:
        ImportError: The extra `pcd` is not installed.
    """
    pypcd4 = require("pypcd4", "pcd")
    columns = {name: np.ascontiguousarray(column) for name, column in positions(result).items()}
    columns |= {
        "label": result.categories.astype(np.uint32),
        "instance": instances(result),
        "confidence": result.confidence,
        "rgb": _packed(colors(result)),
    }
    cloud = pypcd4.PointCloud.from_points(
        list(columns.values()), list(columns), [column.dtype for column in columns.values()]
    )
    with whole_file(path) as file:
        cloud.save(file, pypcd4.Encoding.BINARY)


def _packed(rgb: NDArray[np.uint8]) -> NDArray[np.float32]:
    red, green, blue = rgb.astype(np.uint32).T
    packed: NDArray[np.float32] = (red << 16 | green << 8 | blue).view(np.float32)
    return packed
