"""The frames that are measured."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.progress import track

import ldls
from ldls import datasets
from ldls.simulation import FrameOrder, make_frames, sample_frame, suite_folder, suite_orders

TILE_M = 100.0
"""Distance of the copies of a sweep in a tiled cloud: no copy touches another."""


@dataclass(frozen=True)
class Frame:
    """One lidar sweep with the masks and the camera of an image."""

    name: str
    points: NDArray[np.float32]
    masks: ldls.InstanceMasks
    camera: ldls.Camera

    def in_view(self) -> NDArray[np.float32]:
        """(n, 3) points that the camera sees."""
        rows, _ = ldls.stages.project(self.points, self.camera, image_size=self.masks.image_size)
        return np.ascontiguousarray(self.points[rows, :3])


def frame() -> Frame:
    """KITTI object frame 000571 where `LDLS_TEST_DATA` names the folder of real frames, else a simulated street."""
    folder = os.environ.get("LDLS_TEST_DATA")
    if folder is None:
        return _of_one_image("simulated street (LDLS_TEST_DATA is not set)", sample_frame())
    training = Path(folder) / "kitti/training"
    return Frame(
        name="KITTI object 000571",
        points=np.asarray(ldls.read_points(training / "velodyne/000571.bin"), np.float32),
        masks=ldls.read_masks(training / "masks/000571.json"),
        camera=ldls.read_camera(training / "calib/000571.txt"),
    )


def simulated_frames(folder: Path, orders: Sequence[FrameOrder]) -> Iterator[datasets.Frame]:
    """The frames of `orders`, from files in `folder`, which are made first where they are not there yet."""
    for _ in track(make_frames(folder, orders), description=f"frames in {folder.name}", total=len(orders)):
        pass
    source = datasets.KittiObjectSource(folder / "training", masks="masks", truth="annotations")
    for order in orders:
        yield source[source.names.index(order.name)]


def suite_frames(count: int) -> Iterator[Frame]:
    """The first `count` frames of the suite, from its folder."""
    for each in simulated_frames(suite_folder(), suite_orders()[:count]):
        yield _of_one_image(each.name, each)


def tiled_points(points: NDArray[np.float32], n: int) -> NDArray[np.float32]:
    """`n` points: copies of `points` (m, 3) side by side on the ground."""
    copies = -(-n // len(points))
    side = int(np.ceil(np.sqrt(copies)))
    offsets = np.array([[i // side, i % side - side / 2, 0] for i in range(copies)], np.float32) * TILE_M
    return (points[None] + offsets[:, None]).reshape(-1, 3)[:n]


def tiled_frame(points: NDArray[np.float32], n: int, instances: int = 20) -> Frame:
    """`n` points tiled from `points`, all in view of one camera high above them, and masks in a grid over them."""
    size = 2000
    cloud = tiled_points(points, n)
    low, high = cloud.min(axis=0), cloud.max(axis=0)
    height_m = 2 * float(np.max(high - low)) + 50
    transform = np.array([[0, -1, 0, 0], [-1, 0, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1.0]])
    transform[:3, 3] = -transform[:3, :3] @ [*(low + high)[:2] / 2, low[2] + height_m]
    focal_px = size * 0.9 * 2
    camera = ldls.Camera(
        projection=[[focal_px, 0, size / 2], [0, focal_px, size / 2], [0, 0, 1]], T_camera_lidar=transform
    )
    _, pixels = ldls.stages.project(cloud, camera, image_size=(size, size))
    # a grid of masks that hardly overlap: each shows the middle half of its row of the middle half of its column
    columns = int(np.ceil(np.sqrt(2 * instances)))
    rows = -(-instances // max(columns, 1))
    masks = np.zeros((instances, size, size), bool)
    for m, mask in enumerate(masks):
        left, right = _middle_half(pixels[:, 0], m % columns, columns)
        in_column = (pixels[:, 0] >= left) & (pixels[:, 0] <= right)
        top, bottom = _middle_half(pixels[in_column, 1], m // columns, rows)
        mask[top : bottom + 1, left : right + 1] = True
    return Frame(f"{n:,} points tiled", cloud, ldls.InstanceMasks.from_array(masks), camera)


def _middle_half(values: NDArray[np.float32], part: int, parts: int) -> tuple[int, int]:
    """Where the middle half of one of `parts` equal parts of `values` begins and ends."""
    low, high = np.quantile(values, [(part + 0.25) / parts, (part + 0.75) / parts])
    return int(low), int(high)


def street_frame(n: int) -> Frame:
    """`n` points of one street, all in view of one camera: its ground and walls hang together, as tiles do not."""
    rng = np.random.default_rng(0)
    ahead, side = rng.uniform(4, 80, n), np.where(rng.random(n) < 0.5, -1, 1)
    ground = np.column_stack([ahead, rng.uniform(-0.8, 0.8, n) * ahead, rng.normal(-1.7, 0.02, n)])
    walls = np.column_stack([ahead, 10 * side + rng.normal(0, 0.05, n), rng.uniform(-1.7, 0.2 * ahead)])
    cloud = np.where(rng.random((n, 1)) < 0.5, ground, walls).astype(np.float32)
    return _seen_ahead(cloud, "points of a street")


def random_frame(n: int) -> Frame:
    """`n` points at random in the space ahead, all in view of one camera: no lidar sees so, and all hang together."""
    cloud = np.random.default_rng(0).uniform([5, -20, -2], [60, 20, 3], (n, 3)).astype(np.float32)
    return _seen_ahead(cloud, "random points")


def _seen_ahead(cloud: NDArray[np.float32], name: str) -> Frame:
    """Those of the points that a camera sees which looks along x."""
    camera = ldls.Camera(
        projection=[[720, 0, 620], [0, 720, 187], [0, 0, 1]],
        T_camera_lidar=[[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]],
    )
    rows, _ = ldls.stages.project(cloud, camera, image_size=(375, 1242))
    masks = ldls.InstanceMasks.from_array(np.zeros((0, 375, 1242), bool))
    return Frame(f"{len(rows):,} {name}", np.ascontiguousarray(cloud[rows]), masks, camera)


def overlapping_boxes(frame: Frame, seed: int) -> ldls.InstanceMasks:
    """Twenty boxes at random over what the points of a frame fill."""
    _, pixels = ldls.stages.project(frame.points, frame.camera, image_size=frame.masks.image_size)
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    corners = np.sort(np.random.default_rng(seed).uniform(low, high, (20, 2, 2)), axis=1).astype(int)
    masks = np.zeros((len(corners), *frame.masks.image_size), bool)
    for mask, ((left, top), (right, bottom)) in zip(masks, corners, strict=True):
        mask[top : bottom + 1, left : right + 1] = True
    return ldls.InstanceMasks.from_array(masks)


def _of_one_image(name: str, frame: datasets.Frame) -> Frame:
    (image,) = frame.images
    assert image.masks is not None
    return Frame(name, np.asarray(frame.points, np.float32), image.masks, image.camera)
