"""Cameras in a recording: pose, image, masks and the points that each sees."""

from __future__ import annotations

from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ldls.camera import Camera
from ldls.errors import InputError
from ldls.segmentation import Segmentation
from ldls.view import SeenView
from ldls.viewing.recording.colours import class_ids, keypoint_ids, label_colours
from ldls.viewing.recording.pinholes import PIXEL_CENTRE, pinhole_of
from ldls.viewing.recording.stream import Entity, rerun

IMAGE_DISTANCE_M = 2.0
"""How far before its camera an image stands in the 3D view."""
JPEG_QUALITY = 85
MASK_OPACITY = 0.4
POINT_PX = 1.5
BACKGROUND_POINT_PX = 0.5
"""Points without an object are small on an image, which they would hide."""


def log_camera(entity: Entity, camera: Camera, image_size: tuple[int, int]) -> None:
    """Log pinhole and pose."""
    rr = rerun()
    found = pinhole_of(camera)
    height, width = image_size
    entity.log(
        rr.Pinhole(
            image_from_camera=found.K,
            resolution=[width, height],
            camera_xyz=rr.ViewCoordinates.RDF,
            image_plane_distance=IMAGE_DISTANCE_M,
        ),
        rr.Transform3D(translation=found.T_lidar_camera[:3, 3], mat3x3=found.T_lidar_camera[:3, :3]),
    )


def log_image(entity: Entity, pixels: NDArray[np.uint8], image_size: tuple[int, int]) -> None:
    """Log an image (H, W, 3).

    Raises:
        InputError: It is no RGB image, or of another size.
    """
    expected = (*image_size, 3)
    if pixels.dtype != np.uint8 or pixels.shape != expected:
        raise InputError(
            f"images: {entity.path}: expected uint8 {expected} as the masks are, got {pixels.dtype} {pixels.shape}"
        )
    jpeg = BytesIO()
    Image.fromarray(pixels).save(jpeg, "JPEG", quality=JPEG_QUALITY)
    entity.log(rerun().EncodedImage(contents=jpeg.getvalue(), media_type="image/jpeg"))


def log_masks(entity: Entity, seen: SeenView, ids: NDArray[np.uint16]) -> None:
    """Log the masks of a camera as an image of class ids, `ids` having one for each label."""
    small = int(ids.max(initial=0)) <= np.iinfo(np.uint8).max
    image = ids.astype(np.uint8 if small else np.uint16)[label_image(seen)]
    entity.log(rerun().SegmentationImage(image, opacity=MASK_OPACITY))


def log_pixels(entity: Entity, seen: SeenView, result: Segmentation) -> None:
    """Log the points that a camera of a result saw, in its image."""
    rr = rerun()
    labels = result.labels[seen.in_view]
    entity.log(
        rr.Points2D(
            (seen.pixels + PIXEL_CENTRE).astype(np.float32),
            colors=label_colours(result)[labels],
            class_ids=class_ids(result.categories[seen.in_view]),
            keypoint_ids=keypoint_ids(labels),
            radii=rr.Radius.ui_points(np.where(labels > 0, POINT_PX, BACKGROUND_POINT_PX)),
            show_labels=False,
        )
    )


def label_image(seen: SeenView) -> NDArray[np.int32]:
    """(H, W) label of the mask that covers each pixel, 0 where there is none; of several, the highest label."""
    image = np.zeros(seen.view.masks.image_size, np.int32)
    for at in np.argsort(seen.labels, kind="stable").tolist():
        mask = seen.view.masks[at]
        top, left, height, width = mask.bounding_box
        image[top : top + height, left : left + width][mask.crop()] = seen.labels[at]
    return image
