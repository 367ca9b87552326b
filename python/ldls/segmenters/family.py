"""The interface of a family of models: an image before the network, its outputs after it."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ldls.masks import InstanceMasks


class Family(Protocol):
    """Models whose inputs and outputs mean the same."""

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs that `masks` takes, in its order."""
        ...

    def tensor(self, image: NDArray[np.uint8]) -> NDArray[np.float32]:
        """(3, h, w) input for an image (H, W, 3), uint8 RGB."""
        ...

    def masks(self, outputs: list[NDArray[Any]], image_size: tuple[int, int], min_score: float) -> InstanceMasks:
        """Instances of at least `min_score` in an image of (height, width) pixels, from the network's outputs."""
        ...
