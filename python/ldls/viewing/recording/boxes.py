"""Upright boxes in a recording."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls.segmentation import OrientedBox
from ldls.viewing.recording.stream import rerun


def boxes_3d(
    boxes: Sequence[OrientedBox],
    *,
    labels: Sequence[str],
    colours: NDArray[np.uint8],
    class_ids: NDArray[np.uint16],
) -> Any:  # noqa: ANN401
    """Boxes with a name, a colour and a class each; none, where there are none, take the place of earlier ones."""
    rr = rerun()
    half_yaws = np.array([box.yaw / 2 for box in boxes])
    upright = np.zeros_like(half_yaws)
    return rr.Boxes3D(
        centers=np.array([box.center for box in boxes]).reshape(-1, 3),
        half_sizes=np.array([box.size for box in boxes]).reshape(-1, 3) / 2,
        quaternions=np.stack([upright, upright, np.sin(half_yaws), np.cos(half_yaws)], axis=1),  # x y z w
        labels=list(labels),
        colors=colours,
        class_ids=class_ids,
        show_labels=True,
        fill_mode="MajorWireframe",
    )
