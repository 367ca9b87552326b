"""A frame as it was read, in a recording."""

from __future__ import annotations

from typing import Any

import numpy as np

from ldls.cloud import Points, finite_rows
from ldls.datasets import CameraImage, Frame
from ldls.stages import project
from ldls.viewing.depth import depth_colours, depths_m
from ldls.viewing.recording.cameras import POINT_PX, log_camera, log_image
from ldls.viewing.recording.pinholes import PIXEL_CENTRE
from ldls.viewing.recording.stream import Entity, rerun
from ldls.viewing.recording.truth import log_truth


def log_frame(frame: Frame, *, entity: str = "world", recording: Any = None) -> None:  # noqa: ANN401
    """Log a frame without masks, at the time that is set: points by distance, points on images by depth, truth.

    Args:
        frame: The frame; its images are read here.
        entity: Where all goes.
        recording: A `rerun.RecordingStream`; the active one by default.

    Raises:
        InputError: No recording is active.
        LdlsError: An image cannot be read.
        ImportError: The extra `viz` is not installed.
    """
    rr = rerun()
    root = Entity(entity, recording)
    root.log(rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    xyz = frame.points[finite_rows(frame.points), :3].astype(np.float32)
    distance_m = np.linalg.norm(xyz.astype(np.float64), axis=1)
    (root / "points").log(rr.Points3D(xyz, colors=depth_colours(distance_m), radii=rr.Radius.ui_points(POINT_PX)))
    if frame.truth is not None:
        log_truth(root / "truth", frame.points, frame.truth)
    for image in frame.images:
        _log_camera_image(root / "camera" / image.name, image, frame.points)


def _log_camera_image(entity: Entity, image: CameraImage, points: Points) -> None:
    rr = rerun()
    pixels = image.read()
    size = (pixels.shape[0], pixels.shape[1])
    log_camera(entity, image.camera, size)
    log_image(entity / "image", pixels, size)
    in_view, uv_px = project(points, image.camera, image_size=size)
    (entity / "image" / "points").log(
        rr.Points2D(
            (uv_px + PIXEL_CENTRE).astype(np.float32),
            colors=depth_colours(depths_m(points[in_view], image.camera)),
            radii=rr.Radius.ui_points(POINT_PX),
        )
    )
