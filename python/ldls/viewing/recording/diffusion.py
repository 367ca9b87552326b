"""The spreading of likelihoods through the point cloud, product by product, in a recording."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

import ldls.stages as stages
from ldls._optional import require
from ldls.errors import ParameterError
from ldls.explaining import Rebuilt, rebuild
from ldls.palette import BACKGROUND, label_colours
from ldls.segmentation import Segmentation
from ldls.viewing.recording.contexts import Names, fields_of_points
from ldls.viewing.recording.entities import log_points
from ldls.viewing.recording.stream import Entity, rerun

TIMELINE = "iteration"
EVERY = 1
"""Products from one picture to the next."""
OF_CONVERGED = 200
"""Products that are shown of a result that was diffused until it converged."""


def log_diffusion(root: Entity, names: Names, result: Segmentation, every: int) -> None:
    """Log likelihoods after every so many products below `root`, as `Recording.log_diffusion` says."""
    if not every >= 1:
        raise ParameterError(f"every: got {every}, expected at least 1")
    rr = rerun()
    require("scipy.sparse", "viz")
    result = names.add(result)
    root.log(rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    names.log(root, names.of_points)
    points, stream = root / "points", root.stream.rerun
    stream.set_time(TIMELINE, sequence=0)
    system = rebuild(result)
    log_points(points, result.points[system.in_graph])
    for iteration, z in _steps(system, result, every):
        stream.set_time(TIMELINE, sequence=iteration)
        fields = fields_of_points(result, z.argmax(axis=1).astype(np.int32))
        points.log(rr.Points3D.from_fields(**fields | {"colors": _blended(z, label_colours(result.instances))}))
    stream.disable_timeline(TIMELINE)


def _steps(system: Rebuilt, result: Segmentation, every: int) -> Iterator[tuple[int, NDArray[np.float32]]]:
    """Number of products and the likelihoods (n, M + 1) after them: 0, `every`, 2 `every`, ..., and the last."""
    yield 0, np.zeros(system.b.shape, np.float32)
    iterations = result.params.iterations or OF_CONVERGED
    each = stages.diffuse(system.A, system.b, iterations=iterations, every=every, threads=result.params.threads)
    yield from zip([*range(every, iterations, every), iterations], each, strict=True)


def _blended(z: NDArray[np.float32], colours: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(n, 3) colour of each row's winner, blended into that of background by the share that the others have."""
    total = z.sum(axis=1, dtype=np.float64)
    share = np.divide(z.max(axis=1, initial=0), total, out=np.zeros(len(z)), where=total > 0)[:, None]
    grey = np.array(BACKGROUND, np.float64)
    mixed: NDArray[np.uint8] = np.rint(grey + share * (colours[z.argmax(axis=1)] - grey)).astype(np.uint8)
    return mixed
