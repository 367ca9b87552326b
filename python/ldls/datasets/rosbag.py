"""ROS bags as sources of frames: a cloud, the images taken nearest to it, their cameras."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from os import PathLike
from pathlib import Path
from threading import Lock
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ldls.datasets.frame import CameraImage, Frame
from ldls.datasets.pairing import NONE, nearest
from ldls.datasets.ros_cameras import camera_of
from ldls.datasets.ros_topics import RosTopics, choose_topics
from ldls.datasets.ros_transforms import TransformTree
from ldls.datasets.transform_files import read_transform
from ldls.errors import CalibrationError, FileFormatError, InputError, ParameterError
from ldls.io.ros.bags import SUFFIXES, open_bag, storage_files
from ldls.io.ros.images import decode_compressed, decode_image
from ldls.io.ros.messages import COMPRESSED_IMAGE, NANOSECONDS, OLD_TRANSFORMS, TRANSFORMS, Header, read_header, seconds
from ldls.io.ros.point_cloud2 import READ_FIELDS, PointCloud
from ldls.io.ros.point_cloud2 import decode as decode_points

STATIC_TRANSFORMS, MOVING_TRANSFORMS = "/tf_static", "/tf"
GivenTransform = ArrayLike | str | PathLike[str]


@dataclass(frozen=True)
class _Entry:
    """Where a message is: its topic, when it was received, and its number among those of that moment."""

    topic: str
    header: Header
    received_ns: int
    rank: int


class RosBag:
    """The sweeps of a ROS bag with the images nearest to them in time.

    Opening reads the stamps of clouds, images and calibrations and decodes none of them; a frame decodes its own
    messages, and images only when they are asked for. Sweeps and images are paired by the stamps in their headers. A
    sweep with no image within the tolerance is no frame; `unpaired` counts them.

    Coordinates are those of the cloud's frame, cameras those of the image's, which is optical in ROS (x right, y down,
    z forward). Transforms between the two come from /tf_static, or where that does not connect them from /tf at the
    time nearest to the image; a robot's motion between sweep and image is not made up for.

    Attributes:
        kind: "rosbag".
        path: The bag.
        names: Stamp of each sweep in nanoseconds; running numbers of six digits where stamps repeat themselves.
        topics: The topics that are read.
        max_offset_s: The tolerance.
        unpaired: How many sweeps have no image within the tolerance.
    """

    kind = "rosbag"
    looks_for = "a .bag, .db3 or .mcap file, or a folder with the metadata.yaml of ROS 2"

    def __init__(
        self,
        path: str | PathLike[str],
        *,
        points_topic: str | None = None,
        image_topics: Sequence[str] | None = None,
        info_topics: Sequence[str] | None = None,
        max_offset_s: float = 0.05,
        T_camera_lidar: GivenTransform | Mapping[str, GivenTransform] | None = None,
        fields: Mapping[str, str] | None = None,
        recover: bool = False,
    ) -> None:
        """Open a bag and pair its stamps.

        Args:
            path: A ROS 1 `.bag`, a ROS 2 folder with metadata.yaml, or a bare `.db3` or `.mcap`.
            points_topic: Topic of the clouds (PointCloud2); the only one there is by default.
            image_topics: Topics of the images (Image or CompressedImage), one a camera; the only one there is by
                default, and () for clouds alone. Names with "image_rect" are those of rectified images.
            info_topics: Topic of the CameraInfo of each image topic; the one beside it by default.
            max_offset_s: How far stamps of sweep and image may be apart, in seconds.
            T_camera_lidar: (4, 4) from lidar to camera coordinates, or a text file of its 12 or 16 numbers, instead of
                the bag's transforms; a mapping from image topic to either for several cameras.
            fields: What the clouds call x, y, z and intensity, where it is not that.
            recover: Whether a truncated bag yields its whole messages and a warning instead of an error.

        Raises:
            TruncatedFileError: The bag's end is missing; the message has the stamp of the last whole message.
            CorruptFileError: It is no bag.
            InputError: A topic is missing or cannot be guessed, or no image is near any sweep in time.
            ParameterError: `max_offset_s` is negative, or a key of `fields` or `T_camera_lidar` is unknown.
            FileNotFoundError: There is no such file.
            ImportError: The extra `ros` is not installed.
        """
        if not max_offset_s >= 0:
            raise ParameterError(f"max_offset_s: got {max_offset_s!r}, expected 0 or more seconds")
        unknown = sorted(set(fields or {}) - set(READ_FIELDS))
        if unknown:
            raise ParameterError(f"fields: got {', '.join(unknown)}, expected {', '.join(READ_FIELDS)}")
        self.path = Path(path)
        self.max_offset_s = max_offset_s
        self._recover = recover
        self._fields = dict(fields or {})
        self._bag = open_bag(self.path, recover=recover)
        self.topics = choose_topics(self._bag, points_topic, image_topics, info_topics)
        self._given = _given_transforms(T_camera_lidar, self.topics)
        entries = self._index()
        self._infos = [_some(self.path, topic, entries[topic]) for topic in self.topics.infos]
        self._pair(entries[self.topics.points], [entries[topic] for topic in self.topics.images])
        self._tree: TransformTree | None = None
        self._reading = Lock()

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Whether `path` looks like a bag."""
        return (path.suffix in SUFFIXES and path.is_file()) or (path / "metadata.yaml").is_file()

    def _index(self) -> dict[str, list[_Entry]]:
        """Headers of the messages of every topic that is read, in the order of their stamps."""
        wanted = {self.topics.points, *self.topics.images, *self.topics.infos}
        found: dict[str, list[_Entry]] = {topic: [] for topic in wanted}
        ranks: dict[tuple[str, int], int] = {}
        for message in self._bag.messages(wanted):
            at = (message.topic, message.received_ns)
            ranks[at] = ranks.get(at, -1) + 1
            header = read_header(message.raw, ros2=self._bag.ros2)
            found[message.topic].append(_Entry(message.topic, header, message.received_ns, ranks[at]))
        return {topic: sorted(entries, key=lambda e: e.header.stamp_ns) for topic, entries in found.items()}

    def _pair(self, sweeps: list[_Entry], images: list[list[_Entry]]) -> None:
        stamps = _stamps(self.path, self.topics.points, sweeps)
        chosen = np.empty((len(sweeps), len(images)), np.int64)
        offsets = np.full(chosen.shape, np.nan)
        for column, entries in enumerate(images):
            topic = self.topics.images[column]
            others = _stamps(self.path, topic, entries)
            rows = nearest(stamps, others)
            offset = (others[rows] - stamps) / NANOSECONDS
            near = np.abs(offset) <= self.max_offset_s
            if not near.any():
                raise InputError(
                    f"{self.path}: no image of {topic} is within {self.max_offset_s} s of a cloud of "
                    f"{self.topics.points}; the nearest is {offset[np.abs(offset).argmin()]:+.6f} s off, stamps run "
                    f"from {seconds(int(stamps[0]))} and from {seconds(int(others[0]))}; pass max_offset_s="
                )
            chosen[:, column], offsets[near, column] = np.where(near, rows, NONE), offset[near]
        kept = np.flatnonzero((chosen != NONE).any(axis=1) if images else np.ones(len(sweeps), bool))
        self.unpaired = len(sweeps) - len(kept)
        self._offsets_s = offsets[kept]
        self._sweeps = [sweeps[row] for row in kept.tolist()]
        self._images = [
            [
                entries[index] if index != NONE else None
                for entries, index in zip(images, chosen[row].tolist(), strict=True)
            ]
            for row in kept.tolist()
        ]
        self.names = _names(stamps[kept])

    @property
    def offsets_s(self) -> NDArray[np.float64]:
        """(frames, cameras) by how much each image is later than its sweep, in seconds; NaN where there is none."""
        return self._offsets_s.copy()

    def __len__(self) -> int:
        """Number of frames."""
        return len(self._sweeps)

    def __iter__(self) -> Iterator[Frame]:
        return (self[index] for index in range(len(self)))

    def header(self, index: int) -> Header:
        """Stamp, to the nanosecond, and frame of a sweep, for what is written about it."""
        return self._sweeps[index].header

    def cloud(self, index: int) -> PointCloud:
        """A sweep with all its fields, as ring and time, of which `Frame.points` has x y z and intensity.

        Raises:
            FileFormatError: The message cannot be read.
        """
        sweep = self._sweeps[index]
        try:
            return decode_points(self._message(sweep))
        except FileFormatError as error:
            raise type(error)(self._place(sweep, error)) from None

    @property
    def camera_names(self) -> tuple[str, ...]:
        """Name of the camera of each image of a frame: its topic, fit for a file name."""
        return tuple(_camera_name(topic) for topic in self.topics.images)

    @property
    def stamps(self) -> tuple[float, ...]:
        """Times of the sweeps in seconds."""
        return tuple(sweep.header.stamp_ns / NANOSECONDS for sweep in self._sweeps)

    def files(self, index: int) -> tuple[Path, ...]:
        """The files that a frame is read from: those of the bag."""
        return tuple(storage_files(self.path))

    def __getitem__(self, index: int) -> Frame:
        """Read a frame; images are decoded when they are asked for.

        Raises:
            IndexError: There is no such frame.
            FileFormatError: The cloud cannot be read.
            CalibrationError: A camera is not calibrated, or nothing connects its frame and the cloud's.
        """
        if not -len(self) <= index < len(self):
            raise IndexError(f"frame {index}: there are {len(self)}")
        sweep = self._sweeps[index]
        try:
            points = self.cloud(index).points(self._fields)
        except FileFormatError as error:
            raise type(error)(self._place(sweep, error)) from None
        images = tuple(
            self._image(camera, entry, sweep.header)
            for camera, entry in enumerate(self._images[index])
            if entry is not None
        )
        return Frame(name=self.names[index], points=points, stamp=sweep.header.stamp_ns / NANOSECONDS, images=images)

    def _image(self, camera: int, entry: _Entry, sweep: Header) -> CameraImage:
        topic = self.topics.images[camera]
        infos = self._infos[camera]
        stamps = np.array([info.header.stamp_ns for info in infos], np.int64)
        info = infos[int(nearest(np.array([entry.header.stamp_ns]), stamps)[0])]
        try:
            transform = self._transform(topic, sweep, entry.header)
            model = camera_of(self._message(info), transform, "image_rect" in topic)
        except CalibrationError as error:
            raise CalibrationError(self._place(info, error)) from None
        return CameraImage(
            name=_camera_name(topic),
            camera=model,
            read=partial(self._pixels, entry, model.image_size),
            stamp=entry.header.stamp_ns / NANOSECONDS,
        )

    def _transform(self, topic: str, sweep: Header, image: Header) -> NDArray[np.float64]:
        if topic in self._given:
            return self._given[topic]
        if self._tree is None:
            self._tree = TransformTree(
                self._transforms(STATIC_TRANSFORMS), partial(self._transforms, MOVING_TRANSFORMS)
            )
        return self._tree.lookup(image.frame_id, sweep.frame_id, image.stamp_ns)

    def _transforms(self, name: str) -> Iterator[Any]:
        """The messages of a topic of transforms, under any robot's prefix."""
        kinds = (TRANSFORMS, OLD_TRANSFORMS)
        topics = [t.name for t in self._bag.topics.values() if t.type in kinds and t.name.endswith(name)]
        for message in self._bag.messages(topics):
            yield self._bag.decode(message.topic, message.raw)

    def _pixels(self, entry: _Entry, image_size: tuple[int, int] | None) -> NDArray[np.uint8]:
        compressed = self._bag.topics[entry.topic].type == COMPRESSED_IMAGE
        try:
            message = self._message(entry)
            pixels = decode_compressed(message) if compressed else decode_image(message)
        except FileFormatError as error:
            raise type(error)(self._place(entry, error)) from None
        if image_size is not None and pixels.shape[:2] != image_size:
            raise CalibrationError(self._place(entry, f"image is {pixels.shape[:2]}, its CameraInfo says {image_size}"))
        return pixels

    def _message(self, entry: _Entry) -> Any:  # noqa: ANN401
        with self._reading:  # readers of bags seek in one file
            content = self._bag.read(entry.topic, entry.received_ns, entry.rank)
        return self._bag.decode(entry.topic, content)

    def _place(self, entry: _Entry, error: object) -> str:
        return f"{self.path}: {entry.topic} at {seconds(entry.header.stamp_ns)}: {error}"

    def close(self) -> None:
        """Close the bag; frames can no longer be read."""
        self._bag.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __getstate__(self) -> dict[str, object]:
        return {name: value for name, value in self.__dict__.items() if name not in ("_bag", "_tree", "_reading")}

    def __setstate__(self, state: dict[str, object]) -> None:
        self.__dict__.update(state)
        self._tree = None
        self._reading = Lock()
        self._bag = open_bag(self.path, recover=self._recover)

    def __repr__(self) -> str:
        return f"RosBag({str(self.path)!r}, {len(self)} frames, {self.topics})"


def _camera_name(topic: str) -> str:
    return topic.strip("/").replace("/", "_")


def _some(path: Path, topic: str, entries: list[_Entry]) -> list[_Entry]:
    if not entries:
        raise InputError(f"{path}: {topic} has no messages; choose another topic")
    return entries


def _stamps(path: Path, topic: str, entries: list[_Entry]) -> NDArray[np.int64]:
    """(n,) stamps of the messages of a topic, in nanoseconds.

    Raises:
        InputError: There are none, or a clock stood still.
    """
    stamps = np.array([entry.header.stamp_ns for entry in _some(path, topic, entries)], np.int64)
    if len(stamps) > 1 and (stamps == stamps[0]).all():
        raise InputError(
            f"{path}: all {len(stamps)} messages of {topic} have the stamp {seconds(int(stamps[0]))}, so they cannot "
            "be paired; set the stamps in their headers"
        )
    return stamps


def _names(stamps: NDArray[np.int64]) -> tuple[str, ...]:
    if len(np.unique(stamps)) == len(stamps):
        return tuple(str(stamp) for stamp in stamps.tolist())
    return tuple(f"{number:06d}" for number in range(len(stamps)))


def _given_transforms(
    given: GivenTransform | Mapping[str, GivenTransform] | None, topics: RosTopics
) -> dict[str, NDArray[np.float64]]:
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        if len(topics.images) > 1:
            raise ParameterError(f"T_camera_lidar: there are {len(topics.images)} cameras; pass a mapping from topic")
        given = dict.fromkeys(topics.images, given)
    unknown = sorted(set(given) - set(topics.images))
    if unknown:
        raise ParameterError(f"T_camera_lidar: {', '.join(unknown)} is none of {', '.join(topics.images)}")
    return {topic: read_transform(one) for topic, one in given.items()}
