"""A simulated drive as a ROS bag, with masks and truth beside it.

OUT/drive.bag or OUT/drive/     the bag: ROS 1, or ROS 2 with SQLite or MCAP storage
OUT/masks/STAMP.json            masks that a segmenter finds in the image of the sweep, as COCO JSON with scores
OUT/annotations/STAMP.txt       `instance class`, a line a point of the sweep; `0 background` for no object

STAMP is that of the sweep in nanoseconds, the name that `ldls.datasets.RosBag` gives the frame.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ldls.camera.extrinsic import OPTICAL_FROM_BODY
from ldls.camera.rigid import to_quaternion
from ldls.io.images import png_of
from ldls.io.ros.messages import (
    CAMERA_INFO,
    COMPRESSED_IMAGE,
    IMAGE,
    NANOSECONDS,
    POINTS,
    TRANSFORMS,
    Header,
    Topic,
    make,
    make_header,
)
from ldls.io.ros.point_cloud2 import encode
from ldls.io.ros.writer import BagWriter
from ldls.simulation.drives import PERIOD_S, ROBOT, ROBOT_SPEED_M_S, robot_drive
from ldls.simulation.error_model import SegmenterErrors
from ldls.simulation.kitti_layout import write_masks, write_truth
from ldls.simulation.simulated_frame import SimulatedFrame

START_NS = 1_700_000_000 * NANOSECONDS
"""Stamp of the first sweep."""
LATENCY_NS = 3_000_000
"""Time from the stamp of a message to its reception."""
POINTS_TOPIC, INFO_TOPIC, IMAGE_TOPIC = "/velodyne_points", "/camera/camera_info", "/camera/image_raw"
LIDAR_FRAME, OPTICAL_FRAME = "velodyne", "camera_optical_frame"


def write_robot_drive(
    folder: str | PathLike[str],
    kind: str,
    *,
    frames: int = 20,
    seed: int = 0,
    segmenter: SegmenterErrors | None = None,
    compressed: bool = False,
    spinning: bool = False,
) -> Path:
    """Write the bag of a robot's drive through a campus, and return its path.

    The bag has /velodyne_points (x y z intensity ring, as the VLP-16's driver has it, and its time where the lidar
    spins), /camera/image_raw (or /camera/image_raw/compressed), /camera/camera_info with a plumb_bob lens, /tf_static
    and /tf.

    Args:
        folder: Where to write; made if need be.
        kind: "rosbag1", "rosbag2" (SQLite) or "mcap".
        frames: Number of sweeps, ten a second.
        seed: Seed of the scene and its noise.
        segmenter: Errors of the masks; by default the usual ones, but for wrong categories.
        compressed: PNG images rather than raw ones.
        spinning: The lidar takes 0.1 s for a sweep while all moves, as in a `Drive`; /tf then has begin and end of
            each turn too.

    Raises:
        ParameterError: There is no such kind, or `frames` is below 1.
        FileExistsError: The bag is there already, or one of another kind, whose masks and annotations would be lost.
        ImportError: `ldls[sim,ros]` is not installed.
    """
    folder = Path(folder)
    ros1, ros2 = folder / "drive.bag", folder / "drive"
    path, other = (ros1, ros2) if kind == "rosbag1" else (ros2, ros1)
    bag = BagWriter(path, kind)
    if other.exists():
        raise FileExistsError(
            f"{other}: exists already, with masks and annotations; remove it or choose another folder"
        )
    folder.mkdir(parents=True, exist_ok=True)
    with bag:
        image_topic = f"{IMAGE_TOPIC}/compressed" if compressed else IMAGE_TOPIC
        bag.add_topic(Topic("/tf_static", TRANSFORMS, 0, latched=True))
        bag.add_topic(Topic("/tf", TRANSFORMS, 0))
        bag.add_topic(Topic(POINTS_TOPIC, POINTS, 0))
        bag.add_topic(Topic(image_topic, COMPRESSED_IMAGE if compressed else IMAGE, 0))
        bag.add_topic(Topic(INFO_TOPIC, CAMERA_INFO, 0))
        first_ns = _stamp_ns(-PERIOD_S / 2 if spinning else 0)
        bag.write_message("/tf_static", _static_transforms(bag.types), first_ns)
        if spinning:
            _write_place(bag, -PERIOD_S / 2)
        for number, frame in enumerate(robot_drive(frames, seed=seed, segmenter=segmenter, spinning=spinning)):
            _write_frame(bag, image_topic, frame)
            stamp = _stamp_ns(frame.stamp)
            write_masks(folder / "masks" / f"{stamp}.json", frame.images[0].masks, number)
            write_truth(folder / "annotations" / f"{stamp}.txt", frame)
    return path


def _stamp_ns(seconds: float) -> int:
    return START_NS + round(seconds * NANOSECONDS)


def _write_frame(bag: BagWriter, image_topic: str, frame: SimulatedFrame) -> None:
    (view,) = frame.images
    swept, taken = _stamp_ns(frame.stamp), _stamp_ns(view.stamp)
    image_header = make_header(bag.types, Header(taken, OPTICAL_FRAME))
    image = (_png if image_topic.endswith("compressed") else _image)(bag.types, view.read(), image_header)
    info = _camera_info(bag.types, image_header)
    cloud = encode(bag.types, _velodyne_columns(frame), Header(swept, LIDAR_FRAME))
    _write_place(bag, frame.stamp)
    for topic, message, stamp_ns in (
        (POINTS_TOPIC, cloud, swept),
        (image_topic, image, taken),
        (INFO_TOPIC, info, taken),
    ):
        bag.write_message(topic, message, stamp_ns + LATENCY_NS)
    if frame.times is not None:
        _write_place(bag, frame.stamp + PERIOD_S / 2)


def _write_place(bag: BagWriter, seconds: float) -> None:
    """Where the robot is at a time."""
    way, stamp_ns = np.eye(4), _stamp_ns(seconds)
    way[0, 3] = ROBOT_SPEED_M_S * seconds
    transforms = [_transform(bag.types, Header(stamp_ns, "odom"), "base_link", way)]
    bag.write_message("/tf", make(bag.types, TRANSFORMS, transforms=transforms), stamp_ns + LATENCY_NS)


def _velodyne_columns(frame: SimulatedFrame) -> dict[str, NDArray[Any]]:
    """The fields of the VLP-16's driver: ring 0 is the lowest beam, intensity 0 to 255, time counts from the stamp."""
    x, y, z, intensity = frame.points.T
    beams = len(ROBOT.lidar.elevations_deg)
    columns: dict[str, NDArray[Any]] = {
        "x": x,
        "y": y,
        "z": z,
        "intensity": np.round(255 * intensity).astype(np.float32),
        "ring": (beams - 1 - frame.rings).astype(np.uint16),
    }
    if frame.times is not None:
        columns["time"] = frame.times.astype(np.float32)
    return columns


def _image(types: Any, pixels: NDArray[np.uint8], header: Any) -> Any:  # noqa: ANN401
    height, width, _ = pixels.shape
    return make(
        types,
        IMAGE,
        header=header,
        height=height,
        width=width,
        encoding="rgb8",
        is_bigendian=0,
        step=3 * width,
        data=pixels.reshape(-1),
    )


def _png(types: Any, pixels: NDArray[np.uint8], header: Any) -> Any:  # noqa: ANN401
    data = np.frombuffer(png_of(Image.fromarray(pixels)), np.uint8)
    return make(types, COMPRESSED_IMAGE, header=header, format="rgb8; png compressed bgr8", data=data)


def _camera_info(types: Any, header: Any) -> Any:  # noqa: ANN401
    model = ROBOT.cameras[0].model
    whole = dict.fromkeys(("x_offset", "y_offset", "height", "width"), 0)
    region = make(types, "sensor_msgs/msg/RegionOfInterest", **whole, do_rectify=False)
    matrices: dict[str, NDArray[np.float64]] = {
        "D": np.array(model.distortion.coefficients),
        "K": model.projection()[:, :3].reshape(-1),
        "R": np.eye(3).reshape(-1),
        "P": model.projection().reshape(-1),
    }
    fields = types.types[CAMERA_INFO].__dataclass_fields__
    return make(
        types,
        CAMERA_INFO,
        header=header,
        height=model.height,
        width=model.width,
        distortion_model=model.distortion.model,
        binning_x=0,
        binning_y=0,
        roi=region,
        **{name if name in fields else name.lower(): matrix for name, matrix in matrices.items()},
    )


def _static_transforms(types: Any) -> Any:  # noqa: ANN401
    """From the robot's body to the lidar, to the camera, and from the camera's body to its optical frame."""
    lidar, camera, optical = np.eye(4), np.eye(4), OPTICAL_FROM_BODY.T
    lidar[2, 3] = ROBOT.height_m
    camera[:3, 3] = lidar[:3, 3] + ROBOT.cameras[0].position_m
    edges = (
        ("base_link", LIDAR_FRAME, lidar),
        ("base_link", "camera_link", camera),
        ("camera_link", OPTICAL_FRAME, optical),
    )
    messages = [_transform(types, Header(START_NS, parent), child, matrix) for parent, child, matrix in edges]
    return make(types, TRANSFORMS, transforms=messages)


def _transform(types: Any, header: Header, child: str, T_parent_child: NDArray[np.float64]) -> Any:  # noqa: ANN401
    x, y, z = T_parent_child[:3, 3].tolist()
    qw, qx, qy, qz = to_quaternion(T_parent_child[:3, :3]).tolist()
    transform = make(
        types,
        "geometry_msgs/msg/Transform",
        translation=make(types, "geometry_msgs/msg/Vector3", x=x, y=y, z=z),
        rotation=make(types, "geometry_msgs/msg/Quaternion", x=qx, y=qy, z=qz, w=qw),
    )
    stamped = "geometry_msgs/msg/TransformStamped"
    return make(types, stamped, header=make_header(types, header), child_frame_id=child, transform=transform)
