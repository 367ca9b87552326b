"""Every parser of files, with small whole files to change, made anew by our own writers."""

import functools
import io
import json
import os
import random
import sqlite3
import struct
import tempfile
import traceback
import warnings
import zipfile
import zlib
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import laspy
import lzf
import numpy as np
import rosbags.rosbag1
import rosbags.rosbag2
import rosbags.serde.utils
from PIL import Image
from rosbags.highlevel import anyreader
from rosbags.typesys.store import Typestore

import ldls
from campaigns.mutations import changed_bytes, mutated, npy
from conftest import pinhole
from datasets import layouts, ros_samples
from ldls.batch.journal import JOURNAL_NAME, Journal
from ldls.datasets import nuscenes_tables
from ldls.datasets.folder_description import read_description
from ldls.datasets.nuscenes_frame import NuScenesFrameSource
from ldls.datasets.ros_transforms import given_transforms
from ldls.errors import FileFormatError, LdlsError
from ldls.io.cameras.extrinsic_file import as_extrinsic
from ldls.io.images import read_image_size
from ldls.io.labels import read_kitti_objects, read_labeling, write_annotations, write_labeling
from ldls.io.labels.labeling_npz import read_confidence_npz
from ldls.io.labels.squeezeseg import read_squeezeseg_ranges
from ldls.io.masks.data_set import MaskDataSet
from ldls.io.ros.bags import Bag, open_bag
from ldls.io.ros.images import decode_compressed, decode_image
from ldls.io.ros.messages import (
    CAMERA_INFO,
    COMPRESSED_IMAGE,
    IMAGE,
    POINTS,
    Header,
    Topic,
    make,
    make_header,
    serialize,
    standard_types,
)
from ldls.io.ros.point_cloud2 import decode, encode
from ldls.labeling import Labeling
from ldls.segmentation.objects import COLUMNS
from ldls.segmenters.onnx_file import read_onnx
from mask_samples import of_coco, random_masks
from segmenters import graphs

N_POINTS = 12
T_CAMERA_LIDAR = layouts.T
CAMERA = pinhole(T_camera_lidar=T_CAMERA_LIDAR)
BETWEEN_FILES = b"\n<<another file>>\n"
AS_THEY_ARE = b"".join
SHARE_AS_A_WHOLE = 0.2
"""Of the files that are packed from parts, so many are changed as they lie on the disk, with checksums that fail."""


@dataclass(frozen=True)
class Parser:
    """A parser and what it is tried on.

    Attributes:
        files: Names of the files that it reads, below a folder; several lie behind one another in one content.
        seeds: Whole contents, each a list of parts, made in a folder.
        read: Reads the folder with those files, or the one file.
        join: Makes the content of the parts; with checksums that hold, where the format has them.
        text: True if words and lines are changed, not bytes alone.
        gentle: Share of the files that are changed so that they may still be whole.
        allowed: Errors of the system that the reader promises.
        names_file: True if its errors name the file, or its folder.
    """

    files: tuple[str, ...]
    seeds: Callable[[Path], list[list[bytes]]]
    read: Callable[[Path], object]
    join: Callable[[list[bytes]], bytes] = AS_THEY_ARE
    text: bool = False
    gentle: float = 0.2
    allowed: tuple[type[Exception], ...] = ()
    names_file: bool = True

    def place(self, folder, content):
        """Write `content` below `folder`; the path to read."""
        if len(self.files) == 1:
            path = folder / self.files[0]
            write(path, content)
            return path
        for name, own in zip(self.files, content.split(BETWEEN_FILES), strict=False):
            write(folder / name, own)
        return folder

    def outcome(self, folder, content):
        """What becomes of `content`: "accepted", "refused", "fat", or what wrong error came, and from where."""
        path = self.place(folder, content)
        try:
            self.read(path)
        except self.allowed:
            return "refused"
        except LdlsError as error:
            named = not self.names_file or any(name in str(error) for name in (*self.files, folder.name))
            return "refused" if named else f"{place_of(error)} without the name of the file"
        except MemoryError:
            return "fat"
        except BaseException as error:  # panics of libraries are no Exceptions
            if isinstance(error, (KeyboardInterrupt, SystemExit)):
                raise
            return place_of(error)
        return "accepted"


def write(path, content):
    try:
        path.write_bytes(content)
    except FileNotFoundError:
        path.parent.mkdir(parents=True)
        path.write_bytes(content)


def place_of(error):
    """Kind of an error and the innermost of our lines that it passed."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if f"{os.sep}ldls{os.sep}" in frame.filename]
    where = f"{Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else "outside of ldls"
    return f"{type(error).__name__} at {where}"


class Inputs:
    """The changed files of a parser by their number; the same for the same seed."""

    def __init__(self, name, seed):
        self.name, self.parser, self.seed = name, PARSERS[name], seed
        with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self.seeds = self.parser.seeds(Path(folder))

    def __getitem__(self, number):
        generator = random.Random(f"{self.name} {self.seed} {number}")
        join = self.parser.join
        if join is not AS_THEY_ARE and generator.random() < SHARE_AS_A_WHOLE:
            return changed_bytes(join(list(generator.choice(self.seeds))), generator)
        return join(mutated(self.seeds, generator, text=self.parser.text, gentle=self.parser.gentle))


def written(*writers, name="a"):
    """Seeds from writers of files."""

    def seeds(folder):
        for write in writers:
            write(folder / name)
            yield [(folder / name).read_bytes()]

    return lambda folder: list(seeds(folder))


def texts(*contents):
    return lambda _: [[content.encode()] for content in contents]


# points


def cloud(columns=4, kind=np.float32, n=N_POINTS):
    return np.random.default_rng(columns).uniform(-20, 20, (n, columns)).round(3).astype(kind)


def rows_of_text(rows, delimiter=" "):
    return "".join(delimiter.join(f"{value:.3f}" for value in row) + "\n" for row in rows.tolist())


def pcd_header(data, n=N_POINTS, fields="x y z intensity", size="4 4 4 4", kind="F F F F", count="1 1 1 1"):
    return (
        f"# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS {fields}\nSIZE {size}\nTYPE {kind}\n"
        f"COUNT {count}\nWIDTH {n}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {n}\nDATA {data}\n"
    ).encode()


WIDE = {"fields": "_ x y z label i", "size": "1 8 8 8 2 1", "kind": "U F F F I U", "count": "3 1 1 1 1 1"}
"""Fields of all kinds of 30 bytes together."""


def pcd_ascii(_):
    rows = rows_of_text(cloud()).encode()
    wide = "".join(f"1 2 3 {k}.5 {-k} 1e{k} {k} 7\n" for k in range(N_POINTS)).encode()
    return [[pcd_header("ascii"), rows], [pcd_header("ascii", **WIDE), wide]]


def pcd_binary(_):
    return [[pcd_header("binary"), cloud().tobytes()], [pcd_header("binary", **WIDE), bytes(range(30)) * N_POINTS]]


def pcd_compressed(_):
    header = pcd_header("binary_compressed", 40)
    return [[header, np.zeros((4, 40), "<f4").tobytes()], [header, np.tile(cloud(4, n=10), (4, 1)).T.tobytes()]]


def packed_pcd(parts):
    """Header and columns, the columns packed as they are after their change."""
    header, columns = parts
    content = (len(columns) > 4 and lzf.compress(columns)) or b""
    return header + struct.pack("<II", len(content), len(columns)) + content


PLY_HEADER = (
    "ply\nformat {} 1.0\ncomment made\nelement sensor 1\nproperty float32 a\nelement vertex {}\nproperty float x\n"
    "property float y\nproperty double z\nproperty uchar intensity\nelement face 0\n"
    "property list uchar int vertex_indices\nend_header\n"
)


def ply(encoding, order):
    def seeds(_):
        header = PLY_HEADER.format(encoding, N_POINTS).encode()
        if not order:
            return [[header, b"1.5\n" + "".join(f"{k}.5 -{k} {k}e1 {k}\n" for k in range(N_POINTS)).encode()]]
        kinds = [(name, order + kind) for name, kind in zip("xyzi", ("f4", "f4", "f8", "u1"), strict=True)]
        return [[header, bytes(4) + np.ones(N_POINTS, kinds).tobytes()]]

    return seeds


def las(*formats, packed=False, n=N_POINTS):
    def write(point_format):
        def save(path):
            header = laspy.LasHeader(point_format=point_format, version="1.4" if point_format > 5 else "1.2")
            header.scales = np.full(3, 1e-3)
            data = laspy.LasData(header)
            data.xyz = cloud(3, np.float64, n)
            data.intensity = np.arange(n)
            with path.open("wb") as file:
                data.write(file, do_compress=packed)

        return save

    return written(*map(write, formats))


CSV = "x,y,z,intensity\n" + rows_of_text(cloud(), ",")
SEMICOLONS = "name;Z;Y;X\n" + "".join(f'"car {k}";{k};-{k};{k}.5\n' for k in range(N_POINTS))


# messages and bags

ROS1, ROS2 = standard_types(ros2=False), standard_types(ros2=True)
TOPICS = {"/points": POINTS, "/image": IMAGE, "/compressed": COMPRESSED_IMAGE, "/info": CAMERA_INFO}
IN_BAGS = ("/points", "/image")


def messages(types):
    """One small message of each topic."""
    columns = dict(zip(("x", "y", "z", "intensity"), cloud().T, strict=True))
    return {
        "/points": encode(types, columns, Header(5, "lidar")),
        "/image": ros_samples.image(types, ros_samples.picture(size=(4, 5))),
        "/compressed": compressed(types, "JPEG"),
        "/info": ros_samples.Recording().info(types),
    }


def compressed(types, suffix):
    file = io.BytesIO()
    Image.fromarray(ros_samples.picture(size=(4, 5))).save(file, suffix)
    return make(
        types,
        COMPRESSED_IMAGE,
        header=make_header(types, Header(5, "camera")),
        format=f"rgb8; {suffix.lower()} compressed",
        data=np.frombuffer(file.getvalue(), np.uint8),
    )


def message(topic, *others):
    """A serialised message of a topic, and others like it."""

    def seeds(_):
        made = [messages(ROS2)[topic], *(other() for other in others)]
        return [[serialize(ROS2, each, TOPICS[topic], ros2=True)] for each in made]

    return seeds


def taken_apart(topic, content):
    """What the library makes of a message, and we of that."""
    match topic:
        case "/points":
            return content.points() if hasattr(content, "points") else decode(content).points()
        case "/image":
            return decode_image(content)
        case "/compressed":
            return decode_compressed(content)
        case "/info":
            return ldls.Camera.from_camera_info(content, T_CAMERA_LIDAR)


def read_message(topic):
    bag = Bag(Path("a.mcap"), ROS2, {topic: Topic(topic, TOPICS[topic], 1)}, lambda *_: iter(()), ros2=True)
    return lambda path: taken_apart(topic, bag.decode(topic, path.read_bytes()))


def bag_ros1(folder):
    """A bag whose chunks are not packed, and one packed in each way."""
    seeds = []
    for packing in (None, *rosbags.rosbag1.Writer.CompressionFormat):
        path = folder / f"{packing}.bag"
        made = rosbags.rosbag1.Writer(path)
        if packing is not None:
            made.set_compression(packing)
        fill(made, ROS1, lambda message, topic: serialize(ROS1, message, TOPICS[topic], ros2=False))
        seeds.append([path.read_bytes()])
    return seeds


def bag_ros2(plugin):
    """A bag whose chunks are not packed and, of MCAP, one with packed ones."""

    def seeds(folder):
        storage = rosbags.rosbag2.StoragePlugin[plugin]
        modes = rosbags.rosbag2.CompressionMode
        for mode in (modes.NONE, modes.STORAGE) if plugin == "MCAP" else (modes.NONE,):
            made = rosbags.rosbag2.Writer(folder / mode.name, version=8, storage_plugin=storage)
            made.set_compression(mode, rosbags.rosbag2.CompressionFormat.ZSTD)
            fill(made, ROS2, lambda message, topic: serialize(ROS2, message, TOPICS[topic], ros2=True))
            (path,) = (each for each in (folder / mode.name).iterdir() if each.suffix != ".yaml")
            if plugin == "SQLITE3":
                shrink(path)
            yield [path.read_bytes()]

    return lambda folder: list(seeds(folder))


def fill(made, types, serialized):
    """Write to a bag, without the qualities of service that our writer adds: YAML, which is slow to read."""
    with made:
        topics = {topic: made.add_connection(topic, TOPICS[topic], typestore=types) for topic in IN_BAGS}
        for number, topic in enumerate(IN_BAGS * 2):
            made.write(topics[topic], 1000 + number, serialized(messages(types)[topic], topic))


def register(types, definitions):
    """Put definitions of messages into a new typestore; the library works all of them out again for every bag."""
    key = repr(definitions)
    if key not in stores:
        register_anew(types, definitions)
        if len(stores) == MOST_STORES:
            stores.clear()
        stores[key] = types
    vars(types).update(vars(stores[key]))


MOST_STORES = 100
# bags are read twice as fast with what is the same in nearly all of them kept
stores, register_anew, Typestore.register = {}, Typestore.register, register
rosbags.serde.utils.exec = lambda source, names: exec(compiled(source), names)
compiled = functools.lru_cache(maxsize=10_000)(lambda source: compile(source, "<types of messages>", "exec"))
parsed_types = functools.lru_cache(maxsize=1000)(anyreader.get_types_from_msg)
anyreader.get_types_from_msg = rosbags.typesys.get_types_from_msg = parsed_types


def shrink(path):
    """The same database in pages of 512 bytes."""
    with closing(sqlite3.connect(path)) as database:
        database.execute("PRAGMA journal_mode = DELETE")
        database.execute("PRAGMA page_size = 512")
        database.execute("VACUUM")


def read_bag(path):
    """All messages; a damaged bag must yield its whole messages too, and is refused all the same."""
    try:
        return every_message(path, recover=False)
    except FileFormatError:
        every_message(path, recover=True)
        raise


def every_message(path, *, recover):
    with closing(open_bag(path, recover=recover)) as opened:
        return [(found.topic, opened.decode(found.topic, found.raw)) for found in opened.messages(opened.topics)]


# cameras

KITTI = "".join(f"P{k}: {layouts.row(layouts.P)}\n" for k in range(4)) + (
    f"R0_rect: {layouts.row(np.eye(3))}\nTr_velo_to_cam: {layouts.row(layouts.T[:3])}\n"
    f"Tr_imu_to_velo: {layouts.row(layouts.T[:3])}\n"
)
TRACKING = KITTI.replace("R0_rect:", "R_rect").replace("Tr_velo_to_cam:", "Tr_velo_cam")
RAW_CAMERAS = (
    f"calib_time: 09-Jan-2012 13:57:47\nS_rect_02: 80 60\nR_rect_00: {layouts.row(np.eye(3))}\n"
    f"P_rect_02: {layouts.row(layouts.P)}\n"
)
RAW_LIDAR = f"R: {layouts.row(layouts.T[:3, :3])}\nT: {layouts.row(layouts.T[:3, 3])}\ndelta_f: 0 0\n"
OPENCV = """%YAML:1.0
---
image_width: 80
image_height: 60
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 72.5, 0., 40.25, 0., 71.5, 30.75, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -0.28, 7.e-02, 1e-3, -8.0e-04, 1.0e-05 ]
"""
KALIBR = """cam0:
  camera_model: pinhole
  distortion_coeffs: [-0.28, 0.07, 0.001, -0.0008]
  distortion_model: radtan
  intrinsics: [458.6, 457.3, 367.2, 248.4]
  resolution: [752, 480]
  T_cam_lidar: [[0, -1, 0, 0.5], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]
"""
CAMERA_INFO_YAML = """header: {frame_id: camera}
height: 480
width: 640
distortion_model: plumb_bob
D: [-0.28, 0.07, 0.001, -0.0008, 0.01]
K: [500.0, 0, 320, 0, 510, 240, 0, 0, 1]
R: [1, 0, 0, 0, 1, 0, 0, 0, 1]
P: [480.0, 0, 310, -96, 0, 480, 230, 0, 0, 0, 1, 0]
binning_x: 0
binning_y: 0
roi: {x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: false}
"""


XML = """<?xml version="1.0"?>
<opencv_storage>
<image_width>80</image_width>
<image_height>60</image_height>
<camera_matrix type_id="opencv-matrix">
  <rows>3</rows><cols>3</cols><dt>d</dt>
  <data>72.5 0. 40.25 0. 71.5 30.75 0. 0. 1.</data></camera_matrix>
<distortion_coefficients type_id="opencv-matrix">
  <rows>1</rows><cols>5</cols><dt>d</dt><data>-0.28 7e-02 1e-3 -8e-04 0.</data></distortion_coefficients>
<views><_>1</_><_>2</_></views>
</opencv_storage>
"""
EXTRINSIC = "pose_of: camera\ntranslation: [0.1, 0, -0.2]\nroll_pitch_yaw_deg: [1, 2, 3]\noptical: false\n"
EXTRINSIC_JSON = '{"pose_of": "lidar", "translation": {"x": 1, "y": 2, "z": 3}, "quaternion_wxyz": [1, 0, 0, 0]}'
TRANSFORMS = f"# lidar to camera\n{layouts.row(layouts.T[:3])}\n"


def read_camera(**options):
    return lambda path: ldls.read_camera(path, **options)


# masks, labels and results

MASKS = [random_masks(seed, 3, names={1: "person", 3: "car"}) for seed in (1, 2)]
SIZE = MASKS[0].image_size
LABELING = Labeling(np.array([0, 1, 2, 1]), np.array([0, 1, 0, 2]), np.zeros(4, bool), ("background", "Car", "Van"))
OBJECTS = (
    "Car 0.00 0 -1.57 4.00 3.00 9.00 8.00 1.5 1.6 3.9 1.0 1.7 20.0 -1.6\n"
    "Pedestrian 0.10 1 0.2 1.00 1.00 5.00 9.00 1.8 0.6 0.9 -1.0 1.7 12.0 0.3 0.91\n"
    "DontCare -1 -1 -10 2.0 2.0 3.0 3.0 -1 -1 -1 -1000 -1000 -1000 -10\n"
)


TUM_POSES = "# stamp tx ty tz qx qy qz qw\n1.5 0 0 0 0 0 0 1\n1.6 1.25 -0.5 0.1 0 0 0.6 0.8\n"
KITTI_POSES = "1 0 0 0.5 0 1 0 -1 0 0 1 0\n8.0e-01 0 6.0e-01 1.5 0 1 0 -1 -6.0e-01 0 8.0e-01 0\n"
OXTS = "49.015 8.4342 116.43 0.035 0.009 -2.6" + 19 * " 0.1" + " 4 11 6 6 6\n"


def coco(folder):
    """A data set with run lengths as text, one with lists of them and polygons, and results."""
    ldls.save(MASKS[0], folder / "a.json")
    ldls.save(MASKS[1], folder / "b.json", results=True)
    polygons = layouts.coco(20)
    lists = {"size": [60, 80], "counts": [3, 4, 60 * 80 - 7]}
    polygons["annotations"].append(polygons["annotations"][0] | {"id": 9, "segmentation": lists, "iscrowd": 1})
    return [[(folder / name).read_bytes()] for name in ("a.json", "b.json")] + [[json.dumps(polygons).encode()]]


def data_sets(folder):
    """Data sets of two images each, with the annotations first and last."""
    first, second = MASKS[0].to_coco(image_id=1, file_name="a/1.png"), MASKS[1].to_coco(image_id=2, file_name="2.jpg")
    both = {key: first[key] + second[key] for key in ("annotations", "images")}
    both["categories"] = first["categories"]
    return [[json.dumps(both).encode()], [json.dumps(dict(reversed(both.items())), indent=1).encode()]]


def read_data_set(path):
    opened = MaskDataSet(path)
    return [opened.masks(image_id) for image_id in opened.names]


LABELME = json.dumps(
    {
        "shapes": [
            {"label": "car", "points": [[1, 2], [9, 3.5], [4, 8]], "shape_type": "polygon", "group_id": None},
            {"label": "van", "points": [[1, 2], [9, 3.5]], "shape_type": "rectangle", "group_id": 2},
            {"label": "van", "points": [[30, 20], [35, 20]], "shape_type": "circle", "group_id": 2},
        ],
        "imageHeight": 60,
        "imageWidth": 80,
    }
)
CITYSCAPES_POLYGONS = json.dumps(
    {
        "objects": [
            {"label": "road", "polygon": [[0, 0], [80, 0], [80, 60]]},
            {"label": "car", "polygon": [[1, 2], [9, 3.5], [4, 8]]},
            {"label": "object--vehicle--bus", "polygon": [[11, 2], [19, 3.5], [14, 8]]},
        ],
        "imgHeight": 60,
        "imgWidth": 80,
    }
)
YOLO = "2 0.25 0.25 0.5 0.25 0.5 0.5\n0 0.1 0.1 0.2 0.1 0.2 0.3 0.1 0.3 0.75\n"


def sam(_):
    records = MASKS[0].to_coco()["annotations"]
    kept = [{"segmentation": record["segmentation"], "predicted_iou": 0.9} for record in records]
    return [[json.dumps(kept).encode()], [json.dumps({"image": {}, "annotations": kept}).encode()]]


INSTANCE_IDS = Image.fromarray(np.array([[0, 26001], [7, 24002]], np.uint16))
"""As Cityscapes has them: 1000 times the class and the number of the instance."""


def panoptic_masks(_):
    file = io.BytesIO()
    Image.fromarray(np.array([[[5, 1, 0], [9, 0, 0]]], np.uint8)).save(file, "PNG")
    content = {
        "images": [{"id": 1, "height": 1, "width": 2}],
        "annotations": [{"image_id": 1, "file_name": "a.png", "segments_info": [{"id": 261, "category_id": 3}]}],
        "categories": [{"id": 3, "name": "car", "isthing": 1}],
    }
    return [[json.dumps(content).encode(), file.getvalue()]]


def members(*paths_of):
    """Names and arrays of archives; each is packed again after the change."""

    def seeds(folder):
        for write in paths_of:
            path = folder / "a.npz"
            write(path)
            with zipfile.ZipFile(path) as archive:
                names = archive.namelist()
                yield ["\n".join(names).encode(), *(archive.read(name) for name in names)]

    return lambda folder: list(seeds(folder))


def packed_members(parts):
    file = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(file, "w") as archive:
        warnings.simplefilter("ignore")  # a name may stand there twice
        for name, content in zip(parts[0].decode("utf-8", "replace").split("\n"), parts[1:], strict=False):
            archive.writestr(zipfile.ZipInfo(name), content)
    return file.getvalue()


def apart(count):
    """Masks that do not overlap."""
    numbers = np.arange(60).reshape(6, 10) // 13 % (count + 1)
    return ldls.InstanceMasks.from_instance_image(numbers)


def result(n_cameras):
    def write(path):
        generator = np.random.default_rng(7)
        points = generator.uniform([-3, -2, 9, 0], [3, 2, 14, 1], (30, 4)).astype(np.float32)
        pixels = np.zeros((2, 60, 80), bool)
        pixels[0, 20:40, 15:30] = pixels[1, 20:40, 50:65] = True
        masks = ldls.InstanceMasks.from_array(pixels, categories=[1, 3], scores=[0.9, 0.8])
        views = [ldls.View(masks, pinhole(), f"camera {k}") for k in range(n_cameras)]
        ldls.save(ldls.segment(points, views) if n_cameras > 1 else ldls.segment(points, masks, pinhole()), path)

    return write


def panoptic(path):
    np.savez(path, data=np.arange(17_000, 17_020, dtype=np.uint16))


def png_parts(*masks_of):
    """Header, further chunks and pixels of images; packed again after the change, with checksums that hold."""

    def seeds(folder):
        for write in masks_of:
            write(folder / "a.png")
            yield list(chunks_of((folder / "a.png").read_bytes()))

    return lambda folder: list(seeds(folder))


def chunks_of(content):
    """The chunks of a PNG, kind and content each; the pixels unpacked and last."""
    at, pixels = 8, b""
    while at < len(content):
        (size,) = struct.unpack_from(">I", content, at)
        kind, own = content[at + 4 : at + 8], content[at + 8 : at + 8 + size]
        if kind == b"IDAT":
            pixels += own
        elif kind != b"IEND":
            yield kind + own
        at += size + 12
    yield zlib.decompress(pixels)


def packed_png(parts):
    *chunks, pixels = parts
    body = [*chunks, b"IDAT" + zlib.compress(pixels, 1), b"IEND"]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", max(0, len(chunk) - 4)) + chunk + struct.pack(">I", zlib.crc32(chunk)) for chunk in body
    )


def picture(suffix, *modes):
    def write(mode):
        pixels = Image.fromarray(ros_samples.picture(size=(9, 12))).convert(mode)
        return lambda path: pixels.save(path, suffix)

    return [write(mode) for mode in modes]


def read_image(path):
    size = read_image_size(path)
    pixels = ldls.read_image(path)
    assert pixels.shape == (*size, 3)
    return pixels


# sources, journals and models


def nuscenes(folder):
    """The tables of one key frame of one camera."""
    layouts.nuscenes(folder, n_frames=1, channels=("LIDAR_TOP", "CAM_FRONT"))
    tables = [(folder / name).read_bytes() for name in NUSCENES_TABLES]
    return [tables]


NUSCENES_TABLES = tuple(f"v1.0-mini/{name}.json" for name in (*nuscenes_tables.TABLES, "lidarseg"))


def read_tables(folder):
    tables = nuscenes_tables.find_tables(folder, None)
    samples = nuscenes_tables.read_sample_names(tables, None)
    sensors = nuscenes_tables.read_sensors(tables, nuscenes_tables.read_channels(tables), ("LIDAR_TOP", "CAM_FRONT"))
    readings = nuscenes_tables.read_readings(tables, samples, sensors)
    taken = [each for frame in readings.values() for each in frame.values()]
    poses = nuscenes_tables.read_poses(tables, {each.pose for each in taken})
    return poses, nuscenes_tables.read_truth_files(tables, "lidarseg", {each.token for each in taken})


FRAME = {
    "timestamp": 1.5,
    "lidar": {"file": "a.bin", "columns": ["x", "y", "z", "intensity"]},
    "cameras": {
        "front": {
            "file": "front.png",
            "timestamp": 1.4,
            "intrinsics": layouts.K.tolist(),
            "lidar_to_camera": layouts.T.tolist(),
            "boxes_2d": [{"category": "car", "box": [1, 2, 3, 4]}],
        }
    },
    "boxes_3d": [{"category": "car", "center_size_yaw": [10, 0, 0, 4, 2, 2, 0.1]}],
}


def nuscenes_frame(folder):
    Image.new("RGB", (8, 6)).save(folder / "front.png")
    image, points = (folder / "front.png").read_bytes(), cloud().tobytes()
    return [[json.dumps(FRAME).encode(), image, points]]


def read_frame(folder):
    source = NuScenesFrameSource(folder)
    return source[0].truth


HEADER = {"ldls": "1", "params": {"sigma": 1.0}}
FRAMES = ("000000", "000001")


def journal(path):
    path.mkdir()
    with closing(Journal(path, HEADER)) as made:
        made.add([record(name) for name in FRAMES])


def record(name):
    """What a run writes of a frame."""
    return {
        "frame": name,
        "files": {f"{name}.label": [400, "5d" * 32]},
        "inputs": {f"velodyne/{name}.bin": [1600, 1_792_000_000, "a7" * 32], f"masks/{name}.json": None},
        "window": ["000001"],
        "stamp": 0.1,
        "pose": np.eye(4).tolist(),
        "images": [["image_2", 60, 80]],
        "objects": [dict.fromkeys(COLUMNS, 1)],
        "nothing_in_view": None,
    }


def journals(folder):
    journal(folder / "a")
    return [[(folder / "a" / JOURNAL_NAME).read_bytes()]]


def read_journal(path):
    with closing(Journal(path.parent, HEADER)) as made:
        return list(made.records(FRAMES))


def model(_):
    box = np.array([[2, 3, 12, 13]], np.float32)
    one = graphs.constant_detections(box, np.array([3]), np.array([0.9], np.float32), np.ones((1, 1, 2, 3), np.float32))
    return [[one.SerializeToString()]]


PARSERS: dict[str, Parser] = {
    "points .bin": Parser(("a.bin",), lambda _: [[cloud().tobytes()], [cloud(5).tobytes()]], ldls.read_points),
    "points .npy": Parser(
        ("a.npy",),
        lambda _: [[npy(cloud())], [npy(cloud(3, ">f8"))], [npy(np.asfortranarray(cloud()))]],
        ldls.read_points,
    ),
    "points .pcd ascii": Parser(("a.pcd",), pcd_ascii, ldls.read_points, text=True),
    "points .pcd binary": Parser(("a.pcd",), pcd_binary, ldls.read_points),
    "points .pcd compressed": Parser(("a.pcd",), pcd_compressed, ldls.read_points, packed_pcd),
    "points .ply ascii": Parser(("a.ply",), ply("ascii", ""), ldls.read_points, text=True),
    "points .ply little-endian": Parser(("a.ply",), ply("binary_little_endian", "<"), ldls.read_points),
    "points .ply big-endian": Parser(("a.ply",), ply("binary_big_endian", ">"), ldls.read_points),
    "points .las": Parser(("a.las",), las(0, 3, 6, 7), ldls.read_points),
    "points .laz": Parser(("a.laz",), las(1, 3, packed=True), ldls.read_points),
    "points .laz layered": Parser(("a.laz",), las(6, 7, packed=True), ldls.read_points),
    "points .csv": Parser(("a.csv",), texts(CSV, SEMICOLONS), ldls.read_points, text=True),
    "points .txt": Parser(("a.txt",), texts(rows_of_text(cloud()), "# made\n1 2 3\n"), ldls.read_points, text=True),
    "message PointCloud2": Parser(("a.cdr",), message("/points"), read_message("/points"), names_file=False),
    "message Image": Parser(
        ("a.cdr",),
        message("/image", lambda: ros_samples.image(ROS2, ros_samples.picture(size=(4, 6))[..., 0], "bayer_rggb8")),
        read_message("/image"),
        names_file=False,
    ),
    "message CompressedImage": Parser(
        ("a.cdr",),
        message("/compressed", lambda: compressed(ROS2, "PNG")),
        read_message("/compressed"),
        names_file=False,
    ),
    "message CameraInfo": Parser(("a.cdr",), message("/info"), read_message("/info"), names_file=False),
    "bag ROS 1": Parser(("a.bag",), bag_ros1, read_bag),
    "bag .db3": Parser(("a.db3",), bag_ros2("SQLITE3"), read_bag),
    "bag .mcap": Parser(("a.mcap",), bag_ros2("MCAP"), read_bag),
    "camera KITTI": Parser(("a.txt",), texts(KITTI, TRACKING), read_camera(), text=True),
    "camera KITTI raw": Parser(
        ("calib_cam_to_cam.txt", "calib_velo_to_cam.txt"),
        texts(RAW_CAMERAS + BETWEEN_FILES.decode() + RAW_LIDAR),
        read_camera(),
        text=True,
    ),
    "camera OpenCV": Parser(("a.yaml",), texts(OPENCV), read_camera(T_camera_lidar=T_CAMERA_LIDAR), text=True),
    "camera Kalibr": Parser(("a.yaml",), texts(KALIBR), read_camera(), text=True),
    "camera CameraInfo": Parser(
        ("a.yaml",), texts(CAMERA_INFO_YAML), read_camera(T_camera_lidar=T_CAMERA_LIDAR), text=True
    ),
    "poses KITTI": Parser(
        ("a.txt",),
        texts(KITTI_POSES),
        lambda path: ldls.read_poses(path, stamps=[0, 1], T_camera_lidar=T_CAMERA_LIDAR),
        text=True,
    ),
    "poses TUM": Parser(("a.txt",), texts(TUM_POSES), ldls.read_poses, text=True),
    "poses KITTI raw": Parser(
        ("drive/oxts/data/0000000000.txt", "drive/oxts/timestamps.txt", "calib_imu_to_velo.txt"),
        texts(BETWEEN_FILES.decode().join((OXTS, "2011-09-26 13:02:25.951199337\n", RAW_LIDAR))),
        lambda folder: ldls.read_poses(folder / "drive/oxts"),
        text=True,
        allowed=(OSError,),
    ),
    "masks .json": Parser(("a.json",), coco, ldls.read_masks, text=True, gentle=0.5),
    "masks of all images .json": Parser(("a.json",), data_sets, read_data_set, text=True, gentle=0.5),
    "masks labelme": Parser(("a.json",), texts(LABELME, CITYSCAPES_POLYGONS), ldls.read_masks, text=True, gentle=0.5),
    "masks panoptic": Parser(
        ("a.json", "a.png"),
        panoptic_masks,
        lambda folder: ldls.read_masks(folder / "a.json"),
        BETWEEN_FILES.join,
        allowed=(OSError,),
    ),
    "masks SAM": Parser(("a.json",), sam, ldls.read_masks, text=True, gentle=0.5),
    "masks YOLO": Parser(("a.txt",), texts(YOLO), lambda path: ldls.read_masks(path, image_size=(60, 80)), text=True),
    "masks Cityscapes": Parser(
        ("a_instanceIds.png",), png_parts(INSTANCE_IDS.save), ldls.read_masks, packed_png, gentle=0.4
    ),
    "camera OpenCV XML": Parser(("a.xml",), texts(XML), read_camera(T_camera_lidar=T_CAMERA_LIDAR), text=True),
    "extrinsic": Parser(("a.json",), texts(EXTRINSIC, EXTRINSIC_JSON), as_extrinsic, text=True),
    "masks .npz": Parser(
        ("a.npz",),
        members(*(lambda path, m=m: ldls.save(m, path) for m in MASKS)),
        ldls.read_masks,
        packed_members,
        gentle=0.9,
    ),
    "masks .npz research": Parser(
        ("a.npz",),
        members(lambda path: ldls.save(of_coco(MASKS[0]), path, layout="research")),
        ldls.read_masks,
        packed_members,
    ),
    "masks .npy": Parser(("a.npy",), lambda _: [[npy(m.to_array())] for m in MASKS], ldls.read_masks),
    "masks .png": Parser(
        ("a.png",),
        png_parts(*(lambda path, k=k: ldls.save(apart(k), path) for k in (1, 2))),
        ldls.read_masks,
        packed_png,
        gentle=0.5,
    ),
    "masks .txt": Parser(
        ("a.txt",), texts(OBJECTS), lambda path: ldls.read_masks(path, image_size=(20, 30)), text=True
    ),
    "labels .label": Parser(
        ("a.label",), lambda _: [[np.array([0, 10 | 7 << 16, 40, 252], "<u4").tobytes()]], read_labeling
    ),
    "labels _lidarseg.bin": Parser(("a_lidarseg.bin",), lambda _: [[bytes(range(20))]], read_labeling),
    "labels _panoptic.npz": Parser(("a_panoptic.npz",), members(panoptic), read_labeling, packed_members, gentle=0.5),
    "labels squeezeseg": Parser(
        ("a.npy",), lambda _: [[npy(np.arange(64 * 512, dtype=np.uint8).reshape(64, 512) % 4)]], read_labeling
    ),
    "labels label_2": Parser(("a.txt",), texts(OBJECTS), read_kitti_objects, text=True),
    "labels .npz": Parser(
        ("a.npz",), members(lambda path: write_labeling(path, LABELING)), read_labeling, packed_members, gentle=0.5
    ),
    "labels KITTI boxes": Parser(
        ("a.txt",),
        texts(OBJECTS),
        lambda path: read_labeling(path, format="kitti-boxes", points=cloud(), camera=CAMERA),
        text=True,
    ),
    "labels confidence": Parser(
        ("a.npz",),
        members(lambda path: np.savez(path, confidence=np.linspace(0, 1, 5, dtype=np.float32))),
        read_confidence_npz,
        packed_members,
        gentle=0.5,
    ),
    "labels annotations": Parser(
        ("a.txt",),
        written(lambda path: write_annotations(path, LABELING)),
        lambda path: read_labeling(path, format="annotations"),
        text=True,
    ),
    "result .npz": Parser(("a.npz",), members(result(1), result(2)), ldls.read_result, packed_members),
    "ranges squeezeseg": Parser(
        ("a.npy",), lambda _: [[npy(np.ones((64, 512, 6), np.float32))]], read_squeezeseg_ranges
    ),
    "image PNG": Parser(("a.png",), png_parts(*picture("PNG", "RGB", "P", "RGBA")), read_image, packed_png),
    "image JPEG": Parser(("a.jpg",), written(*picture("JPEG", "RGB", "L")), read_image),
    "transforms .txt": Parser(
        ("a.txt",), texts(TRANSFORMS), lambda path: given_transforms(path, ["/image"]), text=True
    ),
    "folder ldls.toml": Parser(("ldls.toml",), texts(layouts.FOLDER_TOML), read_description, text=True),
    "nuScenes tables": Parser(NUSCENES_TABLES, nuscenes, read_tables, BETWEEN_FILES.join, text=True),
    "nuScenes frame.json": Parser(
        ("frame.json", "front.png", "a.bin"),
        nuscenes_frame,
        read_frame,
        BETWEEN_FILES.join,
        text=True,
        allowed=(OSError,),
    ),
    "journal": Parser((JOURNAL_NAME,), journals, read_journal, text=True),
    "model .onnx": Parser(("a.onnx",), model, read_onnx),
}
"""Parsers by name."""
