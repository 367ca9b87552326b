"""Frames of a bag are read by several threads at once, the first of which look for the transforms."""

import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

pytest.importorskip("rosbags")

from datasets.ros_samples import Recording
from ldls.datasets import RosBag


@pytest.fixture
def eager():
    """Threads that take turns as often as they can."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def test_transforms_are_read_while_no_other_thread_reads(tmp_path):
    with RosBag(Recording(kind="mcap", sweeps=2).write(tmp_path / "drive")) as bag:
        opened = bag._bag
        read, topics_read = opened._read, []

        def watched(topics, *span):
            assert opened._lock.locked()
            topics_read.extend(topics)
            return read(topics, *span)

        opened._read = watched
        bag[0]
    assert any(topic.startswith("/tf") for topic in topics_read)


@pytest.mark.parametrize("kind", ["rosbag1", "rosbag2", "mcap"])
def test_threads_read_what_one_reads(tmp_path, eager, kind):
    path = Recording(kind=kind, sweeps=6).write(tmp_path / ("drive.bag" if kind == "rosbag1" else "drive"))
    with RosBag(path) as alone:
        expected = [(frame.points, frame.images[0].camera.T_camera_lidar) for frame in alone]
    for _ in range(10):
        with RosBag(path) as bag, ThreadPoolExecutor(4) as threads:
            frames = list(threads.map(bag.__getitem__, range(len(bag))))
        for frame, (points, transform) in zip(frames, expected, strict=True):
            np.testing.assert_array_equal(frame.points, points)
            np.testing.assert_array_equal(frame.images[0].camera.T_camera_lidar, transform)
