"""Every reader of a file: what is no regular file is refused at once."""

import os

import numpy as np
import pytest

import ldls
from ldls.datasets.folder_description import read_description
from ldls.datasets.nuscenes_frame import NuScenesFrameSource
from ldls.datasets.ros_transforms import given_transforms
from ldls.io.files import read_lines
from ldls.io.images import read_image_size
from ldls.io.json_rows import read_json_rows
from ldls.io.labels import FORMATS, read_kitti_objects, read_labeling
from ldls.io.labels.labeling_npz import read_confidence_npz
from ldls.io.labels.squeezeseg import read_squeezeseg_ranges
from ldls.io.masks.formats import READERS as MASK_READERS
from ldls.io.masks.kitti_boxes import read_boxes
from ldls.io.points.read import READERS as POINT_READERS

CAMERA = ldls.Camera(projection=np.eye(3), T_camera_lidar=np.eye(4), image_size=(3, 4))
POINTS = np.zeros((5, 4), np.float32)

READERS = {
    **{f"points{suffix}": ldls.read_points for suffix in POINT_READERS},
    **{f"masks{suffix}": lambda path: ldls.read_masks(path, image_size=(3, 4)) for suffix in MASK_READERS},
    **{
        f"labels of {name}{each.ending}": lambda path, name=name: read_labeling(
            path, format=name, points=POINTS, camera=CAMERA
        )
        for name, each in FORMATS.items()
    },
    "confidence.npz": read_confidence_npz,
    "ranges.npy": read_squeezeseg_ranges,
    "objects.txt": read_kitti_objects,
    "boxes.txt": read_boxes,
    "kitti.txt": lambda path: ldls.read_camera(path, format="kitti"),
    "opencv.yaml": lambda path: ldls.read_camera(path, format="opencv", T_camera_lidar=np.eye(4)),
    "camera": lambda path: ldls.read_camera(path, format="camera-info", T_camera_lidar=np.eye(4)),
    "tum.txt": lambda path: ldls.read_poses(path, format="tum"),
    "poses.txt": lambda path: ldls.read_poses(path, format="kitti", stamps=[0], T_camera_lidar=np.eye(4)),
    "image.png": ldls.read_image,
    "image size.jpg": read_image_size,
    "result.npz": ldls.read_result,
    "ldls.toml": read_description,
    "frame.json": NuScenesFrameSource,
    "table.json": lambda path: list(read_json_rows(path)),
    "stamps.txt": read_lines,
    "transform.txt": lambda path: given_transforms(path, ["/image"]),
}
"""Readers by the name of a file that they read."""


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize("kind", ["pipe", "device", "folder"])
def test_what_is_no_regular_file_is_refused_at_once(tmp_path, name, kind):
    path = tmp_path / name
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    else:
        path.mkdir()
    if (name, kind) == ("frame.json", "folder"):
        (path / name).mkdir()  # it takes a folder for that of a frame.json
    with pytest.raises(ldls.FileFormatError, match=rf"{name}: expected a regular file, got a {kind}"):
        READERS[name](path)
