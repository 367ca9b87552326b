"""How the viewer shows a recording at first."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera
from ldls.viewing.recording.pinholes import pinhole_of
from ldls.viewing.recording.stream import blueprints, rerun

BEHIND_M, ABOVE_M, AHEAD_M = 8.0, 5.0, 15.0
"""Where the eye is, and what it looks at, seen from the first camera."""

STEPS_PER_S = {"frame": 10.0, "iteration": 40.0}
"""How fast timelines run; lidars turn ten times a second."""


@dataclass(frozen=True, kw_only=True)
class Contents:
    """What of a recording there is to show.

    Attributes:
        cameras: Names of the cameras.
        labelled: Whether points have labels, and objects a table.
        truth: Whether there are true labels.
        diffusion: Whether a diffusion is recorded.
        frames: Number of frames so far; more than one make curves.
        timeline: The timeline that is shown.
        eye: Where the eye of the 3D view is and what it looks at, both (3,) in metres; the viewer's choice without.
        entity: Below which all is, save the diffusion.
    """

    cameras: tuple[str, ...] = ()
    labelled: bool = True
    truth: bool = False
    diffusion: bool = False
    frames: int = 1
    timeline: str = "frame"
    eye: tuple[tuple[float, ...], tuple[float, ...]] | None = None
    entity: str = "world"


def layout(shown: Contents) -> Any:  # noqa: ANN401
    """A `rerun.blueprint.Blueprint`: points in 3D, images with masks, the table of objects, and tabs for the rest.

    Raises:
        ImportError: The extra `viz` is not installed.
    """
    rrb = blueprints()
    columns = [rrb.Tabs(*_clouds(shown), active_tab=0)]
    beside = _beside(shown)
    if beside:
        columns.append(rrb.Vertical(*beside))
    root = rrb.Horizontal(*columns, column_shares=[3, 2][: len(columns)])
    time = rrb.TimePanel(timeline=shown.timeline, state="collapsed", fps=STEPS_PER_S.get(shown.timeline))
    return rrb.Blueprint(root, time, collapse_panels=True)


def eye_behind(camera: Camera) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Place of an eye behind and above a camera, and what it looks at ahead of it, in metres in the lidar frame."""
    pose = pinhole_of(camera).T_lidar_camera
    middle, ahead, up = pose[:3, 3], pose[:3, 2], np.array([0.0, 0.0, 1.0])
    return _place(middle - BEHIND_M * ahead + ABOVE_M * up), _place(middle + AHEAD_M * ahead)


def _place(xyz_m: NDArray[np.float64]) -> tuple[float, ...]:
    return tuple(float(value) for value in xyz_m.round(3))


def _clouds(shown: Contents) -> list[Any]:
    world = shown.entity
    contents = ["+ $origin/**", "- $origin/points/direct", "- $origin/truth/**"]
    views = [_view_3d(shown, "points", world, contents)]
    if shown.diffusion:
        views.append(_view_3d(shown, "diffusion", "diffusion", ["+ $origin/**"]))
    if shown.labelled:
        views.append(_view_3d(shown, "direct projection", world, ["+ $origin/points/direct"]))
    if shown.truth:
        views.append(_view_3d(shown, "truth", world, ["+ $origin/truth/**"]))
    return views


def _view_3d(shown: Contents, name: str, origin: str, contents: list[str]) -> Any:  # noqa: ANN401
    rrb = blueprints()
    eye = None if shown.eye is None else rrb.EyeControls3D(position=shown.eye[0], look_target=shown.eye[1])
    return rrb.Spatial3DView(name=name, origin=origin, contents=contents, eye_controls=eye)


def _beside(shown: Contents) -> list[Any]:
    rrb, rr = blueprints(), rerun()
    parts = []
    if shown.cameras:
        places = [f"{shown.entity}/camera/{rr.escape_entity_path_part(name)}" for name in shown.cameras]
        images = [rrb.Spatial2DView(name=n, origin=at) for n, at in zip(shown.cameras, places, strict=True)]
        parts.append(rrb.Grid(*images, grid_columns=ceil(sqrt(len(images)))) if len(images) > 1 else images[0])
    if shown.labelled:
        tables = [rrb.TextDocumentView(name="objects", origin=f"{shown.entity}/objects")]
        if shown.frames > 1:
            tables += [
                rrb.TimeSeriesView(name=name, origin=f"{shown.entity}/statistics/{of}")
                for name, of in (("counts", "points"), ("confidence", "confidence"), ("times", "milliseconds"))
            ]
        parts.append(rrb.Tabs(*tables, active_tab=0))
    return parts
