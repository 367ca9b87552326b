"""Frames as files in KITTI's object layout.

OUT/training/velodyne/NNNNNN.bin     points
OUT/training/image_2/NNNNNN.png      image ahead
OUT/training/calib/NNNNNN.txt        calibration as given; P0, P1 and P3 repeat P2, as there is one camera
OUT/training/label_2/NNNNNN.txt      boxes of the objects in the image
OUT/training/masks/NNNNNN.json       masks that the segmenter finds, as COCO JSON with scores
OUT/training/made_of/NNNNNN.json     what the frame is made of; no other is taken for it
OUT/training/annotations/NNNNNN.txt  `instance class`, a line a point of the whole cloud; `0 background` for no object

The other cameras of a ring have image_ring_K, calib_ring_K (their P2) and masks_ring_K, K from 1 to 5, to the left.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from itertools import zip_longest
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ldls.camera import Camera
from ldls.camera.rigid import transformed
from ldls.datasets import Frame
from ldls.errors import ParameterError
from ldls.io.files import read_lines, whole_file
from ldls.io.images import png_of
from ldls.io.labels import write_annotations
from ldls.io.labels.kitti_objects import wrapped
from ldls.masks import InstanceMasks
from ldls.simulation.scene_object import KITTI_TYPES, SceneObject
from ldls.simulation.simulated_frame import SimulatedFrame, SimulatedImage

NEAREST_M = 0.5


def write_kitti(folder: str | PathLike[str], name: str, frame: SimulatedFrame) -> None:
    """Write `frame` under `folder`, `name` being six digits; every file is whole or not there.

    Point annotations come last, so a frame that has them has everything.
    """
    training = Path(folder) / "training"
    write_points(training / "velodyne" / f"{name}.bin", frame)
    for image in frame.images:
        ring = "" if image.name == "image_2" else image.name.removeprefix("image")
        write_picture(training / image.name / f"{name}.png", image.read())
        write_lines(training / f"calib{ring}" / f"{name}.txt", calibration_lines(image.camera))
        write_masks(training / f"masks{ring}" / f"{name}.json", image.masks, int(name))
    write_lines(training / "label_2" / f"{name}.txt", _label_rows(frame.objects, frame.images[0]))
    write_truth(training / "annotations" / f"{name}.txt", frame)


def check_there(path: Path, expected: Mapping[Path, Sequence[str]], other: str) -> None:
    """Refuse to go on with something else: each file that is there is as it would be written, or its beginning.

    Args:
        path: The folder that holds them.
        expected: The lines of each file.
        other: What the folder holds where they differ, for the message.

    Raises:
        ParameterError: One is not.
    """
    for file, lines in expected.items():
        found = read_lines(file) if file.is_file() else []
        for number, (got, line) in enumerate(zip_longest(found, lines[: len(found)]), start=1):
            if got != line:
                wanted = "no more lines" if line is None else repr(line.strip(" ,"))
                raise ParameterError(
                    f"{path}: holds {other}: {file.name}: line {number}: got {got.strip(' ,')!r}, expected {wanted}; "
                    "write to another folder, or remove it"
                )


def write_points(path: Path, frame: Frame) -> None:
    """Write the points of a frame as KITTI does, and their folder."""
    _write(path, np.asarray(frame.points, "<f4").tobytes())


def write_picture(path: Path, image: NDArray[np.uint8]) -> None:
    """Write a PNG and its folder."""
    _write(path, png_of(Image.fromarray(image)))


def write_masks(path: Path, masks: InstanceMasks, image_id: int) -> None:
    """Write masks and their folder as COCO's data set of one image, in plain run lengths, with scores."""
    image = {"id": image_id, "file_name": f"{path.stem}.png", "height": masks.height, "width": masks.width}
    annotations = []
    for i, mask in enumerate(masks, start=1):
        top, left, height, width = mask.bounding_box
        annotations.append(
            {
                "id": i,
                "image_id": image_id,
                "category_id": mask.category,
                "score": round(mask.score, 4),
                "bbox": [left, top, width, height],
                "area": mask.area,
                "iscrowd": 0,
                "segmentation": {"size": [masks.height, masks.width], "counts": mask.rle.runs().tolist()},
            }
        )
    categories = [{"id": i, "name": n} for i, n in masks.names.items()]
    document = {"images": [image], "categories": categories, "annotations": annotations}
    _write(path, json.dumps(document).encode())


def write_truth(path: Path, frame: SimulatedFrame) -> None:
    """Write the point annotations of a frame, and their folder; instances count from 1 over the whole turn."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_annotations(path, frame.truth)


def write_lines(path: Path, lines: Iterable[str]) -> None:
    """Write a text file and its folder."""
    _write(path, "".join(f"{line}\n" for line in lines).encode())


def calibration_lines(camera: Camera) -> list[str]:
    """The lines of a calibration file; all four cameras have the one projection."""
    matrices = {f"P{k}": camera.projection for k in range(4)}
    matrices |= {"R0_rect": np.eye(3), "Tr_velo_to_cam": camera.T_camera_lidar[:3], "Tr_imu_to_velo": np.eye(3, 4)}
    return [f"{key}: {row_of(matrix)}" for key, matrix in matrices.items()]


def row_of(matrix: NDArray[np.float64]) -> str:
    """The numbers of a matrix, row by row, as KITTI writes them."""
    return " ".join(f"{value:.12e}" for value in matrix.ravel())


def _write(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as file:
        file.write(content)


def _label_rows(things: tuple[SceneObject, ...], image: SimulatedImage) -> list[str]:
    """A row of 15 fields for each object that the image shows, in the camera frame of the calibration as given.

    The 2D box is that of the projected corners, cut at the image's edges. Occlusion is 0 where at least 0.7 of the
    object is visible, 1 from 0.35, else 2. Categories that KITTI has no name for are Misc.
    """
    shown = np.bincount(image.pixels.instances.ravel(), minlength=len(things) + 1)[1:]
    rows = [
        _row(thing, image.camera, float(count / max(expected, 1.0)))
        for thing, count, expected in zip(things, shown, image.pixels.expected_px, strict=True)
        if count > 0
    ]
    return [row for row in rows if row]


def _row(thing: SceneObject, camera: Camera, visible: float) -> str:
    bottom = np.array([*thing.centre_m[:2], thing.centre_m[2] - thing.height_m / 2])
    x, y, z = transformed(bottom[None], camera.T_camera_lidar)[0]
    if z < NEAREST_M:
        return ""
    heading = np.array([np.cos(thing.yaw), np.sin(thing.yaw), 0.0])
    ahead = camera.T_camera_lidar[:3, :3] @ heading
    turn = float(np.arctan2(-ahead[2], ahead[0]))
    alpha = wrapped(turn - float(np.arctan2(x, z)))
    box, truncated = _image_box(thing, camera)
    occluded = 0 if visible >= 0.7 else 1 if visible >= 0.35 else 2
    size = (thing.height_m, thing.width_m, thing.length_m)
    numbers = " ".join(f"{n:.2f}" for n in (alpha, *box, *size, x, y, z, turn))
    return f"{KITTI_TYPES.get(thing.category, 'Misc')} {truncated:.2f} {occluded} {numbers}"


def _image_box(thing: SceneObject, camera: Camera) -> tuple[tuple[float, float, float, float], float]:
    """(left, top, right, bottom) within the image, and the share of the box outside it."""
    corners = transformed(thing.corners_m(), camera.T_camera_lidar)
    corners[:, 2] = np.maximum(corners[:, 2], 0.2)
    homogeneous = np.column_stack([corners, np.ones(8)]) @ camera.projection.T
    uv = homogeneous[:, :2] / homogeneous[:, 2:]
    height, width = camera.image_size or (0, 0)
    low, high = uv.min(axis=0), uv.max(axis=0)
    cut_low, cut_high = (np.clip(edge, 0, (width - 1, height - 1)) for edge in (low, high))
    share = float(np.prod(cut_high - cut_low) / max(float(np.prod(high - low)), 1e-9))
    box = (float(cut_low[0]), float(cut_low[1]), float(cut_high[0]), float(cut_high[1]))
    return box, float(np.clip(1 - share, 0, 1))
