"""SemanticKITTI `.label` files: uint32 a point, semantic class in the lower half, instance in the upper."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ldls.io.files import whole_file
from ldls.segmentation import Segmentation

OTHER_OBJECT = 99
CLASSES = {1: 30, 2: 11, 3: 10, 4: 15, 6: 13, 7: 16, 8: 18, 13: 81, 64: 70}
"""SemanticKITTI class of a COCO category: person, bicycle, car, motorcycle, bus, on-rails, truck, traffic sign and
vegetation; anything else is `OTHER_OBJECT`. Background and points out of view are 0, unlabeled."""


def write(path: Path, result: Segmentation) -> None:
    """Write the labels of `result`, one a point in the order of the cloud."""
    classes = [CLASSES.get(instance.category, OTHER_OBJECT) for instance in result.instances]
    # label -1, out of view, picks the last entry
    by_label = np.array([0, *classes, 0], np.uint32)
    by_label[1:-1] |= np.arange(1, len(classes) + 1, dtype=np.uint32) << 16
    with whole_file(path) as file:
        file.write(by_label[result.labels].astype("<u4").tobytes())
