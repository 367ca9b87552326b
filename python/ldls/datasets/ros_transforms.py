"""Transforms from lidar to camera and world: those given by hand, and those of /tf_static and /tf."""

from __future__ import annotations

import threading
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
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

SAME = 1e-6
"""Largest difference between numbers, metres or of a rotation, of two transforms that are the same."""


@dataclass
class _Edge:
    """Transforms from a frame to its parent over time; a static one has a single entry.

    Attributes:
        name: The frames, for messages.
        stamps_ns: The time at which each holds.
        transforms: (4, 4) each, from the frame's to the parent's coordinates.
    """

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
    """Frames and the transforms between them.

    Moving transforms are read only when static ones do not connect what is asked for. A frame may have several parents,
    as where two odometries run: of all ways from frame to frame the one of fewest transforms counts, and no others.
    """

    def __init__(self, static: Iterable[Message], moving: Callable[[], Iterable[Message]] | None = None) -> None:
        """A tree of the messages of /tf_static, and a function that reads those of /tf."""
        self._edges: dict[tuple[str, str], _Edge] = {}  # by child and parent
        self._beside: defaultdict[str, list[str]] = defaultdict(list)
        self._moving = moving
        self._lock = threading.Lock()
        self._add(static)

    def _add(self, messages: Iterable[Message]) -> None:
        for message in messages:
            for one in message.transforms:
                child, parent, transform = _parts(one)
                edge = self._edges.get((child, parent))
                if edge is None:
                    edge = self._edges[child, parent] = _Edge(f"transforms from {parent} to {child}")
                    self._beside[child].append(parent)
                    self._beside[parent].append(child)
                edge.stamps_ns.append(nanoseconds(one.header.stamp))
                edge.transforms.append(transform)

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
        return self._along(source, target, lambda edge: edge.at(stamp_ns))

    def pose(self, world: str, source: str, stamp_ns: int) -> Floats:
        """(4, 4) from coordinates in the frame `source` to coordinates in `world`, between the times there are.

        Raises:
            PoseError: Nothing connects the frames, or a transform on the way has a gap then, or jumps at any time.
        """
        self.check_world(world, source)
        return self._along(plain(source), plain(world), lambda edge: edge.between(stamp_ns))

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
        moments = [edge.stamps_between(from_ns, to_ns) for edge, _ in self._path(plain(source), plain(world)) or ()]
        stamps, poses = [], []
        for stamp_ns in sorted(set().union(*moments)):
            with suppress(PoseError):
                poses.append(self.pose(world, source, stamp_ns))
                stamps.append(stamp_ns / NANOSECONDS)
        return Trajectory(np.array(stamps), np.array(poses)) if poses else None

    def connects(self, one: str, other: str) -> bool:
        """True for connected frames; moving transforms are read where static ones do not connect them."""
        return self._path(plain(one), plain(other)) is not None

    def _path(self, source: str, target: str) -> list[tuple[_Edge, bool]] | None:
        """The transforms on the way from one frame to another, and True for each that leads from child to parent."""
        with self._lock:  # until all are there, for whoever else asks
            path = self._shortest(source, target)
            if path is None and self._moving is not None:
                moving, self._moving = self._moving, None
                self._add(moving())
                path = self._shortest(source, target)
            return path

    def _shortest(self, source: str, target: str) -> list[tuple[_Edge, bool]] | None:
        after = {target: target}
        frames = [target]
        for frame in frames:
            new = [other for other in self._beside.get(frame, ()) if other not in after]
            after |= dict.fromkeys(new, frame)
            frames += new
        if source not in after:
            return None
        path = []
        while source != target:
            up = self._edges.get((source, after[source]))
            path.append((up or self._edges[after[source], source], up is not None))
            source = after[source]
        return path

    def _along(self, source: str, target: str, at: Callable[[_Edge], Floats]) -> Floats:
        transform = np.eye(4)
        for edge, up in self._path(source, target) or ():
            transform = (at(edge) if up else inverse(at(edge))) @ transform
        return transform

    def _chains(self) -> str:
        """Every frame that is no parent, and the way up from it; then further parents."""
        first = {child: [parent] for child, parent in reversed(self._edges)}
        chains = [ancestors(frame, first) for frame in sorted(first.keys() - {parent for _, parent in self._edges})]
        chains += [[child, parent] for child, parent in self._edges if parent not in first[child]]
        return "; ".join(" <- ".join(reversed(chain)) for chain in chains)


def agreeing(messages: Iterable[tuple[str, Message]]) -> Iterator[Message]:
    """The messages of topics of static transforms, given with their topic.

    Raises:
        CalibrationError: Two topics contradict each other.
    """
    told: dict[tuple[str, str], tuple[str, Floats]] = {}
    for topic, message in messages:
        for one in message.transforms:
            child, parent, transform = _parts(one)
            other, before = told.setdefault((child, parent), (topic, transform))
            if other != topic and not np.allclose(before, transform, rtol=0, atol=SAME):
                raise CalibrationError(
                    f"transforms: {other} and {topic} differ in that from {parent} to {child}, and the topic of the "
                    "clouds has the prefix of neither; leave the topic of the other robot out of the bag, or pass "
                    "T_camera_lidar and no world"
                )
        yield message


def ancestors(frame: str, parents_of: Mapping[str, Iterable[str]]) -> list[str]:
    """A frame and those above it, the nearest first."""
    found = [frame]
    for each in found:
        found += [parent for parent in parents_of.get(each, ()) if parent not in found]
    return found


def parents(messages: Iterable[Message]) -> dict[str, list[str]]:
    """The parents of each frame that transforms name, whatever else they say."""
    found: dict[str, list[str]] = {}
    for child, parent in dict.fromkeys(frames_of(one) for each in messages for one in each.transforms):
        found.setdefault(child, []).append(parent)
    return found


def frames_of(one: Message) -> tuple[str, str]:
    """Child and parent of a TransformStamped."""
    return plain(one.child_frame_id), plain(one.header.frame_id)


def _parts(one: Message) -> tuple[str, str, Floats]:
    """Child, parent and (4, 4) of a TransformStamped."""
    child, parent = frames_of(one)
    name = f"transforms: from {parent} to {child}"
    return child, parent, matrix_of(name, one.transform.rotation, one.transform.translation)


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
