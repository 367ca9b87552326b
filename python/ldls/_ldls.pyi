"""Types of the private extension module. Arrays are C-contiguous; the callers in this package see to that."""

from typing import Any, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from ldls.params import Params

_Csr: TypeAlias = tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.float32]]
_Depths: TypeAlias = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]
_Points: TypeAlias = NDArray[np.float32] | NDArray[np.float64]

__all__ = [
    "GROUND_M",
    "NEGLIGIBLE",
    "Camera",
    "Masks",
    "Products",
    "Rle",
    "SegmentationArrays",
    "__version__",
    "brought_together",
    "check_params",
    "confidence",
    "default_threads",
    "depth_groups",
    "diffuse",
    "direct_labels",
    "ground",
    "in_graph",
    "neighbors",
    "normalize_rows",
    "pack_png",
    "panic_in_worker",
    "pixel_labels",
    "point_graph",
    "project",
    "remove_outliers",
    "segment",
    "unpack_laz",
    "upright_box",
]

__version__: str
GROUND_M: list[float]
NEGLIGIBLE: float

@final
class Rle:
    @staticmethod
    def from_runs(height: int, width: int, runs: NDArray[np.uint32]) -> Rle: ...
    @staticmethod
    def from_compressed(height: int, width: int, counts: bytes) -> Rle: ...
    @staticmethod
    def from_polygons(height: int, width: int, polygons: list[list[float]]) -> Rle: ...
    @staticmethod
    def from_pixels(pixels: NDArray[np.bool_]) -> Rle: ...
    @property
    def height(self) -> int: ...
    @property
    def width(self) -> int: ...
    @property
    def area(self) -> int: ...
    @property
    def bounding_box(self) -> tuple[int, int, int, int]: ...
    def runs(self) -> NDArray[np.uint32]: ...
    def to_compressed(self) -> bytes: ...
    def grow(self, radius: int) -> Rle: ...
    def shrink(self, radius: int) -> Rle: ...
    def union(self, other: Rle) -> Rle: ...
    def difference(self, other: Rle) -> Rle: ...
    def crop(self, top: int, left: int, height: int, width: int) -> NDArray[np.bool_]: ...

@final
class Masks:
    def __new__(cls, height: int, width: int, masks: list[Rle]) -> Masks: ...
    @property
    def height(self) -> int: ...
    @property
    def width(self) -> int: ...
    def __len__(self) -> int: ...
    def areas(self) -> list[int]: ...
    def paint(self, pixels: NDArray[np.bool_], threads: int | None) -> None: ...
    def rle(self, index: int) -> Rle: ...

@final
class Camera:
    def __new__(
        cls,
        projection: NDArray[np.float64],
        t_camera_lidar: NDArray[np.float64],
        min_depth_m: float,
        model: str,
        coefficients: NDArray[np.float64],
    ) -> Camera: ...
    def project(self, x: float, y: float, z: float) -> tuple[float, float, float]: ...

@final
class Products:
    def __new__(cls, point_graph: _Csr, labels: _Csr, n_labels: int, iterations: int | None) -> Products: ...
    def advance(self, products: int, threads: int | None) -> NDArray[np.float32]: ...
    @property
    def finished(self) -> bool: ...

@final
class SegmentationArrays:
    @property
    def labels(self) -> NDArray[np.int32]: ...
    @property
    def diffused_labels(self) -> NDArray[np.int32]: ...
    @property
    def confidence(self) -> NDArray[np.float32]: ...
    @property
    def in_view(self) -> NDArray[np.int64]: ...
    @property
    def sightings(self) -> list[tuple[NDArray[np.int64], NDArray[np.float64]]]: ...
    @property
    def objects(self) -> list[list[tuple[int, int]]]: ...
    @property
    def report(self) -> dict[str, Any]: ...
    @property
    def timings(self) -> dict[str, float]: ...

def segment(
    points: _Points,
    masks: list[Masks],
    categories: list[list[int]],
    scores: list[list[float]],
    cameras: list[Camera],
    rows: list[tuple[int, int]] | None,
    same_object: float,
    params: Params,
    keep_origin: bool,
) -> SegmentationArrays: ...
def check_params(params: Params) -> None: ...
def default_threads() -> int: ...
def panic_in_worker() -> None: ...
def brought_together(
    clouds: list[_Points], matrices: list[list[list[float]]], keep_origin: bool
) -> NDArray[np.float64]: ...
def upright_box(points: NDArray[np.float64]) -> tuple[list[float], list[float], float]: ...
def project(
    points: _Points,
    camera: Camera,
    height: int,
    width: int,
    keep_origin: bool,
    threads: int | None,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]: ...
def neighbors(
    points: NDArray[np.float64], k: int, threads: int | None
) -> tuple[NDArray[np.uint32], NDArray[np.float64]]: ...
def ground(points: NDArray[np.float64], camera: Camera, local: bool, threads: int | None) -> NDArray[np.float64]: ...
def in_graph(heights: NDArray[np.float64], clearance: float) -> NDArray[np.int64]: ...
def depth_groups(
    points: NDArray[np.float64],
    pixels: NDArray[np.float64],
    masks: Masks,
    camera: Camera,
    heights: NDArray[np.float64],
    params: Params,
) -> _Depths: ...
def point_graph(
    points: NDArray[np.float64],
    indices: NDArray[np.uint32],
    sigma: float,
    ground: NDArray[np.bool_] | None,
    ground_edges: float,
    threads: int | None,
) -> _Csr: ...
def pixel_labels(
    pixels: NDArray[np.float64],
    masks: Masks,
    window: int,
    pixel_weight: float,
    depths: _Depths | None,
    threads: int | None,
) -> tuple[_Csr, NDArray[np.float32]]: ...
def direct_labels(pixels: NDArray[np.float64], masks: Masks) -> NDArray[np.int32]: ...
def normalize_rows(
    point_graph: _Csr, labels: _Csr, mass: NDArray[np.float32]
) -> tuple[_Csr, tuple[_Csr, NDArray[np.float32]]]: ...
def diffuse(
    point_graph: _Csr,
    labels: _Csr,
    mass: NDArray[np.float32],
    n_labels: int,
    iterations: int | None,
    threads: int | None,
) -> tuple[NDArray[np.float32], int, float | None]: ...
def remove_outliers(
    point_graph: _Csr, labels: NDArray[np.uint32], points: NDArray[np.float64], part_gap: float
) -> NDArray[np.int32]: ...
def confidence(
    shares: NDArray[np.float32],
    diffused: NDArray[np.uint32],
    labels: NDArray[np.uint32],
    scores: NDArray[np.float32],
) -> NDArray[np.float32]: ...
def pack_png(width: int, height: int, channels: int, pixels: bytes) -> bytes: ...
def unpack_laz(
    file: bytes, offset: int, laszip: bytes, n_points: int
) -> tuple[NDArray[np.int32], NDArray[np.uint16]]: ...
