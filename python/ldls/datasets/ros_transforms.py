"""Transforms from lidar to camera and world: those given by hand, and those of /tf_static and /tf."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ldls.camera.rigid import from_parts, from_quaternion, inverse
from ldls.cloud import Floats
from ldls.errors import CalibrationError, ParameterError, PoseError, within
from ldls.io.cameras.extrinsic_file import Extrinsic, as_extrinsic
from ldls.io.ros.messages import NANOSECONDS, Message, nanoseconds
from ldls.sequences import Trajectory


@dataclass
class _Edge:
    """Transforms from a frame to its parent over time; a static one has a single entry.

    Attributes:
        parent: The parent.
        name: The frames, for messages.
        stamps_ns: The time at which each holds.
        transforms: (4, 4) each, from the frame's to the parent's coordinates.
    """

    parent: str
    name: str
    stamps_ns: list[int] = field(default_factory=list)
    transforms: list[Floats] = field(default_factory=list)

    def at(self, stamp_ns: int) -> Floats:
        """The transform of the nearest time."""
        return self.transforms[int(np.abs(np.array(self.stamps_ns, np.int64) - stamp_ns).argmin())]

    def between(self, stamp_ns: int) -> Floats:
        """The transform between the times before and after; one that never changes holds always.

        Raises:
            PoseError: There is none of that time, or they jump.
        """
        with within(self.name):
            return self.transforms[0] if self._motion is None else self._motion.at(stamp_ns / NANOSECONDS)

    def stamps_between(self, from_ns: int, to_ns: int) -> set[int]:
        """Times of transforms between two moments, and the one before and after; none of those that never change."""
        if self._motion is None:
            return set()
        first, last = np.searchsorted(self._sorted_ns, [from_ns, to_ns + 1]).tolist()
        return set(self._sorted_ns[max(first - 1, 0) : last + 1].tolist())

    @cached_property
    def _sorted_ns(self) -> NDArray[np.int64]:
        return np.unique(np.array(self.stamps_ns, np.int64))

    @cached_property
    def _motion(self) -> Trajectory | None:
        transforms = np.array(self.transforms)
        if (transforms == transforms[0]).all():
            return None
        stamps_ns, first = np.unique(np.array(self.stamps_ns, np.int64), return_index=True)
        return Trajectory(stamps_ns / NANOSECONDS, transforms[first])


class TransformTree:
    """Frames and their parents.

    Moving transforms are read only when static ones do not connect what is asked for.
    """

    def __init__(self, static: Iterable[Message], moving: Callable[[], Iterable[Message]] | None = None) -> None:
        """A tree of the messages of /tf_static, and a function that reads those of /tf."""
        self._edges: dict[str, _Edge] = {}
        self._moving = moving
        self._lock = threading.Lock()
        self._add(static)

    def _add(self, messages: Iterable[Message]) -> None:
        for message in messages:
            for one in message.transforms:
                child, parent = plain(one.child_frame_id), plain(one.header.frame_id)
                edge = self._edges.get(child)
                if edge is None or edge.parent != parent:
                    edge = self._edges[child] = _Edge(parent, f"transforms from {parent} to {child}")
                edge.stamps_ns.append(nanoseconds(one.header.stamp))
                name, transform = f"transforms: from {parent} to {child}", one.transform
                edge.transforms.append(matrix_of(name, transform.rotation, transform.translation))

    def lookup(self, target: str, source: str, stamp_ns: int) -> Floats:
        """(4, 4) from coordinates in the frame `source` to coordinates in `target`, at the nearest times there are.

        Raises:
            CalibrationError: Nothing connects the frames; the message lists those there are.
        """
        target, source = plain(target), plain(source)
        if not self.connects(target, source):
            raise CalibrationError(
                f"transforms: nothing connects the lidar's frame {source!r} and the camera's {target!r}; found "
                f"{self._chains() or 'none'}; pass T_camera_lidar"
            )
        up_source, up_target = (self._to_root(frame, lambda edge: edge.at(stamp_ns)) for frame in (source, target))
        return np.linalg.inv(up_target) @ up_source

    def pose(self, world: str, source: str, stamp_ns: int) -> Floats:
        """(4, 4) from coordinates in the frame `source` to coordinates in `world`, between the times there are.

        Raises:
            PoseError: Nothing connects the frames, or a transform on the way has a gap then, or jumps at any time.
        """
        self.check_world(world, source)
        world, source = plain(world), plain(source)
        up_source, up_world = (self._to_root(frame, lambda edge: edge.between(stamp_ns)) for frame in (source, world))
        return inverse(up_world) @ up_source

    def check_world(self, world: str, source: str) -> None:
        """Refuse a world that nothing connects with the frame `source`.

        Raises:
            PoseError: The message lists the frames there are.
        """
        if not self.connects(world, source):
            raise PoseError(
                f"transforms: nothing connects the lidar's frame {plain(source)!r} and the world {plain(world)!r}; "
                f"found {self._chains() or 'none'}; choose another world"
            )

    def way(self, world: str, source: str, from_ns: int, to_ns: int) -> Trajectory | None:
        """The poses of the frame `source` in `world` between two moments, and the ones beside; None if it stays.

        They are of the times of all transforms on the way. Only what `pose` can tell is in it.

        Raises:
            PoseError: The poses jump.
        """
        # those above both of them cancel out
        names = set(self._ancestors(plain(source))) ^ set(self._ancestors(plain(world)))
        moments = [self._edges[name].stamps_between(from_ns, to_ns) for name in names if name in self._edges]
        stamps, poses = [], []
        for stamp_ns in sorted(set().union(*moments)):
            with suppress(PoseError):
                poses.append(self.pose(world, source, stamp_ns))
                stamps.append(stamp_ns / NANOSECONDS)
        return Trajectory(np.array(stamps), np.array(poses)) if poses else None

    def connects(self, one: str, other: str) -> bool:
        """True for connected frames; moving transforms are read where static ones do not connect them."""
        one, other = plain(one), plain(other)
        with self._lock:  # until all are there, for whoever else asks
            if not self._connected(one, other) and self._moving is not None:
                moving, self._moving = self._moving, None
                self._add(moving())
            return self._connected(one, other)

    def _ancestors(self, frame: str) -> list[str]:
        return ancestors(frame, lambda name: self._edges[name].parent if name in self._edges else None)

    def _connected(self, one: str, other: str) -> bool:
        return one == other or self._ancestors(one)[-1] == self._ancestors(other)[-1]

    def _to_root(self, frame: str, at: Callable[[_Edge], Floats]) -> Floats:
        transform = np.eye(4)
        for name in self._ancestors(frame)[:-1]:
            transform = at(self._edges[name]) @ transform
        return transform

    def _chains(self) -> str:
        """Every frame that is no parent, and the way up from it."""
        parents = {edge.parent for edge in self._edges.values()}
        chains = [" <- ".join(reversed(self._ancestors(frame))) for frame in sorted(self._edges.keys() - parents)]
        return "; ".join(chains)


def ancestors(frame: str, parent_of: Callable[[str], str | None]) -> list[str]:
    """A frame and those above it, the nearest first."""
    chain = [frame]
    while (parent := parent_of(chain[-1])) is not None and parent not in chain:
        chain.append(parent)
    return chain


def parents(messages: Iterable[Message]) -> dict[str, str]:
    """The parent of each frame that transforms name, whatever else they say."""
    return {plain(one.child_frame_id): plain(one.header.frame_id) for each in messages for one in each.transforms}


def plain(frame_id: str) -> str:
    """The name without the slash that ROS 1 once put before it."""
    return frame_id.removeprefix("/")


def matrix_of(name: str, q: Message, t: Message) -> Floats:
    """(4, 4) of a unit quaternion and a translation in metres; errors as of `from_quaternion`."""
    rotation = from_quaternion(name, np.array([q.w, q.x, q.y, q.z], np.float64))
    return from_parts(rotation, np.array([t.x, t.y, t.z], np.float64))


def given_transforms(
    given: Extrinsic | Mapping[str, Extrinsic] | None, image_topics: Sequence[str]
) -> dict[str, Floats]:
    """(4, 4) from lidar to camera coordinates by image topic, for those that are given.

    Args:
        given: Arrays (4, 4) or files, as `ldls.read_camera` takes them; one for the only camera, or a mapping from
            image topic.
        image_topics: The image topics.

    Raises:
        ParameterError: A topic is none of the image topics, or there are several cameras for one transform.
        CalibrationError: It is no transform.
        FileNotFoundError: There is no such file.
    """
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        if len(image_topics) > 1:
            raise ParameterError(f"T_camera_lidar: there are {len(image_topics)} cameras; pass a mapping from topic")
        given = dict.fromkeys(image_topics, given)
    unknown = sorted(set(given) - set(image_topics))
    if unknown:
        raise ParameterError(f"T_camera_lidar: {', '.join(unknown)} is none of {', '.join(image_topics)}")
    return {topic: as_extrinsic(one, f"T_camera_lidar of {topic}") for topic, one in given.items()}
