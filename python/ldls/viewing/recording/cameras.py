"""Cameras in a recording: pinhole and pose, image, masks and the points that each sees."""

from __future__ import annotations

from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ldls.camera import Camera
from ldls.errors import InputError
from ldls.view import SeenView
from ldls.viewing.recording.stream import Entity, rerun

PIXEL_CENTRE = 0.5
"""Rerun's pixel centres lie at halves, ours at whole numbers."""
IMAGE_DISTANCE_M = 2.0
"""Distance of an image from its camera in the 3D view."""
JPEG_QUALITY = 85
MASK_OPACITY = 0.4


def pinhole_of(camera: Camera) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """K and T_lidar_camera of the pinhole with the projection of `camera`, exactly, where its lens is not distorted.

    K (3, 3) is upper triangular, of pixels whose centres lie at halves. T_lidar_camera (4, 4) is the pose: the rigid
    transform from camera (x right, y down, z forward) to lidar coordinates. The last column of a projection K [I | t],
    as of KITTI's P2, goes to the pose.
    """
    K = camera.projection[:, :3] / camera.projection[2, 2]
    T_pinhole_camera = np.eye(4)
    T_pinhole_camera[:3, 3] = np.linalg.solve(camera.projection[:, :3], camera.projection[:, 3])
    K[:2] += PIXEL_CENTRE * K[2]
    return K, np.asarray(np.linalg.inv(T_pinhole_camera @ camera.T_camera_lidar), np.float64)


def log_camera(entity: Entity, camera: Camera, image_size: tuple[int, int]) -> None:
    """Log pinhole and pose of a camera with images of (height, width)."""
    rr = rerun()
    K, pose = pinhole_of(camera)
    size, axes = image_size[::-1], rr.ViewCoordinates.RDF
    entity.log(
        rr.Pinhole(image_from_camera=K, resolution=size, camera_xyz=axes, image_plane_distance=IMAGE_DISTANCE_M),
        rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]),
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
    """Log the masks of a camera as an image of class ids, `ids` having one for each label.

    Where masks overlap, the highest label shows.
    """
    labels = np.zeros(seen.view.masks.image_size, np.int32)
    for at in np.argsort(seen.labels, kind="stable").tolist():
        mask = seen.view.masks[at]
        top, left, height, width = mask.bounding_box
        labels[top : top + height, left : left + width][mask.crop()] = seen.labels[at]
    small = int(ids.max(initial=0)) <= np.iinfo(np.uint8).max
    image = ids.astype(np.uint8 if small else np.uint16)[labels]
    entity.log(rerun().SegmentationImage(image, opacity=MASK_OPACITY))


def log_pixels(entity: Entity, uv_px: NDArray[np.float64], **fields: Any) -> None:  # noqa: ANN401
    """Log points on an image: (n, 2) pixels, and their colours, class ids and the like as `rerun.Points2D` has them."""
    entity.log(rerun().Points2D((uv_px + PIXEL_CENTRE).astype(np.float32), **fields))
