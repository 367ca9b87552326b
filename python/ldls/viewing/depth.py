"""Points over the images of their frame, coloured by depth: a wrong calibration is seen at once."""

from __future__ import annotations

from math import ceil, sqrt

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ldls.camera import Camera
from ldls.cloud import Points
from ldls.datasets import Frame
from ldls.stages import project
from ldls.viewing.drawing import grid

NEAR_M, FAR_M = 3.0, 60.0
"""Depths at the ends of the colours: red and violet."""
TILE_PX = 960
ONE_PX = 1242
DIMMED = 0.6


def depth_picture(frame: Frame) -> Image.Image:
    """The images of a frame side by side, each with the points that its camera sees; of several with their names.

    Raises:
        LdlsError: An image cannot be read.
    """
    width = ONE_PX if len(frame.images) == 1 else TILE_PX
    tiles = [_tile(image.read(), frame.points, image.camera, width) for image in frame.images]
    names = [image.name for image in frame.images] if len(tiles) > 1 else []
    return grid(tiles, names, columns=ceil(sqrt(len(tiles))), gap_px=0)


def depth_colours(depth_m: NDArray[np.float64]) -> NDArray[np.uint8]:
    """(n, 3) colours of depths: red near, through yellow, green and blue to violet far, even in the logarithm."""
    place = np.log(np.clip(depth_m, NEAR_M, FAR_M) / NEAR_M) / np.log(FAR_M / NEAR_M)
    hue = 4.8 * place[:, None]  # sixths of the circle: 0 red, 2 green, 4 blue
    distance = np.abs((hue - [0, 2, 4] + 3) % 6 - 3)
    colours: NDArray[np.uint8] = np.round(255 * np.clip(2 - distance, 0, 1)).astype(np.uint8)
    return colours


def depths_m(points: Points, camera: Camera) -> NDArray[np.float64]:
    """(n,) depths of points (n, >= 3) in the camera frame, in metres."""
    row = camera.T_camera_lidar[2]
    depths: NDArray[np.float64] = points[:, :3].astype(np.float64) @ row[:3] + row[3]
    return depths


def _tile(image: NDArray[np.uint8], points: Points, camera: Camera, width: int) -> Image.Image:
    scale = width / image.shape[1]
    small = Image.fromarray(image).resize((width, round(image.shape[0] * scale)), Image.Resampling.BILINEAR)
    canvas = (np.asarray(small) * DIMMED).astype(np.uint8)
    seen, pixels = project(points, camera, image_size=(image.shape[0], image.shape[1]))
    depth = depths_m(points[seen], camera)
    order = np.argsort(-depth)  # the nearest are drawn last
    colours = depth_colours(depth[order])
    at = np.floor((pixels[order] + 0.5) * scale).astype(np.int64)
    for right, down in ((0, 0), (1, 0), (0, 1), (1, 1)):
        u, v = np.minimum(at[:, 0] + right, canvas.shape[1] - 1), np.minimum(at[:, 1] + down, canvas.shape[0] - 1)
        canvas[v, u] = colours
    return Image.fromarray(canvas)
