"""Messages of a bag by the stamps in their headers, and the images nearest to each sweep."""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from ldls.errors import InputError
from ldls.io.ros.bags import Bag
from ldls.io.ros.messages import NANOSECONDS, Header, read_header, seconds


@dataclass(frozen=True)
class StampedMessage:
    """Header and place of a message in a bag.

    Attributes:
        topic: Name of its topic.
        header: Its header.
        received_ns: Time of its reception, in nanoseconds.
        rank: Its number among those of the topic received at that moment.
    """

    topic: str
    header: Header
    received_ns: int
    rank: int


def read_stamps(bag: Bag, topics: Collection[str]) -> dict[str, list[StampedMessage]]:
    """The messages of each topic in the order of their stamps; nothing but headers is decoded.

    Raises:
        InputError: A topic has no messages.
    """
    messages: dict[str, list[StampedMessage]] = {topic: [] for topic in topics}
    ranks: Counter[tuple[str, int]] = Counter()
    for message in bag.messages(topics):
        place = (message.topic, message.received_ns)
        header = read_header(message.raw, ros2=bag.ros2)
        messages[message.topic].append(StampedMessage(message.topic, header, message.received_ns, ranks[place]))
        ranks[place] += 1
    for topic, stamped in messages.items():
        if not stamped:
            raise InputError(f"{bag.path}: {topic} has no messages; choose another topic")
        stamped.sort(key=lambda one: one.header.stamp_ns)
    return messages


def check_clock(bag: Bag, messages: Sequence[StampedMessage]) -> None:
    """Refuse messages of a topic that cannot be paired by their stamps.

    Raises:
        InputError: The clock stood still.
    """
    stamp_ns = messages[0].header.stamp_ns
    if len(messages) > 1 and all(message.header.stamp_ns == stamp_ns for message in messages):
        raise InputError(
            f"{bag.path}: all {len(messages)} messages of {messages[0].topic} have the stamp {seconds(stamp_ns)}, so "
            "they cannot be paired; set the stamps in their headers"
        )


def nearest_images(
    bag: Bag, sweeps: Sequence[StampedMessage], images: Sequence[StampedMessage], max_offset_s: float
) -> list[StampedMessage | None]:
    """The image nearest in time to each sweep; None where it is farther away than the tolerance.

    Raises:
        InputError: No image is near any sweep.
    """
    nearest_ones = [nearest(images, sweep.header.stamp_ns) for sweep in sweeps]
    offsets_s = [offset_s(sweep, image) for sweep, image in zip(sweeps, nearest_ones, strict=True)]
    closest_s = min(offsets_s, key=abs)
    if not abs(closest_s) <= max_offset_s:
        raise InputError(
            f"{bag.path}: no image of {images[0].topic} is within {max_offset_s} s of a cloud of {sweeps[0].topic}; "
            f"the nearest is {closest_s:+.6f} s off, stamps run from {seconds(sweeps[0].header.stamp_ns)} and from "
            f"{seconds(images[0].header.stamp_ns)}; pass max_offset_s="
        )
    return [
        image if abs(offset) <= max_offset_s else None for image, offset in zip(nearest_ones, offsets_s, strict=True)
    ]


def nearest(messages: Sequence[StampedMessage], stamp_ns: int) -> StampedMessage:
    """The message nearest to a stamp, of those in the order of their stamps; of two equally near ones the earlier."""
    after = bisect_left(messages, stamp_ns, key=lambda message: message.header.stamp_ns)
    around = messages[max(after - 1, 0) : after + 1]
    return min(around, key=lambda message: abs(message.header.stamp_ns - stamp_ns))


def offset_s(sweep: StampedMessage, image: StampedMessage) -> float:
    """Time from sweep to image, in seconds."""
    return (image.header.stamp_ns - sweep.header.stamp_ns) / NANOSECONDS
