"""One frame of a made-up street: a lidar's points, a camera's image, and the truth of both."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ldls.simulation.demo.layout import street
from ldls.simulation.demo.rendering import shade
from ldls.simulation.demo.solids import F32, I32, Solids, first_hits, normals

T = TypeVar("T", bound=np.generic)
WIDTH, HEIGHT = 1242, 375
LIDAR_M = np.zeros((3, 1, 1), np.float32)
PROJECTION = np.array([[721.54, 0, 609.56, 0], [0, 721.54, 172.85, 0], [0, 0, 1, 0]])
T_CAMERA_LIDAR = np.array([[0, -1, 0, 0], [0, 0, -1, -0.08], [1, 0, 0, -0.27], [0, 0, 0, 1.0]])
BEAMS_DEG = np.concatenate([np.linspace(2, -8.33, 32), np.linspace(-8.83, -24.8, 32)])
FIRINGS = 2000  # in a turn
MAX_RANGE_M = 80.0
RANGE_NOISE_M = 0.02
DROPOUT = 0.03
MASK_SIDE = 28  # cells of the grid on which Mask R-CNN draws a mask
MIN_VISIBLE_PIXELS = 60


@dataclass(frozen=True)
class Tiling:
    """A grid of rays cut into bundles of neighbours, so that a bundle can miss a solid at once."""

    height: int
    width: int
    rows: int  # of a bundle
    columns: int

    def split(self, grid: F32) -> F32:
        """Return (C, height, width) as (C, bundles, rays in a bundle)."""
        across, down = self.height // self.rows, self.width // self.columns
        tiles = grid.reshape(-1, across, self.rows, down, self.columns).swapaxes(2, 3)
        return tiles.reshape(len(grid), across * down, -1)

    def join(self, values: NDArray[T]) -> NDArray[T]:
        """Return (bundles, rays in a bundle, ...) as (height, width, ...)."""
        across, down = self.height // self.rows, self.width // self.columns
        tiles = values.reshape(across, down, self.rows, self.columns, *values.shape[2:])
        return tiles.swapaxes(1, 2).reshape(self.height, self.width, *values.shape[2:])


@dataclass(frozen=True)
class SimulatedFrame:
    """One frame of N points and M instance masks, with its truth.

    `points` (N, 4): x forward, y left, z up, metres, and intensity; the lidar is at the origin.
    `truth` (N,): 0 background, m the object of masks[m - 1]. `image` (H, W, 3) RGB. `masks`
    (M, H, W), `categories` (M,) COCO ids and `scores` (M,) are what an instance segmenter would
    give. `projection` (3, 4): camera frame (x right, y down, z forward) to pixels, whose centres
    lie at integer coordinates. `T_camera_lidar` (4, 4) maps lidar to camera coordinates.
    """

    points: F32
    truth: I32
    image: NDArray[np.uint8]
    masks: NDArray[np.bool_]
    categories: I32
    scores: F32
    projection: NDArray[np.float64]
    T_camera_lidar: NDArray[np.float64]


def street_scene(seed: int = 0) -> SimulatedFrame:
    """Return a frame of a street; each seed is another street."""
    rng = np.random.default_rng(seed)
    solids, categories = street(rng)
    points, point_owner = scan(solids, rng)
    image, pixel_owner = photograph(solids)
    silhouettes = (pixel_owner == m for m in range(1, len(categories) + 1))
    masks = np.stack([segmenter_mask(silhouette, rng) for silhouette in silhouettes])
    found = masks.any(axis=(1, 2))
    label = np.append(0, np.where(found, np.cumsum(found), 0))  # what is not found is background
    return SimulatedFrame(
        points=points,
        truth=label[point_owner].astype(np.int32),
        image=image,
        masks=masks[found],
        categories=categories[found],
        scores=rng.uniform(0.75, 0.99, np.count_nonzero(found)).astype(np.float32),
        projection=PROJECTION.copy(),
        T_camera_lidar=T_CAMERA_LIDAR.copy(),
    )


def scan(solids: Solids, rng: np.random.Generator) -> tuple[F32, I32]:
    """Return the points (N, 4) of one turn of the lidar, as fired, and their owners (N,)."""
    turn = np.linspace(np.pi, -np.pi, FIRINGS, endpoint=False)[:, None]  # clockwise from behind
    rise = np.radians(BEAMS_DEG)
    toward = (np.cos(turn) * np.cos(rise), np.sin(turn) * np.cos(rise), np.sin(rise))
    rays = np.stack(np.broadcast_arrays(*toward)).astype(np.float32)
    tiles = Tiling(FIRINGS, len(BEAMS_DEG), rows=10, columns=8)
    range_m, solid = first_hits(LIDAR_M, tiles.split(rays), solids)
    range_m, solid = tiles.join(range_m), tiles.join(solid)
    returned = (range_m < MAX_RANGE_M) & (rng.random(range_m.shape) > DROPOUT)
    range_m, solid = range_m[returned], solid[returned]
    ray = np.asarray(rays[:, returned].T)
    facing = -(normals(ray * range_m[:, None], solids, solid) * ray).sum(axis=1)
    intensity = solids.colour[solid].mean(axis=1) * (0.3 + 0.7 * facing.clip(0, 1))
    noisy_m = range_m + rng.normal(0, RANGE_NOISE_M, range_m.shape)
    points = np.column_stack([ray * noisy_m[:, None], intensity])
    return points.astype(np.float32), solids.owner[solid]


def photograph(solids: Solids) -> tuple[NDArray[np.uint8], I32]:
    """Return the camera's image (H, W, 3) and the owner (H, W) of each pixel."""
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    in_camera = np.linalg.inv(PROJECTION[:, :3]) @ np.stack([u, v, np.ones_like(u)]).reshape(3, -1)
    in_camera /= np.linalg.norm(in_camera, axis=0)
    turn = T_CAMERA_LIDAR[:3, :3].T
    origin_m = (-turn @ T_CAMERA_LIDAR[:3, 3:])[:, :, None].astype(np.float32)
    tiles = Tiling(HEIGHT, WIDTH, rows=15, columns=18)
    rays = tiles.split((turn @ in_camera).reshape(3, HEIGHT, WIDTH).astype(np.float32))
    range_m, solid = first_hits(origin_m, rays, solids)
    colour = tiles.join(shade(origin_m, rays, range_m, solid, solids))
    owner = np.where(solid >= 0, solids.owner[solid], 0)
    return (colour * 255).round().astype(np.uint8), tiles.join(owner)


def segmenter_mask(visible: NDArray[np.bool_], rng: np.random.Generator) -> NDArray[np.bool_]:
    """Return `visible` as Mask R-CNN would: drawn on 28 x 28 cells of a box that nearly fits.

    All False where too little is visible to be found.
    """
    mask = np.zeros_like(visible)
    if np.count_nonzero(visible) < MIN_VISIBLE_PIXELS:
        return mask
    rows = _nearly(np.asarray(visible.any(axis=1)), rng)
    columns = _nearly(np.asarray(visible.any(axis=0)), rng)
    crop = Image.fromarray(visible[rows, columns].astype(np.float32))
    cells = np.array(crop.resize((MASK_SIDE, MASK_SIDE), Image.Resampling.BILINEAR))
    # Fat or thin as a whole, and uncertain cell by cell.
    cells += rng.normal(0.03, 0.1) + rng.normal(0, 0.12, cells.shape).astype(np.float32)
    drawn = Image.fromarray(cells).resize(crop.size, Image.Resampling.BILINEAR)
    mask[rows, columns] = np.array(drawn) >= 0.5
    return mask


def _nearly(occupied: NDArray[np.bool_], rng: np.random.Generator) -> slice:
    """Return the extent of what is occupied, each end off by a few hundredths of it."""
    first, last = np.flatnonzero(occupied)[[0, -1]]
    slip = rng.normal(0, 0.025 * (last - first), 2)
    low, high = np.round(np.array([first, last + 1]) + slip).astype(int)
    return slice(max(low, 0), min(high, len(occupied)))
