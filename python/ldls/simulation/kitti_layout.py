"""Frames as files in KITTI's object layout.

OUT/training/velodyne/NNNNNN.bin     points
OUT/training/image_2/NNNNNN.png      image ahead
OUT/training/calib/NNNNNN.txt        calibration as given; P0, P1 and P3 repeat P2, as there is one camera
OUT/training/label_2/NNNNNN.txt      boxes of the objects in the image
OUT/training/masks/NNNNNN.json       what the segmenter finds, as COCO JSON with scores
OUT/training/annotations/NNNNNN.txt  `instance class`, a line a point of the whole cloud; `0 background` for no object

The other cameras of a ring have image_ring_K, calib_ring_K (their P2) and masks_ring_K, K from 1 to 5, to the left.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ldls.camera import Camera
from ldls.io.files import whole_file
from ldls.masks import InstanceMasks
from ldls.simulation.boxes import annotation_name, label_rows
from ldls.simulation.frame import SceneFrame, View

NOTHING = "0 background"
"""The line of a point of no object."""


def write_kitti(folder: str | PathLike[str], name: str, frame: SceneFrame) -> None:
    """Write `frame` under `folder`, `name` being six digits; every file is whole or not there.

    Point annotations come last, so a frame that has them has everything.
    """
    training = Path(folder) / "training"
    write(training / "velodyne" / f"{name}.bin", frame.points.astype("<f4").tobytes())
    for k, view in enumerate(frame.views):
        suffix = "" if k == 0 else f"_ring_{k}"
        _write_view(training, "image_2" if k == 0 else f"image{suffix}", suffix, name, view)
    write_lines(training / "label_2" / f"{name}.txt", label_rows(frame.objects, frame.views[0]))
    write_lines(training / "annotations" / f"{name}.txt", annotation_lines(frame))


def is_whole(folder: str | PathLike[str], name: str) -> bool:
    """Whether `write_kitti` came to its end for this frame."""
    return (Path(folder) / "training" / "annotations" / f"{name}.txt").is_file()


def _write_view(training: Path, images: str, suffix: str, name: str, view: View) -> None:
    picture = training / images / f"{name}.png"
    write_picture(picture, view.image)
    write_lines(training / f"calib{suffix}" / f"{name}.txt", _calibration(view.camera))
    document = coco_document(view.masks, int(name), picture.name)
    write(training / f"masks{suffix}" / f"{name}.json", json.dumps(document).encode())


def write_picture(path: Path, image: NDArray[np.uint8]) -> None:
    """Write a PNG and its folder, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as file:
        Image.fromarray(image).save(file, "PNG", compress_level=3)


def coco_document(masks: InstanceMasks, image_id: int, file_name: str) -> dict[str, object]:
    """COCO's data set object of one image, its masks as run lengths, with scores."""
    image = {"id": image_id, "file_name": file_name, "height": masks.height, "width": masks.width}
    annotations = []
    for i, mask in enumerate(masks, start=1):
        top, left, height, width = mask.bounding_box
        counts = mask.rle.runs().tolist()
        annotations.append(
            {
                "id": i,
                "image_id": image_id,
                "category_id": mask.category,
                "score": round(mask.score, 4),
                "bbox": [left, top, width, height],
                "area": mask.area,
                "iscrowd": 0,
                "segmentation": {"size": [masks.height, masks.width], "counts": counts},
            }
        )
    categories = [{"id": i, "name": n} for i, n in masks.names.items()]
    return {"images": [image], "categories": categories, "annotations": annotations}


def _calibration(camera: Camera) -> list[str]:
    matrices = {f"P{k}": camera.projection for k in range(4)}
    matrices |= {"R0_rect": np.eye(3), "Tr_velo_to_cam": camera.T_camera_lidar[:3], "Tr_imu_to_velo": np.eye(3, 4)}
    return [f"{key}: {row_of(matrix)}" for key, matrix in matrices.items()]


def row_of(matrix: NDArray[np.float64]) -> str:
    """The numbers of a matrix, row by row, as KITTI writes them."""
    return " ".join(f"{value:.12e}" for value in matrix.ravel())


def annotation_lines(frame: SceneFrame) -> list[str]:
    """A line for each point; instances count from 1 over the whole turn."""
    named = [f"{m} {annotation_name(thing.category)}" for m, thing in enumerate(frame.objects, start=1)]
    lines = np.array([NOTHING, *named])
    chosen: list[str] = lines[frame.instances].tolist()
    return chosen


def write_lines(path: Path, lines: Iterable[str]) -> None:
    """Write a text file and its folder, whole or not at all."""
    write(path, "".join(f"{line}\n" for line in lines).encode())


def write(path: Path, content: bytes) -> None:
    """Write a file and its folder, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as file:
        file.write(content)
