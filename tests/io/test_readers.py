"""Every reader of a file: what is no regular file is refused at once, and so is what is malformed, by its name."""

import io
import json
import os
import random
import zipfile

import numpy as np
import pytest
from PIL import Image

import ldls
from datasets import layouts
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

CHANGES = int(os.environ.get("LDLS_TEST_CHANGES", "100"))
"""Changed files of each kind that are read."""
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


KITTI = """P2: 50 0 40 0 0 50 30 0 0 0 1 0
R0_rect: 1 0 0 0 1 0 0 0 1
Tr_velo_to_cam: 0 -1 0 0 0 0 -1 0 1 0 0 0
"""
OPENCV = """%YAML:1.0
---
image_width: 80
image_height: 60
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 50., 0., 40., 0., 50., 30., 0., 0., 1. ]
distortion_coefficients: [ -0.28, 7.e-02, 1e-3, -8.0e-04, 0x10 ]
"""
INFO = """header: {frame_id: front, stamp: 2001-12-14t21:59:43.10-05:00}
height: 60
width: 80
distortion_model: plumb_bob
D: [0.1, 0, 0, 0, 0]
K: [50, 0, 40, 0, 50, 30, 0, 0, 1]
R: [1, 0, 0, 0, 1, 0, 0, 0, 1]
P: [50, 0, 40, 0, 0, 50, 30, 0, 0, 0, 1, 0]
binning_x: 0
roi: {x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: false}
"""
OBJECTS = (
    "Car 0.00 0 1.85 3.1 2.2 9.5 8.0 1.67 1.87 3.69 -16.53 2.39 58.49 1.57\nDontCare -1 -1 -10 1 1 2 2 -1 -1 -1 "
    + ("-1000 -1000 -1000 -10\n")
)
KEY_FRAME = {
    "timestamp": 1.5e9,
    "lidar": {"file": "a.pcd.bin", "columns": ["x", "y", "z", "i", "ring"]},
    "cameras": {
        "front": {
            "file": "a.png",
            "timestamp": 1.5e9,
            "intrinsics": np.diag([50, 50, 1]).tolist(),
            "lidar_to_camera": np.eye(4).tolist(),
            "boxes_2d": [{"category": "car", "box": [1, 2, 3, 4]}],
        }
    },
    "boxes_3d": [{"category": "car", "center_size_yaw": [1, 2, 3, 4, 5, 6, 7]}],
}
TOML = (
    layouts.FOLDER_TOML + '[cameras.left]\nimages = "left/{frame}.png"\ncalibration = "c.txt"\nimage_size = [60, 80]\n'
)


def npy(array):
    file = io.BytesIO()
    np.save(file, np.array(array))
    return file.getvalue()


def npz(**arrays):
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


def image(format):
    file = io.BytesIO()
    Image.fromarray(np.arange(2700, dtype=np.uint8).reshape(30, 30, 3)).save(file, format)
    return file.getvalue()


RANGE_IMAGE = np.ones((64, 512, 6), np.float32)
CONTENTS = {
    "points.npy": npy(POINTS),
    "labels of nuscenes-lidarseg_lidarseg.bin": bytes([17, 0, 31]),
    "labels of nuscenes-panoptic_panoptic.npz": npz(data=np.array([17001, 0, 31002], np.uint16)),
    "labels of ldls.npz": npz(
        classes=np.array([1, 0]),
        instances=np.array([4, 0]),
        ignored=np.array([False, True]),
        names=["background", "car"],
    ),
    "labels of semantic-kitti.label": np.array([10, 252 | 7 << 16], "<u4").tobytes(),
    "labels of squeezeseg.npy": npy(RANGE_IMAGE[:, :, 5].astype(np.uint8)),
    "labels of annotations.txt": b"3 Car\n0 background\n-1 DontCare\n",
    "labels of kitti-boxes.txt": OBJECTS.encode(),
    "confidence.npz": npz(confidence=np.ones(3, np.float32)),
    "ranges.npy": npy(RANGE_IMAGE),
    "boxes.txt": OBJECTS.encode(),
    "kitti.txt": KITTI.encode(),
    "opencv.yaml": OPENCV.encode(),
    "camera": INFO.encode(),
    "image.png": image("PNG"),
    "image size.jpg": image("JPEG"),
    "ldls.toml": TOML.encode(),
    "frame.json": json.dumps(KEY_FRAME).encode(),
    "table.json": json.dumps([{"token": "a", "n": [1, 2.5]}, {"token": None}]).encode(),
    "stamps.txt": b"a 0.1\nb 0.2\n",
    "transform.txt": b"1 0 0 0  0 1 0 0  0 0 1 0  # lidar to camera\n",
}
"""What such files hold."""
OTHERS = [
    np.zeros((2, 2)), np.array("text"), np.array(["a", "b"]), np.array([1 + 2j]), np.array([np.nan, -np.inf]),
    np.array([2**63], np.uint64), np.array([-(2**40)]), np.zeros((0, 3), np.float32), np.array(5), np.array([b"x"]),
    np.array(["2020-01-01"], "M8[D]"), np.zeros(3, [("a", "<f4")]), np.array("[" * 100_000), np.array("null"),
    np.array('{"a": 1e999}'), np.array(True), np.zeros((1, 1, 1, 1, 1)), np.array("1" * 5000), np.zeros(2, "U0"),
]  # fmt: skip
"""Arrays that belong nowhere."""


def mutated(content, generator):
    """`content` with bytes changed, cut out, doubled or cut off; of an archive those of a member, or another array."""
    if content.startswith(b"PK"):
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
        name = generator.choice(sorted(members))
        members[name] = generator.choice([npy(generator.choice(OTHERS)), mutated(members[name], generator), b""])
        made = io.BytesIO()
        with zipfile.ZipFile(made, "w") as archive:
            for name, member in members.items():
                archive.writestr(name, member)
        return made.getvalue()
    changed = bytearray(content)
    for _ in range(generator.choice([1, 1, 2, 8])):
        # heads are where the faults are
        at = generator.randrange(min(len(changed) + 1, generator.choice([100, 10_000_000])))
        length = generator.choice([1, 1, 2, 4, 40])
        match generator.randrange(5):
            case 0:
                changed[at : at + length] = generator.randbytes(length)
            case 1:
                changed[at : at + 1] = generator.choice(WORDS)
            case 2:
                del changed[at : at + length]
            case 3:
                changed[at:at] = changed[at : at + length]
            case 4 if generator.random() < 0.3:
                del changed[at:]
    return bytes(changed)


WORDS = [
    b"\0", b"\n", b"-", b"[", b"]", b"{", b"}", b'"', b":", b",", b"=", b".", b"nan", b"1e999", b"9" * 5000, b"null",
    b"true", b"[" * 5000, b"*a", b"&a ", b"<<: ", b"!!python/object:os.system ", b"1:1", b"\xff\xff\xff\xff", b"\x80",
    b"2001-99-99",
]  # fmt: skip


@pytest.mark.parametrize("name", [*CONTENTS, "result.npz", "result of a ring.npz"])
def test_changed_bytes_are_errors_of_ours_that_name_the_file(tmp_path, small_scene, name):
    path = tmp_path / name
    if name in CONTENTS:
        path.write_bytes(CONTENTS[name])
    else:
        points, masks, camera = small_scene
        ring = [ldls.View(masks, camera, "left"), ldls.View(masks, camera, "right")]
        ldls.save(ldls.segment(points, ring) if "ring" in name else ldls.segment(points, masks, camera), path)
    layouts.write_points(tmp_path / "a.pcd.bin", layouts.cloud(5))
    layouts.write_image(tmp_path / "a.png")
    reader = READERS.get(name, ldls.read_result)
    whole = path.read_bytes()
    reader(path)
    generator = random.Random(name)
    accepted = 0
    for _ in range(CHANGES):
        path.write_bytes(mutated(whole, generator))
        try:
            reader(path)
            accepted += 1
        except ldls.LdlsError as error:
            assert name in str(error)
        except FileNotFoundError as error:
            assert name == "frame.json", error  # which names others
    assert accepted < CHANGES
