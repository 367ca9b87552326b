"""Labelled clouds as ROS bags that play in any viewer."""

from __future__ import annotations

from collections.abc import Collection
from itertools import chain
from os import PathLike
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ldls.errors import LimitError, UnsupportedFormatError
from ldls.io.labelled_points import instances, packed_colors, positions
from ldls.io.ros.bags import open_bag
from ldls.io.ros.messages import POINTS, Header, Topic
from ldls.io.ros.point_cloud2 import encode
from ldls.io.ros.writer import BagWriter
from ldls.segmentation import Segmentation

HIGHEST_CLASS = 255
TOPIC = "/points_labelled"


class LabelledBag(BagWriter):
    """A bag to write labelled clouds to; it appears under its name only when it is whole.

    Each cloud is a PointCloud2 message with all its points in their order and the fields x, y, z (float32, metres),
    intensity (float32), instance_id (uint32: 0 for background and out of view, m for instance m of the result),
    class_id (uint8: the category id, COCO's with COCO's masks; 0 for none), probability (float32: the confidence) and
    rgb (float32 whose bits are 0x00RRGGBB, as viewers expect). They are on /points_labelled.

    Args:
        path: A file for ROS 1, a folder for ROS 2.
        kind: "rosbag1", "rosbag2" (SQLite) or "mcap".

    Raises:
        ParameterError: There is no such kind.
        FileExistsError: There is something at `path` already.
        ImportError: The extra `ros` is not installed.

    Examples:
        >>> source = RosBag("drive.bag")  # doctest: +SKIP
        >>> with LabelledBag("labelled.bag", "rosbag1") as bag:  # doctest: +SKIP
        ...     bag.copy(source.path)
        ...     for index, frame in enumerate(source):
        ...         bag.write(ldls.segment(frame.points, masks[index], camera), source.header(index))
    """

    def __enter__(self) -> Self:
        super().__enter__()
        self.add_topic(Topic(TOPIC, POINTS, 0))
        return self

    def write(self, result: Segmentation, header: Header, *, received_ns: int | None = None) -> None:
        """Write the labelled points of `result`, with the header of the cloud that they are of.

        Args:
            result: Labels of the points.
            header: Stamp and frame of the cloud, as `RosBag.header` gives them.
            received_ns: Time at which a player shall send it, in nanoseconds; its stamp by default.

        Raises:
            LimitError: A category id is beyond 255.
        """
        message = encode(self.types, labelled_columns(result), header)
        self.write_message(TOPIC, message, header.stamp_ns if received_ns is None else received_ns)

    def copy(
        self,
        path: str | PathLike[str],
        *,
        topics: Collection[str] | None = None,
        recover: bool = False,
        span_ns: tuple[int, int] | None = None,
    ) -> None:
        """Copy topics of another bag, all by default, so that images and transforms play beside the labels.

        Args:
            path: The bag to copy from, of the same version of ROS.
            topics: Names of the topics.
            recover: As in `RosBag`.
            span_ns: First and last time of reception, in nanoseconds, of what is copied, save of latched topics.

        Raises:
            UnsupportedFormatError: The bag is of the other version of ROS.
            InputError: A topic has the name of the labelled clouds.
        """
        source = open_bag(Path(path), recover=recover)
        try:
            if source.ros2 != self.ros2:
                raise UnsupportedFormatError(
                    f"{path}: a bag of ROS {1 + source.ros2} cannot be copied into one of ROS {1 + self.ros2}; "
                    "choose another kind, or convert it with rosbags-convert"
                )
            chosen = [name for name in source.topics if topics is None or name in topics]
            for name in chosen:
                self.add_topic(source.topics[name], source.types)
            whole = [name for name in chosen if span_ns is None or source.topics[name].latched]
            parts = [name for name in chosen if name not in whole]
            start_ns, stop_ns = (None, None) if span_ns is None else (span_ns[0], span_ns[1] + 1)
            for message in chain(source.messages(whole), source.messages(parts, start_ns, stop_ns)):
                self.write_raw(message.topic, message.raw, message.received_ns)
        finally:
            source.close()


def labelled_columns(result: Segmentation) -> dict[str, NDArray[Any]]:
    """The fields of a labelled cloud, (N,) each.

    Raises:
        LimitError: A category id is beyond 255.
    """
    categories = result.categories
    if categories.size and categories.max() > HIGHEST_CLASS:
        raise LimitError(f"class_id: category {categories.max()} is beyond the {HIGHEST_CLASS} that a byte holds")
    columns: dict[str, NDArray[Any]] = {name: each.astype(np.float32) for name, each in positions(result).items()}
    columns.setdefault("intensity", np.zeros(len(categories), np.float32))
    return columns | {
        "instance_id": instances(result),
        "class_id": categories.astype(np.uint8),
        "probability": result.confidence,
        "rgb": packed_colors(result),
    }
