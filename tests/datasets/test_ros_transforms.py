"""Chains of transforms."""

import time
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest

from ldls.datasets.ros_transforms import TransformTree
from ldls.errors import CalibrationError, PoseError

QUARTER = (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))
"""A quarter turn to the left about z."""


def edge(parent, child, xyz=(0, 0, 0), xyzw=(0, 0, 0, 1), seconds=0):
    stamp = SimpleNamespace(sec=seconds, nanosec=0)
    transform = SimpleNamespace(
        translation=SimpleNamespace(x=xyz[0], y=xyz[1], z=xyz[2]),
        rotation=SimpleNamespace(x=xyzw[0], y=xyzw[1], z=xyzw[2], w=xyzw[3]),
    )
    header = SimpleNamespace(frame_id=parent, stamp=stamp)
    one = SimpleNamespace(header=header, child_frame_id=child, transform=transform)
    return SimpleNamespace(transforms=[one])


def test_a_chain_goes_up_and_down():
    tree = TransformTree([edge("base", "mast", (1, 0, 0), QUARTER), edge("mast", "lidar", (0, 2, 0)),
                          edge("base", "camera", (0, 0, 3))])  # fmt: skip
    point = np.array([5.0, 0, 0, 1])
    np.testing.assert_allclose(tree.lookup("base", "lidar", 0) @ point, [-1, 5, 0, 1], atol=1e-12)
    np.testing.assert_allclose(tree.lookup("camera", "lidar", 0) @ point, [-1, 5, -3, 1], atol=1e-12)
    back = tree.lookup("lidar", "camera", 0) @ tree.lookup("camera", "lidar", 0)
    np.testing.assert_allclose(back, np.eye(4), atol=1e-12)
    np.testing.assert_allclose(tree.lookup("lidar", "lidar", 0), np.eye(4), atol=1e-15)


def test_a_slash_before_a_frame_means_nothing():
    tree = TransformTree([edge("/base", "lidar", (1, 0, 0)), edge("base", "/camera")])
    assert tree.lookup("/camera", "/lidar", 0)[0, 3] == 1


def test_moving_frames_are_read_only_where_they_are_needed():
    read = []

    def moving():
        read.append(True)
        return [edge("base", "head", (second, 0, 0), seconds=second) for second in (1, 2, 4)]

    tree = TransformTree([edge("base", "lidar"), edge("base", "fixed"), edge("head", "camera")], moving)
    tree.lookup("fixed", "lidar", 0)
    assert not read
    heights = [tree.lookup("lidar", "camera", ns)[0, 3] for ns in (0, 1_600_000_000, 3_500_000_000, 9_000_000_000)]
    assert heights == [1, 2, 4, 4] and read == [True]


def test_who_asks_while_moving_frames_are_read_waits_for_them():
    with ThreadPoolExecutor(1) as threads:
        others = []

        def moving():
            others.append(threads.submit(tree.lookup, "camera", "lidar", 0))
            time.sleep(0.05)
            return [edge("base", "camera", (0, 0, 3))]

        tree = TransformTree([edge("base", "lidar")], moving)
        np.testing.assert_array_equal(tree.lookup("camera", "lidar", 0), others[0].result())


def test_poses_lie_between_the_times_there_are():
    moving = [edge("odom", "base", (4 * second, 0, 0), QUARTER, seconds=second) for second in (3, 1, 2, 2)]
    # transforms that stand still may be said twice
    static = [edge("base", "lidar", (1, 0, 0), seconds=second) for second in (0, 1)]
    tree = TransformTree([*static, edge("earth", "odom", (0, 0, 7))], lambda: moving)
    pose = tree.pose("odom", "/lidar", 1_250_000_000)
    np.testing.assert_allclose(pose @ [0, 0, 0, 1], [5, 1, 0, 1], atol=1e-9)
    np.testing.assert_allclose(tree.pose("earth", "lidar", 2_000_000_000)[:3, 3], [8, 1, 7], atol=1e-9)
    with pytest.raises(PoseError, match="no pose at 3.600000 s, poses are from 1.000000 to 3.000000 s"):
        tree.pose("odom", "lidar", 3_600_000_000)
    with pytest.raises(
        PoseError, match="lidar's frame 'lidar' and the world 'map'; found earth <- odom <- base <- lidar"
    ):
        tree.pose("map", "lidar", 0)


def test_the_way_during_a_sweep_has_the_poses_around_it():
    moving = [edge("odom", "base", (4 * second, 0, 0), QUARTER, seconds=second) for second in (3, 1, 2, 2, 5, 4)]
    tree = TransformTree([edge("base", "lidar", (1, 0, 0))], lambda: moving)
    assert tree.pose("odom", "lidar", 2_000_000_000)[0, 3] == pytest.approx(8)
    way = tree.way("odom", "/lidar", 2_100_000_000, 2_900_000_000)
    assert way.stamps.tolist() == [2, 3]
    np.testing.assert_allclose(way.at(2.25) @ [0, 0, 0, 1], [9, 1, 0, 1], atol=1e-9)
    assert tree.way("odom", "lidar", 2_000_000_000, 3_000_000_000).stamps.tolist() == [1, 2, 3, 4]
    assert tree.way("odom", "lidar", -(10**9), 900_000_000).stamps.tolist() == [1]
    assert tree.way("base", "lidar", 0, 10**10) is None, "what is fixed does not move"


def test_on_its_way_two_transforms_may_move_each_at_its_own_times():
    head = [edge("base", "head", (0, 0, second / 2), seconds=second) for second in (2, 3)]
    moving = [edge("odom", "base", (second, 0, 0), seconds=second) for second in (1, 2, 3, 4)]
    tree = TransformTree([], lambda: [*head, *moving])
    np.testing.assert_allclose(tree.pose("odom", "head", 2_500_000_000)[:3, 3], [2.5, 0, 1.25], atol=1e-9)
    way = tree.way("odom", "head", 2_000_000_000, 3_400_000_000)
    # what nothing is known of the head at is not on the way
    assert way.stamps.tolist() == [2, 3]
    np.testing.assert_allclose(way.at(2.5)[:3, 3], [2.5, 0, 1.25], atol=1e-9)


@pytest.mark.parametrize("corrections", [{1: 0, 2: 0, 3: 500}, {1: 0, 20: 1}], ids=["a jump", "a gap"])
def test_what_lies_above_the_world_does_not_matter(corrections):
    moving = [edge("odom", "base", (second, 0, 0), seconds=second) for second in (1, 2, 3)]
    moving += [edge("map", "odom", (0, y, 0), seconds=second) for second, y in corrections.items()]
    tree = TransformTree([edge("base", "lidar")], lambda: moving)
    assert tree.pose("odom", "lidar", 2_500_000_000)[:3, 3].tolist() == [2.5, 0, 0]
    with pytest.raises(PoseError, match="transforms from map to odom"):
        tree.pose("map", "lidar", 2_500_000_000)


def test_a_frame_may_have_several_parents():
    seconds = (1, 2, 3)
    wheels = [edge("odom", "base", (second, 0, 0), seconds=second) for second in seconds]
    eyes = [edge("vio", "base", (0, second, 0), seconds=second) for second in seconds]
    alternating = [each for both in zip(wheels, eyes, strict=True) for each in both]
    tree = TransformTree([edge("base", "lidar")], lambda: [*alternating, edge("map", "odom", (0, 0, 7))])
    assert tree.pose("odom", "lidar", 2_500_000_000)[:3, 3].tolist() == [2.5, 0, 0]
    assert tree.pose("map", "lidar", 2_500_000_000)[:3, 3].tolist() == [2.5, 0, 7]
    assert tree.pose("vio", "lidar", 2_500_000_000)[:3, 3].tolist() == [0, 2.5, 0]
    assert tree.way("vio", "lidar", 1_500_000_000, 1_600_000_000).stamps.tolist() == [1, 2]
    with pytest.raises(PoseError, match="found map <- odom <- base <- lidar; vio <- base; choose another world"):
        tree.pose("earth", "lidar", 0)


def test_frames_that_nothing_connects_are_listed():
    tree = TransformTree([edge("base", "lidar"), edge("base", "arm"), edge("arm", "hand"), edge("map", "camera")])
    with pytest.raises(CalibrationError, match="map <- camera; base <- arm <- hand; base <- lidar"):
        tree.lookup("camera", "lidar", 0)


def test_loops_end():
    tree = TransformTree([edge("a", "b"), edge("b", "a")])
    with pytest.raises(CalibrationError, match="nothing connects"):
        tree.lookup("c", "a", 0)


@pytest.mark.parametrize("xyzw", [(0, 0, 0, 0), (1, 1, 0, 0), (0, 0, 0, np.nan)], ids=["zero", "too long", "NaN"])
def test_rotations_must_be_unit_quaternions(xyzw):
    with pytest.raises(CalibrationError, match="from base to lidar: quaternion"):
        TransformTree([edge("base", "lidar", xyzw=xyzw)])
