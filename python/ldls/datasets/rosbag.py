"""ROS bags as sources of frames: a cloud, the images taken nearest to it, their cameras."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property, partial
from itertools import chain, islice
from os import PathLike
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ldls.camera import Camera
from ldls.camera.camera_info import MESSAGE_FIELDS
from ldls.checks import checked
from ldls.datasets.frame import POSES_LEFT_OUT, CameraImage, Frame, Source
from ldls.datasets.ros_odometry import Odometry, odometry_topics, read_odometry
from ldls.datasets.ros_stamps import StampedMessage, check_clock, nearest, nearest_images, offset_s, read_stamps
from ldls.datasets.ros_topics import choose_topics
from ldls.datasets.ros_transforms import TransformTree, agreeing, ancestors, frames_of, given_transforms, parents, plain
from ldls.errors import CalibrationError, ParameterError, PoseError, within
from ldls.io.cameras.extrinsic_file import Extrinsic
from ldls.io.ros.bags import SUFFIXES, open_bag, storage_files
from ldls.io.ros.images import decode_compressed, decode_image
from ldls.io.ros.messages import (
    COMPRESSED_IMAGE,
    IMAGE,
    NANOSECONDS,
    ODOMETRY,
    OLD_TRANSFORMS,
    TRANSFORMS,
    Header,
    Message,
    Topic,
    seconds,
)
from ldls.io.ros.point_cloud2 import READ_FIELDS, PointCloud, decode as decode_points
from ldls.sequences import Trajectory
from ldls.sequences.trajectory import LONGEST_S

TIME = "time"
"""What `fields` calls the field of times."""
STATIC_TRANSFORMS, MOVING_TRANSFORMS = "/tf_static", "/tf"
FIRST_TRANSFORMS = 1000
"""Messages of /tf that tell which frames there are: a second of them or more."""
UNPICKLED = ("_bag", "_tree", "_odometry")
"""Attributes that another process makes itself."""


class RosBag(Source):
    """The sweeps of a ROS bag with the images nearest to them in time.

    Opening reads the stamps of clouds, images and calibrations and decodes none of them; a frame decodes its own
    messages, and images only when they are asked for. Sweeps and images are paired by the stamps in their headers. A
    sweep with no image within the tolerance is no frame; `unpaired` counts them.

    Coordinates are those of the cloud's frame, cameras those of the image's, which is optical in ROS (x right, y down,
    z forward). Transforms between the two come from /tf_static, or where that does not connect them from /tf at the
    time nearest to the image; in a bag of several robots from those under the prefix of the cloud's topic. Points have
    the times of the field `time`, `t`, `offset_time`, `time_offset` or `timestamp` of their cloud. How the robot moves
    during a sweep, and between it and the images, is left in; `Frame.deskewed` takes it out.

    Attributes:
        kind: "rosbag".
        path: The bag.
        names: Stamp of each sweep in nanoseconds; running numbers of six digits where stamps repeat themselves.
        stamps: Times of the sweeps in seconds.
        camera_names: Name of the camera of each image of a frame: its topic, fit for a file name.
        topics: The topics that are read.
        max_offset_s: The tolerance.
        unpaired: Number of sweeps with no image within the tolerance.
        recover: True if the whole messages of a truncated bag are read.
        world: Frame in which frames have their pose, or topic of Odometry; None if they have none.
    """

    kind = "rosbag"
    looks_for = "a .bag, .db3 or .mcap file, or a folder with the metadata.yaml of ROS 2"

    @checked
    def __init__(
        self,
        path: str | PathLike[str],
        *,
        points_topic: str | None = None,
        image_topics: str | Sequence[str] | None = None,
        info_topics: str | Sequence[str] | None = None,
        max_offset_s: float = 0.05,
        T_camera_lidar: Extrinsic | Mapping[str, Extrinsic] | None = None,
        fields: Mapping[str, str] | None = None,
        world: str | None = None,
        poses: bool = True,
        recover: bool = False,
    ) -> None:
        """Open a bag and pair its stamps.

        Args:
            path: A ROS 1 `.bag`, a ROS 2 folder with metadata.yaml, or a bare `.db3` or `.mcap`.
            points_topic: Topic of the clouds (PointCloud2); the only one there is by default.
            image_topics: Topic of the images (Image or CompressedImage), or several, one a camera; the only one there
                is by default, and () for clouds alone. Names with "image_rect" are those of rectified images.
            info_topics: Topic of the CameraInfo of each image topic; the one beside it by default.
            max_offset_s: Longest time between the stamps of sweep and image, in seconds.
            T_camera_lidar: (4, 4) from lidar to camera coordinates, or a file of it, as `ldls.read_camera` takes them,
                instead of the bag's transforms; a mapping from image topic to either for several cameras.
            fields: The clouds' own names of x, y, z, intensity and time, where they differ; with "" for the time points
                have none.
            world: Frame in which frames have their pose and trajectory, as "odom" or "map": by /tf, or where that does
                not connect it with the cloud's frame by messages of nav_msgs/Odometry; a topic of these, as
                "/odometry", has them come from it. Without a world there are none, and neither is read for them.
            poses: Give frames their poses, where there is a world.
            recover: If true, a truncated bag yields its whole messages and a warning instead of an error.

        Raises:
            TruncatedFileError: The bag's end is missing; the message has the stamp of the last whole message.
            CorruptFileError: It is no bag.
            InputError: A topic is missing or cannot be guessed, or no image is near any sweep in time.
            PoseError: Nothing connects the world and the cloud's frame, poses of Odometry are no way of a robot, or
                several topics have such poses.
            CalibrationError: There is a world, and topics of static transforms contradict each other.
            ParameterError: `max_offset_s` is negative, or a key of `fields` or `T_camera_lidar` is unknown.
            FileNotFoundError: There is no such file.
            ImportError: The extra `ros` is not installed.
        """
        if not max_offset_s >= 0:
            raise ParameterError(f"max_offset_s: got {max_offset_s!r}, expected 0 or more seconds")
        unknown = sorted(set(fields or {}) - {*READ_FIELDS, TIME})
        if unknown:
            raise ParameterError(f"fields: got {', '.join(unknown)}, expected {', '.join((*READ_FIELDS, TIME))}")
        self.path, self.max_offset_s = Path(path), max_offset_s
        self.recover, self.world = recover, world if poses else None
        self._posed = poses
        self._fields = dict(fields or {})
        self._bag = open_bag(self.path, recover=recover)
        self.topics = choose_topics(self._bag, points_topic, image_topics, info_topics)
        self._given = given_transforms(T_camera_lidar, self.topics.images)
        each = T_camera_lidar.values() if isinstance(T_camera_lidar, Mapping) else [T_camera_lidar]
        self._given_files = tuple(Path(given) for given in each if isinstance(given, str | PathLike))
        self._pair()
        if self.world is not None:
            self._check_world(self.world)

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """True if `path` looks like a bag."""
        return (path.suffix in SUFFIXES and path.is_file()) or (path / "metadata.yaml").is_file()

    def _pair(self) -> None:
        """Read the stamps and keep the sweeps that have an image."""
        points, images, infos = self.topics.points, self.topics.images, self.topics.infos
        messages = read_stamps(self._bag, {points, *images, *infos})
        for topic in (points, *images):
            check_clock(self._bag, messages[topic])
        sweeps = messages[points]
        columns = [nearest_images(self._bag, sweeps, messages[topic], self.max_offset_s) for topic in images]
        kept = [row for row in range(len(sweeps)) if not images or any(column[row] for column in columns)]
        self.unpaired = len(sweeps) - len(kept)
        self._sweeps = [sweeps[row] for row in kept]
        self._images = [[column[row] for column in columns] for row in kept]
        self._infos = {image: messages[info] for image, info in zip(images, infos, strict=True)}
        self.stamps = tuple(sweep.header.stamp_ns / NANOSECONDS for sweep in self._sweeps)
        self.camera_names = tuple(_camera_name(topic) for topic in images)
        stamps = [str(sweep.header.stamp_ns) for sweep in self._sweeps]
        repeated = len(set(stamps)) < len(stamps)
        self.names = tuple(f"{number:06d}" for number in range(len(stamps))) if repeated else tuple(stamps)

    @property
    def why_no_poses(self) -> str:
        """The options that give frames poses, by what the bag has, for messages."""
        if not self._posed:
            return POSES_LEFT_OUT
        options = " or ".join(f"--option world={world}" for world in self.worlds())
        return f"they come with {options}" if options else ""

    def worlds(self) -> list[str]:
        """Return what `world` can be: frames that /tf leads to, the nearest first, and topics of Odometry.

        Raises:
            CorruptFileError: A message cannot be read.
        """
        cloud = plain(self._sweeps[0].header.frame_id)
        static = [message for _, message in self._transforms(STATIC_TRANSFORMS)]
        moving = islice((message for _, message in self._transforms(MOVING_TRANSFORMS)), FIRST_TRANSFORMS)
        fixed, above = (ancestors(cloud, parents(known)) for known in (static, chain(static, moving)))
        return [frame for frame in above if frame not in fixed] + odometry_topics(self._bag)

    @property
    def offsets_s(self) -> NDArray[np.float64]:
        """(frames, cameras) by how much each image is later than its sweep, in seconds; NaN where there is none."""
        offsets = [
            [offset_s(sweep, image) if image else np.nan for image in images]
            for sweep, images in zip(self._sweeps, self._images, strict=True)
        ]
        return np.array(offsets, np.float64).reshape(len(self), len(self.topics.images))

    @property
    def all_topics(self) -> tuple[Topic, ...]:
        """Every topic of the bag, by name."""
        return tuple(topic for _, topic in sorted(self._bag.topics.items()))

    def header(self, index: int) -> Header:
        """Stamp, to the nanosecond, and frame of a sweep, for what is written about it."""
        return self._sweeps[index].header

    def received_ns(self, index: int) -> int:
        """Time of the reception of a sweep, in nanoseconds."""
        return self._sweeps[index].received_ns

    @property
    def storage(self) -> str:
        """The kind of bag: "rosbag1", "rosbag2" (SQLite) or "mcap"."""
        if not self._bag.ros2:
            return "rosbag1"
        return "rosbag2" if any(file.suffix == ".db3" for file in storage_files(self.path)) else "mcap"

    def companions(self) -> tuple[str, ...]:
        """The topics that play beside the clouds: images, their calibrations, transforms and odometry."""
        kinds = (TRANSFORMS, OLD_TRANSFORMS, ODOMETRY)
        moves = [topic.name for topic in self._bag.topics.values() if topic.type in kinds]
        return tuple(dict.fromkeys([*self.topics.images, *self.topics.infos, *moves]))

    def cloud(self, index: int) -> PointCloud:
        """A sweep with all its fields, as ring and time, of which `Frame.points` has x y z and intensity.

        Raises:
            FileFormatError: The message cannot be read.
        """
        with within(self._place(self._sweeps[index])):
            return decode_points(self._message(self._sweeps[index]))

    def files(self, index: int) -> tuple[Path, ...]:
        """The files that a frame is read from: those of the bag, and of transforms that are given."""
        return (*storage_files(self.path), *self._given_files)

    def __getitem__(self, index: int) -> Frame:
        """Read a frame; images are decoded when they are asked for.

        Raises:
            IndexError: There is no such frame.
            FileFormatError: The cloud cannot be read.
            CalibrationError: A camera is not calibrated, nothing connects its frame and the cloud's, or topics of
                static transforms contradict each other.
            PoseError: Transforms or poses of Odometry have a gap then, or jump, or nothing connects the robot's frame
                and the cloud's.
        """
        if not -len(self) <= index < len(self):
            raise IndexError(f"frame {index}: there are {len(self)}")
        sweep, cloud = self._sweeps[index], self.cloud(index)
        with within(self._place(sweep)):
            points, times = cloud.points(self._fields), cloud.times(self._fields.get(TIME))
            pose, trajectory = self._pose(sweep.header), self._trajectory(index, times)
        return Frame(
            name=self.names[index],
            points=points,
            times=times,
            stamp=self.stamps[index],
            pose=pose,
            trajectory=trajectory,
            images=tuple(self._image(image, sweep.header) for image in self._images[index] if image),
        )

    def _pose(self, sweep: Header) -> NDArray[np.float64] | None:
        if self.world is None:
            return None
        odometry = self._odometry_for(sweep)
        if odometry is None:
            return self._tree.pose(self.world, sweep.frame_id, sweep.stamp_ns)
        with within(odometry.topic):
            return odometry.way.at(sweep.stamp_ns / NANOSECONDS) @ self._on_robot(odometry, sweep)

    def _trajectory(self, index: int, times: NDArray[np.float64] | None) -> Trajectory | None:
        """The way of the lidar during a sweep and its images."""
        if self.world is None:
            return None
        sweep = self._sweeps[index].header
        own = np.zeros(1) if times is None else times[np.abs(times) <= LONGEST_S]
        around = [0, *(image.header.stamp_ns - sweep.stamp_ns for image in self._images[index] if image)]
        around += [int(end * NANOSECONDS) for end in (own.min(initial=0), own.max(initial=0))]
        from_ns, to_ns = sweep.stamp_ns + min(around), sweep.stamp_ns + max(around)
        odometry = self._odometry_for(sweep)
        if odometry is None:
            return self._tree.way(self.world, sweep.frame_id, from_ns, to_ns)
        return odometry.way_of(self._on_robot(odometry, sweep), from_ns / NANOSECONDS, to_ns / NANOSECONDS)

    def _check_world(self, world: str) -> None:
        """Refuse a world that the bag does not have, as each frame would."""
        sweep = self._sweeps[0].header
        with within(str(self.path)):
            if self._odometry_for(sweep) is None:
                self._tree.check_world(world, sweep.frame_id)

    def _odometry_for(self, sweep: Header) -> Odometry | None:
        """Odometry where it tells the poses of a sweep; None where transforms do."""
        by_topic = self.world in odometry_topics(self._bag)
        return self._odometry if by_topic or not self._tree.connects(str(self.world), sweep.frame_id) else None

    def _on_robot(self, odometry: Odometry, sweep: Header) -> NDArray[np.float64]:
        """(4, 4) T_robot_lidar."""
        if not self._tree.connects(odometry.robot, sweep.frame_id):
            raise PoseError(
                f"{odometry.topic} has poses of {odometry.robot!r}, which no transforms connect with the lidar's frame "
                f"{sweep.frame_id!r}; choose another world, or give poses of a file"
            )
        return self._tree.pose(odometry.robot, sweep.frame_id, sweep.stamp_ns)

    def _image(self, image: StampedMessage, sweep: Header) -> CameraImage:
        info = nearest(self._infos[image.topic], image.header.stamp_ns)
        message = self._message(info)
        with within(self._place(info)):
            camera = _camera(message, self._transform(image, sweep), rectified="image_rect" in image.topic)
        return CameraImage(
            name=_camera_name(image.topic),
            camera=camera,
            read=partial(self._pixels, image, camera.image_size),
            stamp=image.header.stamp_ns / NANOSECONDS,
        )

    def _transform(self, image: StampedMessage, sweep: Header) -> NDArray[np.float64]:
        if image.topic in self._given:
            return self._given[image.topic]
        return self._tree.lookup(image.header.frame_id, sweep.frame_id, image.header.stamp_ns)

    @cached_property
    def _tree(self) -> TransformTree:
        static = agreeing(self._transforms(STATIC_TRANSFORMS))
        return TransformTree(static, lambda: (message for _, message in self._transforms(MOVING_TRANSFORMS)))

    @cached_property
    def _odometry(self) -> Odometry | None:
        return None if self.world is None else read_odometry(self._bag, self.world)

    def _transforms(self, name: str) -> Iterator[tuple[str, Message]]:
        """The messages of a topic of transforms, with the topic.

        Between two frames the topic counts whose prefix that of the clouds has too, of several the longest, and where
        there is none all others.
        """
        kinds = (TRANSFORMS, OLD_TRANSFORMS)
        topics = [t.name for t in self._bag.topics.values() if t.type in kinds and t.name.endswith(name)]
        own = [topic for topic in topics if self.topics.points.startswith(topic.removesuffix(name) + "/")]
        others = [topic for topic in topics if topic not in own]
        told: dict[tuple[str, str], int] = {}
        for rank, together in enumerate([*([topic] for topic in sorted(own, key=len, reverse=True)), others]):
            for message in self._bag.read_all(together):
                decoded = self._bag.decode(message.topic, message.raw)
                pairs = [(frames_of(one), one) for one in decoded.transforms]
                decoded.transforms = [one for frames, one in pairs if told.setdefault(frames, rank) == rank]
                yield message.topic, decoded

    def _pixels(self, image: StampedMessage, image_size: tuple[int, int] | None) -> NDArray[np.uint8]:
        compressed = self._bag.topics[image.topic].type == COMPRESSED_IMAGE
        with within(self._place(image)):
            pixels = (decode_compressed if compressed else decode_image)(self._message(image))
            if image_size is not None and pixels.shape[:2] != image_size:
                raise CalibrationError(f"image is {pixels.shape[:2]}, its CameraInfo says {image_size}")
        return pixels

    def _message(self, place: StampedMessage) -> Message:
        return self._bag.decode(place.topic, self._bag.read(place.topic, place.received_ns, place.rank))

    def _place(self, message: StampedMessage) -> str:
        return f"{self.path}: {message.topic} at {seconds(message.header.stamp_ns)}"

    def close(self) -> None:
        """Close the bag; frames can no longer be read."""
        self._bag.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __getstate__(self) -> dict[str, object]:
        return {name: value for name, value in self.__dict__.items() if name not in UNPICKLED}

    def __setstate__(self, state: dict[str, object]) -> None:
        self.__dict__.update(state)
        self._bag = open_bag(self.path, recover=self.recover)

    def __repr__(self) -> str:
        return f"RosBag({str(self.path)!r}, {len(self)} frames, {self.topics})"


def has_images(path: Path, *, recover: bool = False) -> bool:
    """True if a bag has a topic of images; errors as of `RosBag`."""
    bag = open_bag(path, recover=recover)
    try:
        return any(topic.type in (IMAGE, COMPRESSED_IMAGE) for topic in bag.topics.values())
    finally:
        bag.close()


def _camera_name(topic: str) -> str:
    return topic.strip("/").replace("/", "_")


def _camera(info: Message, T_camera_lidar: NDArray[np.float64], *, rectified: bool) -> Camera:
    """The camera of a CameraInfo message, by K and D of raw images and by P of rectified ones.

    Transforms of ROS lead to the frame in which P projects points (`image_geometry` does so), which R leads to from the
    camera as it is mounted; so R is left out here.
    """
    names = (name for name in MESSAGE_FIELDS if name not in ("R", "r") and hasattr(info, name))
    return Camera.from_camera_info({name: getattr(info, name) for name in names}, T_camera_lidar, rectified=rectified)
