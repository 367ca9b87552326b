"""The layout in which the viewer first shows a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera
from ldls.viewing.recording.cameras import pinhole_of
from ldls.viewing.recording.stream import rerun

BEHIND_M, ABOVE_M, AHEAD_M = 8.0, 5.0, 15.0
"""Place of the eye and of the point that it looks at, seen from the first camera."""

STEPS_PER_S = {"frame": 10.0, "iteration": 40.0}
"""Speed of timelines; lidars turn ten times a second."""


@dataclass(frozen=True, kw_only=True)
class Contents:
    """Parts of a recording that there are to show.

    Attributes:
        cameras: Names of the cameras.
        labelled: True if points have labels, and objects a table.
        truth: True if there are true labels.
        diffusion: True if a diffusion is recorded.
        frames: Number of frames so far; more than one make curves.
        timeline: The timeline that is shown.
        eye: Places of the eye of the 3D view and of the point that it looks at, both (3,) in metres; the viewer's
            choice without.
        entity: The entity below which all is, save the diffusion.
    """

    cameras: tuple[str, ...] = ()
    labelled: bool = True
    truth: bool = False
    diffusion: bool = False
    frames: int = 1
    timeline: str = "frame"
    eye: tuple[tuple[float, ...], tuple[float, ...]] | None = None
    entity: str = "world"


def layout(contents: Contents) -> Any:  # noqa: ANN401
    """A `rerun.blueprint.Blueprint`: points in 3D, images with masks, the table of objects, and tabs for the rest.

    Raises:
        ImportError: The extra `viz` is not installed.
    """
    rrb = rerun().blueprint
    columns = [rrb.Tabs(*_clouds(contents), active_tab=0)]
    beside = _beside(contents)
    if beside:
        columns.append(rrb.Vertical(*beside))
    root = rrb.Horizontal(*columns, column_shares=[3, 2][: len(columns)])
    time = rrb.TimePanel(timeline=contents.timeline, state="collapsed", fps=STEPS_PER_S.get(contents.timeline))
    return rrb.Blueprint(root, time, collapse_panels=True)


def eye_behind(cameras: Sequence[Camera]) -> tuple[tuple[float, ...], tuple[float, ...]] | None:
    """Place of an eye behind and above the first camera, and one ahead of it, in metres; None without cameras."""
    if not cameras:
        return None
    _, pose = pinhole_of(cameras[0])
    middle, ahead, up = pose[:3, 3], pose[:3, 2], np.array([0.0, 0.0, 1.0])
    return _place(middle - BEHIND_M * ahead + ABOVE_M * up), _place(middle + AHEAD_M * ahead)


def _place(xyz_m: NDArray[np.float64]) -> tuple[float, ...]:
    return tuple(xyz_m.round(3).tolist())


def _clouds(contents: Contents) -> list[Any]:
    world = contents.entity
    labelled = ["+ $origin/**", "- $origin/points/direct", "- $origin/truth/**"]
    views = [_view_3d(contents, "points", world, labelled)]
    if contents.diffusion:
        views.append(_view_3d(contents, "diffusion", "diffusion", ["+ $origin/**"]))
    if contents.labelled:
        views.append(_view_3d(contents, "direct projection", world, ["+ $origin/points/direct"]))
    if contents.truth:
        views.append(_view_3d(contents, "truth", world, ["+ $origin/truth/**"]))
    return views


def _view_3d(contents: Contents, name: str, origin: str, filters: list[str]) -> Any:  # noqa: ANN401
    rrb = rerun().blueprint
    eye = None if contents.eye is None else rrb.EyeControls3D(position=contents.eye[0], look_target=contents.eye[1])
    return rrb.Spatial3DView(name=name, origin=origin, contents=filters, eye_controls=eye)


def _beside(contents: Contents) -> list[Any]:
    rr = rerun()
    rrb = rr.blueprint
    parts = []
    if contents.cameras:
        places = [f"{contents.entity}/camera/{rr.escape_entity_path_part(name)}" for name in contents.cameras]
        images = [rrb.Spatial2DView(name=n, origin=at) for n, at in zip(contents.cameras, places, strict=True)]
        parts.append(rrb.Grid(*images, grid_columns=ceil(sqrt(len(images)))) if len(images) > 1 else images[0])
    if contents.labelled:
        tables = [rrb.TextDocumentView(name="objects", origin=f"{contents.entity}/objects")]
        if contents.frames > 1:
            tables += [
                rrb.TimeSeriesView(name=name, origin=f"{contents.entity}/statistics/{of}")
                for name, of in (("counts", "points"), ("confidence", "confidence"), ("times", "milliseconds"))
            ]
        parts.append(rrb.Tabs(*tables, active_tab=0))
    return parts
