"""How a rig and the objects around it move while its lidar turns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Motion:
    """Where a rig and M objects are at each of the n firings of a turn, as seen from the rig at the stamp of the sweep.

    Attributes:
        times: (n,) seconds since the stamp, negative before it.
        rig: (n, 4, 4) transform from the ground below the rig at each firing to that below it at the stamp.
        ways_m: (M, n, 3) way of each object since the stamp, in metres.
    """

    times: NDArray[np.float64]
    rig: NDArray[np.float64]
    ways_m: NDArray[np.float64]
