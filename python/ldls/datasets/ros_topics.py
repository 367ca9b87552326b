"""The topics of a bag that are read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ldls.errors import InputError
from ldls.io.ros.bags import Bag
from ldls.io.ros.messages import CAMERA_INFO, COMPRESSED_IMAGE, IMAGE, POINTS


@dataclass(frozen=True)
class RosTopics:
    """The topics that make frames.

    Attributes:
        points: Topic of the clouds.
        images: Topic of the images of each camera.
        infos: Topic of the CameraInfo of each camera.
    """

    points: str
    images: tuple[str, ...]
    infos: tuple[str, ...]


def choose_topics(
    bag: Bag, points: str | None, images: str | Sequence[str] | None, infos: str | Sequence[str] | None
) -> RosTopics:
    """The topics given, and for those that are not given the only ones there are.

    Raises:
        InputError: A topic is not in the bag or of another type, or there is none or several to guess from; the
            message lists all there are.
    """
    chosen_points = _one(bag, "points_topic", points, (POINTS,))
    if images is None:
        images = (_one(bag, "image_topics", None, (IMAGE, COMPRESSED_IMAGE)),)
    chosen_images = tuple(_one(bag, "image_topics", topic, (IMAGE, COMPRESSED_IMAGE)) for topic in _several(images))
    if infos is None:
        infos = [_info_beside(bag, topic) for topic in chosen_images]
    infos = _several(infos)
    if len(infos) != len(chosen_images):
        raise InputError(f"info_topics: got {len(infos)}, expected {len(chosen_images)}, one an image topic")
    return RosTopics(
        chosen_points, chosen_images, tuple(_one(bag, "info_topics", topic, (CAMERA_INFO,)) for topic in infos)
    )


def _several(topics: str | Sequence[str]) -> Sequence[str]:
    return (topics,) if isinstance(topics, str) else topics


def _info_beside(bag: Bag, image_topic: str) -> str:
    """The CameraInfo topic in the namespace of an image topic, or in the nearest around it; else the only one."""
    space = image_topic
    while "/" in space:
        space = space.rpartition("/")[0]
        if f"{space}/camera_info" in bag.topics:
            return f"{space}/camera_info"
    return _one(bag, "info_topics", None, (CAMERA_INFO,))


def _one(bag: Bag, option: str, given: str | None, types: tuple[str, ...]) -> str:
    fitting = [topic.name for topic in bag.topics.values() if topic.type in types]
    expected = " or ".join(kind.rpartition("/")[2] for kind in types)
    if given is not None:
        if given in fitting:
            return given
        kind = bag.topics[given].type if given in bag.topics else "no such topic"
        raise InputError(f"{bag.path}: {option}: {given!r} is {kind}, expected {expected}; {_listed(bag)}")
    if len(fitting) == 1:
        return fitting[0]
    mend = f"; choose by {option}, as --option {option}={fitting[0]}" if fitting else ""
    raise InputError(
        f"{bag.path}: {option}: {len(fitting) or 'no'} topics of {expected}, so none is guessed{mend}; {_listed(bag)}"
    )


def _listed(bag: Bag) -> str:
    rows = (f"{name} ({topic.type}, {topic.count})" for name, topic in sorted(bag.topics.items()))
    return "the bag has " + (", ".join(rows) or "no topics")
