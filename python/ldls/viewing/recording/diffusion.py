"""How likelihoods spread through the point cloud, product by product, in a recording."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls import stages
from ldls._optional import require
from ldls.errors import ParameterError
from ldls.explaining import rebuild
from ldls.palette import BACKGROUND
from ldls.segmentation import Segmentation
from ldls.viewing.recording.cameras import POINT_PX
from ldls.viewing.recording.colours import check_ids, class_ids, keypoint_ids, label_colours
from ldls.viewing.recording.contexts import log_names
from ldls.viewing.recording.stream import Entity, rerun

TIMELINE = "iteration"
EVERY = 4
"""Products from one picture to the next: 50 pictures of 200 products."""
OF_CONVERGED = 200
"""Products that are shown of a result that was diffused until it converged."""


def log_diffusion(
    result: Segmentation,
    *,
    every: int = EVERY,
    entity: str = "diffusion",
    recording: Any = None,  # noqa: ANN401
) -> None:
    """Log the likelihoods of the points in view after every so many products, on the timeline "iteration".

    Logged are 0, `every`, 2 `every`, ... products, and the last. A point has the colour of its likeliest label, blended
    into that of background by the share that the others have. The graph is built again and every product computed,
    which takes longer than `ldls.segment` did. A result that was diffused until it converged is shown over 200
    products. Afterwards no time is set on "iteration".

    Args:
        result: The segmentation.
        every: Products from one picture to the next.
        entity: Where all goes.
        recording: A `rerun.RecordingStream`; the active one by default.

    Raises:
        ParameterError: `every` is less than 1.
        InputError: No recording is active.
        LimitError: A category id is greater than Rerun's ids.
        ImportError: The extra `viz` is not installed.
    """
    if not every >= 1:
        raise ParameterError(f"every: got {every}, expected at least 1")
    rr = rerun()
    require("scipy.sparse", "viz")
    root = Entity(entity, recording)
    check_ids(result)
    points = root / "points"
    categories = np.array([0, *(instance.category for instance in result.instances)], np.int32)
    root.log(rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    log_names(root, result)
    rr.set_time(TIMELINE, sequence=0, recording=recording)
    xyz = result.points[result.in_view, :3].astype(np.float32)
    points.log(rr.Points3D(xyz, radii=rr.Radius.ui_points(POINT_PX), show_labels=False))
    for iteration, z in steps(result, every):
        rr.set_time(TIMELINE, sequence=iteration, recording=recording)
        labels = z.argmax(axis=1)
        points.log(
            rr.Points3D.from_fields(
                colors=blended(z, label_colours(result)[:-1]),
                class_ids=class_ids(categories[labels]),
                keypoint_ids=keypoint_ids(labels.astype(np.int32)),
            )
        )
    rr.disable_timeline(TIMELINE, recording=recording)


def steps(result: Segmentation, every: int) -> Iterator[tuple[int, NDArray[np.float32]]]:
    """Number of products and the likelihoods (n, M + 1) after them: 0, `every`, 2 `every`, ..., and the last."""
    yield 0, np.zeros((len(result.in_view), len(result.instances) + 1), np.float32)
    system = rebuild(result)
    iterations = result.params.iterations or OF_CONVERGED
    each = stages.diffuse(system.A, system.b, iterations=iterations, every=every, threads=result.params.threads)
    yield from zip([*range(every, iterations, every), iterations], each, strict=True)


def blended(z: NDArray[np.float32], colours: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(n, 3) colour of each row's winner, blended into that of background by the share that the others have."""
    total = z.sum(axis=1, dtype=np.float64)
    share = np.divide(z.max(axis=1, initial=0), total, out=np.zeros(len(z)), where=total > 0)[:, None]
    grey = np.array(BACKGROUND, np.float64)
    mixed: NDArray[np.uint8] = np.rint(grey + share * (colours[z.argmax(axis=1)] - grey)).astype(np.uint8)
    return mixed
