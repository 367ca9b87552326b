"""Several sweeps of a drive in one graph: lines that one sweep lacks, and an object with one label in all of them.

Points are brought together by where the lidar stood. Each takes the pixels of images of its own moment, for what moves
is elsewhere in those of others, but where these overlook an object, of the nearest that shows it; edges join points of
all moments. Two instances of two moments are one object if the points that both images see fall on both: of what stands
still nearly all of them do, and of what moves enough from one sweep to the next.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ldls.by_value import ByValue
from ldls.camera.rigid import as_transform, brought_together, inverse, rigid
from ldls.checks import checked
from ldls.checks.values import as_seconds
from ldls.cloud import Points, as_points
from ldls.doubts import warn_of
from ldls.errors import InputError, ShapeError, UprightWarning
from ldls.label_diffusion import check_finite, diffuse_labels, result_of
from ldls.params import Params
from ldls.segmentation import Segmentation
from ldls.sequences.trajectory import Trajectory, warn_of_rounded
from ldls.view import View, check_names

SAME_OBJECT = 0.1
"""Share of common points from which on instances of two images are one object: less than of one moment, for it may
have moved."""
FARTHEST_M = 1e7
"""Largest coordinate of a cloud, as in the core, which would name the row among those of all sweeps."""
SHARE_OF_NEIGHBORS = 0.5
"""Neighbours that a sweep adds, as a share of those of one alone: of the nearest many are of the same line at other
times, and only farther ones join lines."""
MOST_NEIGHBORS = 255
"""Neighbours of a point that the core takes."""
LEAST_UPRIGHT = 0.5
"""Cosine of the angle from z of the world to z of the lidar below which z of one of them is not up: of 60 degrees."""
NOT_UPRIGHT = (
    "pose: z of the lidar does not point up along z of the world, but tracks, velocities and maps are of what is seen "
    "along z; where z of the world is not up, multiply all poses from the left by the inverse of the first one; where "
    "z of the lidar is not, turn points, T_camera_lidar and poses until it is"
)
"""The same for all sweeps of a drive, so that it is said once."""


@checked
@dataclass(frozen=True, eq=False)
class Sweep(ByValue):
    """A sweep of the lidar, the images that go with it, and where the lidar stood.

    Attributes:
        points: (N, >= 3) float32 or float64, x y z first, in metres in the lidar frame. The array itself is kept: give
            a copy where a buffer is used again.
        views: Masks and camera of each image; cameras from the lidar at this sweep.
        pose: (4, 4) T_world_lidar: from the lidar frame of this sweep to one that all sweeps share, whose z is up.
            Where z of the lidar leans by more than 60 degrees there, an `UprightWarning` says so, and a
            `PrecisionWarning` where single precision is too coarse for its place.
        stamp: Time of the sweep in seconds.

    Raises:
        InputError: An argument is of another type, or a point is farther away than distances can be told.
        ParameterError: The stamp is not in seconds.
        CalibrationError: The pose is no rigid transform.
    """

    points: Points
    views: Sequence[View]
    pose: NDArray[np.float64]
    stamp: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", as_points(self.points))
        _check_coordinates(self.points)
        object.__setattr__(self, "views", tuple(self.views))
        given = self.pose
        object.__setattr__(self, "pose", rigid("pose", as_transform("pose", given)))
        warn_of_rounded("pose", given, self.pose[:3, 3])
        if self.pose[2, 2] < LEAST_UPRIGHT:
            warnings.warn(NOT_UPRIGHT, UprightWarning, stacklevel=4)
        as_seconds("stamp", self.stamp)
        check_names(self.views)


@checked
def segment_sweeps(
    sweeps: Sequence[Sweep],
    *,
    params: Params | None = None,
    nonfinite: Literal["drop", "raise"] = "drop",
    keep_origin: bool = False,
    same_object: float = SAME_OBJECT,
) -> tuple[Segmentation, ...]:
    """Instance labels of the points of a few sweeps in a row, by label diffusion over all of them together.

    A point that no image of its own sweep sees has a label too, if an image of another sees its place. With S sweeps
    the graph has S / 2 times the `neighbors` of the parameters, at least these and at most 255.

    Args:
        sweeps: Some tenths of a second of a drive, in the order of their stamps; five are a good number.
        params: Parameters of the method; the best known by default.
        nonfinite: As of `ldls.segment`.
        keep_origin: As of `ldls.segment`.
        same_object: As of `ldls.segment`, of images of one moment and of several.

    Returns:
        A result a sweep, points in its own lidar frame. A label stands for the same object in all of them; `instances`
        are the same but for their sources. Of the report, `n_points`, `n_in_view` and `empty_masks` are of the sweep;
        all else, and the timings, are of all sweeps together.

    Raises:
        InputError: There is no sweep, one is not later than the one before it, or one cannot be used; see its
            subclasses.
        PoseError: Two in a row are farther from each other than 100 m/s allow.
        LimitError: The sweeps together have more points than the graph can index.
    """
    results, report = label_sweeps(
        sweeps, params=params, nonfinite=nonfinite, keep_origin=keep_origin, same_object=same_object
    )
    warn_of(results, report, stacklevel=4)
    return results


def label_sweeps(
    sweeps: Sequence[Sweep],
    *,
    params: Params | None,
    nonfinite: str,
    keep_origin: bool,
    same_object: float,
) -> tuple[tuple[Segmentation, ...], Mapping[str, Any]]:
    """What `segment_sweeps` does without its warnings, and what the core reports of all sweeps together."""
    if not sweeps:
        raise InputError("sweeps: got none, expected one or more")
    check_drive(sweeps)
    if nonfinite == "raise":
        for sweep in sweeps:
            check_finite(sweep.points)
    params = params or Params()
    here = inverse(sweeps[len(sweeps) // 2].pose)
    to_here = [here @ sweep.pose for sweep in sweeps]
    rows = list(pairwise(np.cumsum([0, *(len(sweep.points) for sweep in sweeps)]).tolist()))
    views = [
        replace(view, camera=replace(view.camera, T_camera_lidar=view.camera.T_camera_lidar @ inverse(transform)))
        for sweep, transform in zip(sweeps, to_here, strict=True)
        for view in sweep.views
    ]
    neighbors = min(round(params.neighbors * max(1.0, SHARE_OF_NEIGHBORS * len(sweeps))), MOST_NEIGHBORS)
    arrays = diffuse_labels(
        brought_together([sweep.points for sweep in sweeps], to_here, keep_origin=keep_origin),
        views,
        [own for sweep, own in zip(sweeps, rows, strict=True) for _ in sweep.views] if len(sweeps) > 1 else None,
        replace(params, neighbors=neighbors),
        keep_origin=keep_origin,
        same_object=same_object,
    )
    firsts = np.cumsum([0, *(len(sweep.views) for sweep in sweeps)]).tolist()
    results = []
    for number, (sweep, own) in enumerate(zip(sweeps, rows, strict=True)):
        of_sweep = range(firsts[number], firsts[number + 1])
        result = result_of(arrays, views, sweep.points, params, rows=own, own=of_sweep)
        given = zip(result.views, sweep.views, strict=True)
        seen = tuple(replace(seen, view=view) for seen, view in given)
        results.append(replace(result, views=seen, report=replace(result.report, n_sweeps=len(sweeps))))
    return tuple(results), arrays.report


def check_order(sweeps: Sequence[Sweep], after: float = -math.inf) -> None:
    """Refuse sweeps that are not each later than the one before, and the first than a stamp in seconds.

    Raises:
        InputError: One is not later.
    """
    for before, stamp in pairwise([after, *(sweep.stamp for sweep in sweeps)]):
        if stamp == before:
            raise InputError(f"sweeps: two have the stamp {stamp} s; leave one of them out, or give each its own")
        if not stamp > before:
            raise InputError(f"sweeps: one of {stamp} s comes after one of {before} s; sort them by their stamps")


def check_drive(sweeps: Sequence[Sweep]) -> None:
    """Refuse sweeps that are not of one drive, each later than the one before.

    Raises:
        InputError: One is not later.
        PoseError: Two in a row are farther from each other than a lidar moves.
    """
    check_order(sweeps)
    Trajectory(np.array([sweep.stamp for sweep in sweeps]), np.array([sweep.pose for sweep in sweeps]))


def check_points(sweep: Sweep, result: Segmentation) -> None:
    """Refuse a result of another sweep.

    Raises:
        ShapeError: It has more or fewer points.
        InputError: They are others.
    """
    if len(result.labels) != len(sweep.points):
        raise ShapeError(f"result: has {len(result.labels)} points, the sweep {len(sweep.points)}; give its own")
    own, given = result.points[:, :3], sweep.points[:, :3]
    if result.points is not sweep.points and not np.array_equal(own, given, equal_nan=True):
        raise InputError(
            "result: is of as many other points than those of the sweep; give its own, or where these were moved, "
            "dataclasses.replace(result, points=sweep.points)"
        )


def _check_coordinates(points: Points) -> None:
    if not points.size or max(-points.min(), points.max()) <= FARTHEST_M:
        return
    xyz = points[:, :3]
    far = np.isfinite(xyz) & (np.abs(xyz) > FARTHEST_M)
    if far.any():
        row, column = np.argwhere(far)[0].tolist()
        raise InputError(
            f"points: row {row} has a coordinate of {xyz[row, column]:g} m, expected |x|, |y|, |z| <= "
            f"{FARTHEST_M:g} m; pass metres, or NaN where there is no return"
        )
