"""Small ROS messages and bags for tests."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ldls.io.ros.bags import open_bag
from ldls.io.ros.messages import (
    CAMERA_INFO,
    COMPRESSED_IMAGE,
    IMAGE,
    POINTS,
    TRANSFORMS,
    Header,
    Topic,
    make,
    make_header,
)
from ldls.io.ros.point_cloud2 import encode
from ldls.io.ros.writer import BagWriter

START_NS = 1_000_000_000_000
STEP_NS = 100_000_000
K = [100.0, 0, 40, 0, 100, 30, 0, 0, 1]
P = [110.0, 0, 41, 0, 0, 110, 31, 0, 0, 0, 1, 0]
CAMERA_HEADER = Header(0, "camera")
TO_OPTICAL = (0.5, -0.5, 0.5, -0.5)
"""w x y z of the turn from a body's axes to an optical frame's."""


@dataclass(kw_only=True)
class Recording:
    """The contents of a small bag; each test changes one thing."""

    kind: str = "rosbag1"
    sweeps: int = 3
    image_offset_ns: int = 10_000_000
    points_topic: str = "/points"
    image_topics: tuple = ("/camera/image_raw",)
    info_topics: tuple = ("/camera/camera_info",)
    columns: tuple = ("x", "y", "z", "intensity")
    K: list = field(default_factory=lambda: K)
    model: str = "plumb_bob"
    D: list = field(default_factory=lambda: [-0.1, 0.01, 0.0, 0.0, 0.0])
    binning: int = 0
    region: tuple = (0, 0, 0, 0)
    size: tuple = (60, 80)
    edges: tuple = (("base", "lidar"), ("base", "camera"))
    moving: tuple = ()
    stamps_stand_still: bool = False
    point_dtype: type = np.float32

    def write(self, path: Path) -> Path:
        with BagWriter(path, self.kind) as bag:
            bag.add_topic(Topic("/tf_static", TRANSFORMS, 0, latched=True))
            bag.add_topic(Topic("/tf", TRANSFORMS, 0))
            bag.add_topic(Topic(self.points_topic, POINTS, 0))
            for topic in self.image_topics:
                bag.add_topic(Topic(topic, COMPRESSED_IMAGE if topic.endswith("compressed") else IMAGE, 0))
            for topic in self.info_topics:
                bag.add_topic(Topic(topic, CAMERA_INFO, 0))
            if self.edges:
                bag.write_message("/tf_static", transforms(bag.types, self.edges, START_NS), START_NS)
            for number in range(self.sweeps):
                self._write_sweep(bag, number)
        return path

    def _write_sweep(self, bag: BagWriter, number: int) -> None:
        stamp = START_NS if self.stamps_stand_still else START_NS + number * STEP_NS
        received = START_NS + number * STEP_NS + 1_000_000
        if self.moving:
            bag.write_message("/tf", transforms(bag.types, self.moving, stamp, height=float(number)), received)
        bag.write_message(self.points_topic, encode(bag.types, self.cloud(number), Header(stamp, "lidar")), received)
        header = Header(stamp + self.image_offset_ns, "camera")
        for topic in self.info_topics:
            bag.write_message(topic, self.info(bag.types, header), received)
        for topic in self.image_topics:
            bag.write_message(topic, image(bag.types, picture(number), header=header), received)

    def cloud(self, number: int) -> dict:
        values = np.random.default_rng(number).uniform(1, 9, (50, len(self.columns))).astype(self.point_dtype)
        values[7, 0] = np.nan
        return dict(zip(self.columns, values.T, strict=True))

    def info(self, types, header=CAMERA_HEADER):
        top, left, rows, columns = self.region
        region = make(
            types,
            "sensor_msgs/msg/RegionOfInterest",
            x_offset=left,
            y_offset=top,
            height=rows,
            width=columns,
            do_rectify=False,
        )
        matrices = {"D": self.D, "K": self.K, "R": np.eye(3).reshape(-1), "P": P}
        known = types.types[CAMERA_INFO].__dataclass_fields__
        return make(
            types,
            CAMERA_INFO,
            header=make_header(types, header),
            height=self.size[0],
            width=self.size[1],
            distortion_model=self.model,
            binning_x=self.binning,
            binning_y=self.binning,
            roi=region,
            **{n if n in known else n.lower(): np.array(m, np.float64) for n, m in matrices.items()},
        )


def storage(path: Path) -> Path:
    """The one storage file of a bag."""
    return path if path.is_file() else next(p for p in path.iterdir() if p.suffix != ".yaml")


def messages(path: Path, *, recover: bool = False) -> list:
    """Topic, time and bytes of each message of a bag."""
    bag = open_bag(path, recover=recover)
    try:
        return [(message.topic, message.received_ns, message.raw) for message in bag.messages(bag.topics)]
    finally:
        bag.close()


def picture(number: int = 0, size=(60, 80)) -> np.ndarray:
    return np.random.default_rng(100 + number).integers(0, 256, (*size, 3), np.uint8)


def image(types, pixels, encoding="rgb8", *, header=CAMERA_HEADER, padding=0, big_endian=False):
    """An Image message of (H, W[, C]) samples; rows are padded by `padding` bytes."""
    rows = np.ascontiguousarray(pixels).reshape(len(pixels), -1).view(np.uint8)
    rows = np.pad(rows, ((0, 0), (0, padding)), constant_values=77)
    return make(
        types,
        IMAGE,
        header=make_header(types, header),
        height=pixels.shape[0],
        width=pixels.shape[1],
        encoding=encoding,
        is_bigendian=int(big_endian),
        step=rows.shape[1],
        data=rows.reshape(-1),
    )


def transforms(types, edges, stamp_ns, height=0.0):
    """A TFMessage: the lidar is 1 m above its parent, "camera" optical; moving ones rise by `height`."""
    return make(types, TRANSFORMS, transforms=[_edge(types, *edge, stamp_ns, height) for edge in edges])


def _edge(types, parent, child, stamp_ns, height):
    w, x, y, z = TO_OPTICAL if child == "camera" else (1.0, 0.0, 0.0, 0.0)
    rise = height + (1.0 if child == "lidar" else 0.0)
    return make(
        types,
        "geometry_msgs/msg/TransformStamped",
        header=make_header(types, Header(stamp_ns, parent)),
        child_frame_id=child,
        transform=make(
            types,
            "geometry_msgs/msg/Transform",
            translation=make(types, "geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=rise),
            rotation=make(types, "geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w),
        ),
    )
