"""Streams of sweeps of a drive."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import ldls
from ldls.errors import NoUsablePoints
from ldls.simulation import Drive, drive_frame

PARAMS = replace(ldls.Params(), threads=1)


@pytest.fixture(scope="module")
def frames():
    drive = Drive(n_frames=5, seed=5, lidar="vlp-16")
    return [drive_frame(drive, number) for number in range(5)]


def sweep_of(frame):
    return ldls.Sweep(frame.points, [ldls.View(i.masks, i.camera) for i in frame.images], frame.pose, frame.stamp)


@pytest.mark.parametrize("before", [0, 2, 4])
def test_a_stream_of_a_drive_labels_each_sweep_with_those_before_it(frames, before):
    camera = frames[0].images[0].camera
    with_camera, without = (
        ldls.LabelDiffusion(camera, PARAMS, before=before),
        ldls.LabelDiffusion((), PARAMS, before=before),
    )
    tracker, sweeps = ldls.Tracker(), []
    for frame in frames:
        sweeps.append(sweep_of(frame))
        latest = ldls.segment_sweeps(sweeps[-1 - before :], params=PARAMS)[-1]
        (expected,) = tracker.track(sweeps[-1:], [latest])
        place = {"pose": frame.pose, "stamp": frame.stamp}
        for found in (
            with_camera.segment(frame.points, frame.images[0].masks, **place),
            without.segment(frame.points, sweeps[-1].views, **place | {"pose": frame.pose.tolist()}),
        ):
            np.testing.assert_array_equal(found.labels, expected.labels)
            assert found.instances == expected.instances and any(i.track for i in found.instances)
            assert found.report.n_sweeps == min(len(sweeps), before + 1)


def test_arrays_may_be_used_again_for_the_next_sweep(frames):
    camera, least = frames[0].images[0].camera, min(len(frame.points) for frame in frames)
    buffer, pose = np.empty_like(frames[0].points[:least]), np.empty((4, 4))
    again, anew = ldls.LabelDiffusion(camera, PARAMS), ldls.LabelDiffusion(camera, PARAMS)
    results = []
    for frame in frames:
        buffer[:], pose[:] = frame.points[:least], frame.pose
        masks = frame.images[0].masks
        results.append(again.segment(buffer, masks, pose=pose, stamp=frame.stamp))
        expected = anew.segment(frame.points[:least], masks, pose=frame.pose, stamp=frame.stamp)
        np.testing.assert_array_equal(results[-1].labels, expected.labels)
    np.testing.assert_array_equal(results[0].points, frames[0].points[:least])


def test_after_a_second_without_a_sweep_the_next_is_labelled_alone(frames):
    one, two, three, _, _ = frames
    stream = ldls.LabelDiffusion(one.images[0].camera, PARAMS)

    def n_sweeps(frame, stamp):
        return stream.segment(frame.points, frame.images[0].masks, pose=frame.pose, stamp=stamp).report.n_sweeps

    assert [n_sweeps(one, 0.0), n_sweeps(two, 1.0), n_sweeps(three, 2.1)] == [1, 2, 1]
    # 8.3 - 7.3 is more than 1
    assert [n_sweeps(one, 7.3), n_sweeps(two, 8.3)] == [1, 2]


@pytest.mark.parametrize(
    ("before", "wait_s", "n_sweeps"),
    [
        pytest.param(2, 0.1, 2, id="from a sweep that is labelled again"),
        pytest.param(0, 0.1, 1, id="from one that is not"),
        pytest.param(2, 2.0, 1, id="after a gap"),
    ],
)
def test_a_pose_that_jumps_is_refused_and_forgotten(frames, before, wait_s, n_sweeps):
    one, two, _, _, _ = frames
    stream = ldls.LabelDiffusion(one.images[0].camera, PARAMS, before=before)
    stream.segment(one.points, one.images[0].masks, pose=one.pose, stamp=one.stamp)
    following = partial(stream.segment, two.points, two.images[0].masks, stamp=one.stamp + wait_s)
    away = two.pose.copy()
    away[0, 3] += 500
    with pytest.raises(ldls.PoseError, match=r"the lidar moves 50\d.* expected at most 100 m/s") as refused:
        following(pose=away)
    assert ("begin another LabelDiffusion" in str(refused.value)) == (wait_s > 1)
    assert following(pose=two.pose).report.n_sweeps == n_sweeps


def test_a_frame_without_pose_is_none_of_the_drive(frames):
    one, two, _, _, _ = frames
    stream = ldls.LabelDiffusion(one.images[0].camera, PARAMS)
    first = stream.segment(one.points, one.images[0].masks, pose=one.pose, stamp=one.stamp)
    alone = stream.segment(two.points, two.images[0].masks)
    expected = ldls.segment(two.points, two.images[0].masks, two.images[0].camera, params=PARAMS)
    np.testing.assert_array_equal(alone.labels, expected.labels)
    assert first.report.n_sweeps == alone.report.n_sweeps == 1 and not any(i.track for i in alone.instances)


def test_misuse_is_named_and_forgotten(frames):
    one, two, _, _, _ = frames
    (image,) = one.images
    stream = ldls.LabelDiffusion(image.camera, PARAMS)
    with pytest.raises(ldls.InputError, match="stamp: got None beside a pose"):
        stream.segment(one.points, image.masks, pose=one.pose)
    with pytest.raises(ldls.InputError, match="pose: got None beside a stamp"):
        stream.segment(one.points, image.masks, stamp=0.0)
    with pytest.raises(ldls.CalibrationError, match="pose"):
        stream.segment(one.points, image.masks, pose=2 * np.eye(4), stamp=0.0)
    with pytest.raises(ldls.ParameterError, match="stamp: got inf, expected seconds"):
        stream.segment(one.points, image.masks, pose=one.pose, stamp=np.inf)
    with pytest.raises(ldls.ParameterError, match="before: got -1, expected 0 to 50"):
        ldls.LabelDiffusion(before=-1)
    with pytest.raises(
        ldls.InputError, match="got InstanceMasks, expected a list of View, for the stream has no camera"
    ):
        ldls.LabelDiffusion().segment(one.points, image.masks)
    stream.segment(one.points, image.masks, pose=one.pose, stamp=one.stamp)
    alone = ldls.LabelDiffusion(image.camera, PARAMS, before=0)
    alone.segment(one.points, image.masks, pose=one.pose, stamp=one.stamp)
    for each in (stream, alone):
        with pytest.raises(ldls.InputError, match="two have the stamp"):
            each.segment(one.points, image.masks, pose=one.pose, stamp=one.stamp)
    latest = stream.segment(two.points, two.images[0].masks, pose=two.pose, stamp=two.stamp)
    assert latest.report.n_sweeps == 2


def test_a_sweep_is_warned_of_when_it_comes_and_never_again(frames):
    stream = ldls.LabelDiffusion(frames[0].images[0].camera, PARAMS)
    one, two, *_ = frames
    with pytest.warns(NoUsablePoints, match="^points: no row is finite") as caught:
        stream.segment(one.points * np.float32(np.nan), one.images[0].masks, pose=one.pose, stamp=one.stamp)
    assert caught[0].filename == __file__
    assert stream.segment(two.points, two.images[0].masks, pose=two.pose, stamp=two.stamp).report.n_sweeps == 2
