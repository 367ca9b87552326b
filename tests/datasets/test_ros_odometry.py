"""Poses of a bag from messages of nav_msgs/Odometry."""

import pickle

import numpy as np
import pytest

pytest.importorskip("rosbags")

from datasets.ros_samples import START_NS, STEP_NS, Recording, transforms
from ldls.datasets import RosBag, open_source
from ldls.errors import CalibrationError, PoseError
from ldls.io.ros.messages import ODOMETRY, POINTS, TRANSFORMS, Header, Topic, make, make_header
from ldls.io.ros.point_cloud2 import encode
from ldls.io.ros.writer import BagWriter

QUARTER = (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))
"""x y z w of a quarter turn to the left about z."""
SWEEPS = 3
LATE_NS = STEP_NS // 4
"""Sweeps are that much later than the pose before them."""


def odometry(types, stamp_ns, x=0.0, xyzw=QUARTER, world="odom", robot="base"):
    point = make(types, "geometry_msgs/msg/Point", x=float(x), y=0.0, z=0.0)
    turn = make(types, "geometry_msgs/msg/Quaternion", **dict(zip("xyzw", map(float, xyzw), strict=True)))
    none = make(types, "geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
    pose = make(types, "geometry_msgs/msg/Pose", position=point, orientation=turn)
    twist = make(types, "geometry_msgs/msg/Twist", linear=none, angular=none)
    unknown = np.zeros(36)
    return make(
        types,
        ODOMETRY,
        header=make_header(types, Header(stamp_ns, world)),
        child_frame_id=robot,
        pose=make(types, "geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=unknown),
        twist=make(types, "geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=unknown),
    )


def drive(step_m=1.0, **fields):
    """A message a sweep and one more, `step_m` farther along x each."""
    return [{"stamp_ns": START_NS + k * STEP_NS, "x": step_m * k, **fields} for k in range(SWEEPS + 1)]


def written(tmp_path, topics, kind="rosbag1", edges=(("base", "lidar"),), moving=()):
    """A bag of clouds alone, with the messages of some topics of Odometry; the lidar is 1 m above its parent."""
    path = tmp_path / ("small.bag" if kind == "rosbag1" else "small")
    with BagWriter(path, kind) as bag:
        bag.add_topic(Topic("/tf_static", TRANSFORMS, 0, latched=True))
        bag.add_topic(Topic("/tf", TRANSFORMS, 0))
        bag.add_topic(Topic("/points", POINTS, 0))
        bag.write_message("/tf_static", transforms(bag.types, edges, START_NS), START_NS)
        for topic, messages in topics.items():
            bag.add_topic(Topic(topic, ODOMETRY, 0))
            for received, each in enumerate(messages, start=START_NS):
                bag.write_message(topic, odometry(bag.types, **each), received)
        for number in range(SWEEPS):
            stamp = START_NS + number * STEP_NS + LATE_NS
            if moving:
                bag.write_message("/tf", transforms(bag.types, moving, stamp, height=float(number)), stamp)
            cloud = encode(bag.types, Recording().cloud(number), Header(stamp, "lidar"))
            bag.write_message("/points", cloud, stamp)
    return path


def opened(path, world="odom"):
    return RosBag(path, image_topics=(), world=world)


@pytest.mark.parametrize("kind", ["rosbag1", "rosbag2", "mcap"])
@pytest.mark.parametrize("world", ["odom", "/odom", "/lio/odometry"])
def test_poses_lie_between_the_messages(tmp_path, kind, world):
    # late ones, and one that came twice
    messages = drive()[::-1] + drive()[:1]
    bag = opened(written(tmp_path, {"/lio/odometry": messages}, kind), world)
    for number, frame in enumerate(pickle.loads(pickle.dumps(bag))):
        expected = [[0, -1, 0, number + 0.25], [1, 0, 0, 0], [0, 0, 1, 1], [0, 0, 0, 1]]
        np.testing.assert_allclose(frame.pose, expected, atol=1e-6)
        # 10 m/s along the world's x, which is to the right of the lidar
        motion = frame.trajectory.motion(frame.stamp + 0.01, frame.stamp)
        np.testing.assert_allclose(motion[:3, 3], [0, -1e7 / STEP_NS, 0], atol=1e-5)
        np.testing.assert_allclose(frame.trajectory.at(frame.stamp), frame.pose, atol=1e-6)


def test_without_a_world_nothing_has_a_pose(tmp_path):
    assert opened(written(tmp_path, {"/odom": [{"stamp_ns": START_NS, "xyzw": (0, 0, 0, 0)}]}), None)[0].pose is None


def test_poses_that_are_left_out_are_not_read(tmp_path):
    path = written(tmp_path, {"/odom": [{"stamp_ns": START_NS, "xyzw": (0, 0, 0, 0)}]})
    options = {"image_topics": (), "world": "odom"}
    with pytest.raises(PoseError):
        open_source(path, **options)
    frame = pickle.loads(pickle.dumps(open_source(path, poses=False, **options)))[0]
    assert frame.pose is None and frame.trajectory is None


def test_worlds_are_the_frames_that_transforms_lead_to_and_the_topics(tmp_path):
    """Static transforms lead to no world."""
    path = written(
        tmp_path,
        {"/lio": drive(world="start")},
        edges=(("base", "lidar"), ("base", "hood")),
        moving=(("map", "odom"), ("odom", "base"), ("vio", "base")),
    )
    bag = opened(path, None)
    assert bag.worlds() == ["odom", "vio", "map", "/lio"]
    options = " or ".join(f"--option world={world}" for world in ("odom", "vio", "map", "/lio"))
    assert bag.why_no_poses == f"they come with {options}"
    for world in bag.worlds():
        assert opened(path, world)[1].pose is not None


def test_worlds_are_told_by_names_alone(tmp_path, monkeypatch):
    """Transforms of frames that nobody asks for may be broken, as those of a joint that reports zeros."""

    def refuse(*_):
        raise CalibrationError("a quaternion of zeros")

    bag = opened(written(tmp_path, {}, moving=(("odom", "base"), ("base", "arm"))), None)
    monkeypatch.setattr("ldls.datasets.ros_transforms.matrix_of", refuse)
    assert bag.worlds() == ["odom"]


def test_a_bag_without_any_way_has_no_worlds(tmp_path):
    bag = opened(written(tmp_path, {}), None)
    assert (bag.worlds(), bag.why_no_poses) == ([], "")


def test_transforms_come_before_odometry_and_a_topic_before_transforms(tmp_path):
    path = written(tmp_path, {"/wheels": drive(), "/lio": drive(2.0)}, moving=(("odom", "base"),))
    by_transforms = [frame.pose for frame in opened(path)]
    np.testing.assert_allclose([pose[:3, 3] for pose in by_transforms], [[0, 0, 1 + k] for k in range(SWEEPS)])
    by_topic = [frame.pose[:3, 3] for frame in opened(path, "/lio")]
    np.testing.assert_allclose(by_topic, [[2 * k + 0.5, 0, 1] for k in range(SWEEPS)], atol=1e-6)


def test_cameras_keep_their_transforms(tmp_path):
    """The robot's frame has a parent of its own, to which the odometry does not lead."""
    path = written(
        tmp_path, {"/odom": drive()}, edges=(("footprint", "base"), ("base", "lidar"), ("footprint", "hood"))
    )
    bag = opened(path)
    np.testing.assert_allclose(bag[0].pose[:3, 3], [0.25, 0, 1], atol=1e-6)
    np.testing.assert_allclose(bag._tree.lookup("hood", "lidar", START_NS)[:3, 3], [0, 0, 1])


def test_what_is_copied_beside_the_labels_has_the_odometry(tmp_path):
    assert "/odom" in opened(written(tmp_path, {"/odom": drive()})).companions()


GAP = [*drive()[:1], {"stamp_ns": START_NS + 5 * 10**9, "x": 1.0}]
ROWS = [
    pytest.param({"/odom": drive(xyzw=(0, 0, 0, 0))}, "odom",
                 r"/odom: pose at 1000.000000000 s: orientation: quaternion \[0.0, 0.0, 0.0, 0.0\] has length 0",
                 id="a quaternion of zeros"),
    pytest.param({"/odom": drive(x=np.nan)}, "odom", "/odom: poses: pose 0 at 1000.000000 s is not finite", id="NaN"),
    pytest.param({"/odom": drive(100.0)}, "odom", "/odom: poses: from 1000.000000 to 1000.100000 s the lidar moves 100",
                 id="a jump"),
    pytest.param({"/odom": GAP}, "odom", r"/odom: stamp: no pose at 1000.025000 s, for poses have a gap of 5.000 s",
                 id="a gap"),
    pytest.param({"/odom": drive()[:1]}, "odom", "/odom: stamp: no pose at 1000.025000 s, poses are from 1000.000000",
                 id="a single message"),
    pytest.param({"/odom": []}, "/odom", "world: /odom has no messages", id="a topic without messages"),
    pytest.param({"/odom": []}, "odom", "nothing connects the lidar's frame 'lidar' and the world 'odom'",
                 id="no messages at all"),
    pytest.param({}, "/odom", "nothing connects the lidar's frame 'lidar' and the world 'odom'", id="no such topic"),
    pytest.param({"/odom": drive(), "/empty": []}, "map",
                 "neither transforms nor nav_msgs/Odometry have poses in 'map'; /odom has poses in 'odom'; choose",
                 id="another world"),
    pytest.param({"/wheels": drive(), "/lio": drive()}, "odom",
                 "/(wheels, /lio|lio, /wheels) have poses in 'odom'; choose one of them, as world=/", id="two topics"),
    pytest.param({"/odom": [*drive(), *drive(world="map")]}, "/odom", "/odom has poses in 'map' and 'odom'",
                 id="a topic of two worlds"),
    pytest.param({"/odom": [*drive(), *drive(robot="arm")]}, "odom", "/odom: child_frame_id is 'arm' and 'base'",
                 id="two robots"),
    pytest.param({"/odom": drive(robot="")}, "odom", "/odom: child_frame_id is '', expected the name of one frame",
                 id="no name of the robot"),
    pytest.param({"/odom": drive(robot="body")}, "odom",
                 "/odom has poses of 'body', which no transforms connect with the lidar's frame 'lidar'",
                 id="a robot that nothing connects with the lidar"),
]  # fmt: skip


@pytest.mark.parametrize(("topics", "world", "message"), ROWS)
def test_what_gives_no_pose_is_named(tmp_path, topics, world, message):
    path = written(tmp_path, topics)
    with pytest.raises(PoseError, match=message) as caught:
        opened(path, world)[0]
    assert str(path) in str(caught.value)


def test_a_robot_that_is_named_after_the_world_is_refused(tmp_path):
    """As VINS-Fusion writes it: /tf leads from there to the lidar, and poses would count twice."""
    path = written(tmp_path, {"/odom": drive(robot="odom")}, moving=(("odom", "base"),))
    np.testing.assert_allclose(opened(path, "odom")[1].pose[2, 3], 2)
    with pytest.raises(PoseError, match=r"/odom: child_frame_id is 'odom', expected .* another world, or give poses"):
        opened(path, "/odom")[0]


def test_a_world_that_is_not_there_is_refused_when_the_bag_is_opened(tmp_path):
    path = written(tmp_path, {}, moving=(("odom", "base"),))
    with pytest.raises(PoseError, match=r"the world 'map'; found odom <- base <- lidar; choose another") as caught:
        opened(path, "map")
    assert str(caught.value).startswith(f"{path}: transforms: ")
