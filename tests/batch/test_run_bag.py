"""The labelled bag of a run over a bag: whole or not there, with the labels of all frames."""

import json
import shutil
import subprocess

import numpy as np
import pytest

pytest.importorskip("rosbags")


from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

import ldls
from batch import runs
from command import command
from datasets import layouts
from datasets.ros_samples import START_NS, STEP_NS, Recording
from ldls import batch
from ldls.datasets import RosBag
from ldls.errors import BatchError, ChangedFileWarning, LeftOutWarning, ParameterError
from ldls.io.labelled_bag import LabelledBag
from ldls.io.ros.point_cloud2 import decode

KINDS = {"rosbag1": ("drive.bag", "labelled.bag"), "rosbag2": ("drive", "labelled"), "mcap": ("drive", "labelled")}


class Ahead(Recording):
    """A recording whose clouds lie before the camera, another for each sweep."""

    def cloud(self, number):
        ahead = np.random.default_rng(number).uniform([8, -2, -2], [12, 2, 2], (60 + number, 3)).astype(np.float32)
        return {"x": ahead[:, 0], "y": ahead[:, 1], "z": ahead[:, 2], "intensity": ahead[:, 0] / 12}


def recorded(folder, kind, sweeps=4, **contents):
    """A bag with masks beside it."""
    bag = Ahead(kind=kind, sweeps=sweeps, **contents).write(folder / KINDS[kind][0])
    for number in range(sweeps):
        path = folder / f"masks/{START_NS + number * STEP_NS}.json"
        layouts.write_text(path, json.dumps(layouts.coco(20 + number)))
    return bag


def run(bag, out, *more):
    return command("run", bag, "--masks", bag.parent / "masks", "--out", out, *more)


def messages(path, topic=None):
    """(topic, time of reception, message) of a bag, by the library alone."""
    store = get_typestore(Stores.ROS1_NOETIC if path.suffix == ".bag" else Stores.ROS2_HUMBLE)
    with AnyReader([path], default_typestore=store) as reader:
        chosen = [c for c in reader.connections if topic in (None, c.topic)]
        return [(c.topic, at, reader.deserialize(raw, c.msgtype)) for c, at, raw in reader.messages(chosen)]


@pytest.mark.parametrize("kind", KINDS)
def test_labels_of_all_frames_come_back_with_stamps_and_frames(tmp_path, kind):
    bag, out = recorded(tmp_path, kind), tmp_path / "out"
    outcome = run(bag, out, "--formats", "bag")
    assert outcome.exit_code == 0, outcome.output
    path = out / KINDS[kind][1]
    clouds = messages(path, "/points_labelled")
    sweeps = messages(bag, "/points")
    assert len(clouds) == len(sweeps) == 4
    found = set()
    for number, ((_, received, cloud), (_, expected, sweep)) in enumerate(zip(clouds, sweeps, strict=True)):
        assert received == expected == START_NS + number * STEP_NS + 1_000_000
        assert cloud.header.stamp == sweep.header.stamp
        assert cloud.header.frame_id == sweep.header.frame_id == "lidar"
        result = ldls.read_result(out / f"{START_NS + number * STEP_NS}.npz")
        fields = decode(cloud).fields
        assert fields.dtype.names == ("x", "y", "z", "intensity", "instance_id", "class_id", "probability", "rgb")
        assert len(fields) == cloud.width * cloud.height == 60 + number
        np.testing.assert_array_equal(fields["instance_id"], np.maximum(result.labels, 0))
        np.testing.assert_array_equal(fields["class_id"], result.categories)
        np.testing.assert_array_equal(fields["probability"], result.confidence)
        np.testing.assert_array_equal(fields["x"], decode(sweep).fields["x"])
        found |= set(fields["class_id"].tolist())
    assert found == {0, 1, 3}
    beside = {topic for topic, _, _ in messages(path)} - {"/points_labelled"}
    assert beside == {"/camera/image_raw", "/camera/camera_info", "/tf_static"}
    again = RosBag(path, points_topic="/points_labelled")
    np.testing.assert_array_equal(again[2].images[0].read(), RosBag(bag)[2].images[0].read())


def test_a_bag_that_is_whole_stays_and_one_that_lacks_frames_is_written_anew(tmp_path):
    bag, out = recorded(tmp_path, "mcap"), tmp_path / "out"
    assert run(bag, out, "--formats", "bag", "--frames", "1:3").exit_code == 0
    assert [at for _, at, _ in messages(out / "labelled", "/points_labelled")] == [
        START_NS + number * STEP_NS + 1_000_000 for number in (1, 2)
    ]
    inode = (out / "labelled/metadata.yaml").stat().st_ino
    assert "2 of them by earlier runs" in run(bag, out, "--formats", "bag", "--frames", "1:3").output
    assert (out / "labelled/metadata.yaml").stat().st_ino == inode
    assert run(bag, out, "--formats", "bag,label").exit_code == 0
    assert len(messages(out / "labelled", "/points_labelled")) == 4
    # a run that was killed before the bag was written
    shutil.rmtree(out / "labelled")
    (out / ".labelled.abc.part").mkdir()
    assert run(bag, out, "--formats", "bag").exit_code == 0
    assert len(messages(out / "labelled", "/points_labelled")) == 4
    assert not list(out.glob(".*.part"))


def test_the_bag_of_a_finished_run_is_added(tmp_path):
    bag, out = recorded(tmp_path, "rosbag1"), tmp_path / "out"
    assert run(bag, out, "--formats", "label").exit_code == 0
    assert run(bag, out, "--formats", "bag").exit_code == 0
    assert len(messages(out / "labelled.bag", "/points_labelled")) == 4


def test_a_bag_is_made_of_results_as_the_run_wrote_them_alone(tmp_path):
    bag, out = recorded(tmp_path, "mcap"), tmp_path / "out"
    settings = batch.RunSettings(masks=str(tmp_path / "masks"), formats=("bag",))
    assert run(bag, out, "--formats", "npz").exit_code == 0
    first, _, third, last = (out / f"{START_NS + number * STEP_NS}.npz" for number in range(4))
    shutil.copy(first, third)
    last.unlink()
    with pytest.warns(LeftOutWarning, match=rf"of 2 frames outside --frames \({third.stem}, {last.stem}\) are missing"):
        batch.run(bag, out, settings, frames=slice(0, 1))
    assert n_points(out / "labelled") == [60, 61]
    with pytest.warns(ChangedFileWarning, match=third.stem):
        batch.run(bag, out, settings)
    assert n_points(out / "labelled") == [60, 61, 62, 63]


def n_points(path):
    return [cloud.width * cloud.height for _, _, cloud in messages(path, "/points_labelled")]


def test_frames_that_fail_are_not_in_the_bag(tmp_path):
    bag, out = recorded(tmp_path, "mcap"), tmp_path / "out"
    (tmp_path / f"masks/{START_NS + STEP_NS}.json").unlink()
    assert run(bag, out, "--formats", "bag").exit_code == 2
    assert len(messages(out / "labelled", "/points_labelled")) == 3


def test_what_is_copied_lies_in_the_time_of_the_frames(tmp_path):
    bag, out = recorded(tmp_path, "mcap", sweeps=40), tmp_path / "out"
    assert run(bag, out, "--formats", "bag", "--frames", "0:2").exit_code == 0
    images = [at for _, at, _ in messages(out / "labelled", "/camera/image_raw")]
    assert len(images) == 12  # to a second after the last sweep


def test_a_failure_leaves_no_bag(tmp_path, monkeypatch):
    bag, out = recorded(tmp_path, "mcap"), tmp_path / "out"
    write = LabelledBag.write

    def full(self, result, header, **options):
        if header.stamp_ns > START_NS:
            raise OSError(28, "No space left on device", str(self.path))
        write(self, result, header, **options)

    monkeypatch.setattr(LabelledBag, "write", full)
    outcome = run(bag, out, "--formats", "bag")
    assert outcome.exit_code == 1 and "No space left on device" in outcome.output
    assert not [path for path in out.iterdir() if "labelled" in path.name]
    monkeypatch.undo()
    assert run(bag, out, "--formats", "bag").exit_code == 0
    assert len(messages(out / "labelled", "/points_labelled")) == 4


@pytest.mark.parametrize("kind", KINDS)
def test_a_full_disk_is_named_and_the_run_goes_on(tmp_path, small_disk, kind):
    bag, out = recorded(tmp_path, kind, sweeps=12), small_disk / "out"
    subprocess.run(["mount", "-o", "remount,size=280k", str(small_disk)], check=True)
    outcome = run(bag, out, "--formats", "bag")
    assert outcome.exit_code == 1
    said = " ".join(outcome.output.split())
    assert f"labelled{'.bag' if kind == 'rosbag1' else ''}: " in said
    assert "full while writing the bag" in said or "No space left on device while writing the bag" in said
    assert "; free space, or write it to another disk" in said
    assert len(list(out.glob("*.npz"))) == 12 and not [path for path in out.iterdir() if "labelled" in path.name]
    subprocess.run(["mount", "-o", "remount,size=20m", str(small_disk)], check=True)
    assert run(bag, out, "--formats", "bag").exit_code == 0


def test_what_is_in_the_place_of_the_bag_and_none_of_ours_stays(tmp_path):
    bag, out = recorded(tmp_path, "mcap"), tmp_path / "out"
    layouts.write_text(out / "labelled/notes.txt", "the user's own")
    settings = runs.stored(tmp_path, formats=("bag",))
    with pytest.raises(BatchError, match=r"labelled: is there and is no bag of labelled clouds"):
        batch.run(bag, out, settings)
    assert (out / "labelled/notes.txt").exists()
    assert not list(out.glob("*.npz"))


def test_other_sources_are_refused(few, tmp_path):
    settings = runs.stored(few, formats=("npz", "bag"))
    with pytest.raises(ParameterError, match=r"bag is a ROS bag with labels, .* is of kind kitti-object; leave it"):
        batch.run(few, tmp_path / "out", settings)
    assert not (tmp_path / "out").exists()


def test_a_single_frame_has_no_bag():
    from ldls.viewing.formats import check_formats

    with pytest.raises(ParameterError, match="bag is of a whole run; label the ROS bag with `ldls run`"):
        check_formats(["npz", "bag"])


def test_with_tracks_instances_are_those_of_the_drive(tmp_path):
    bag, out = recorded(tmp_path, "rosbag2", moving=(("odom", "base"),)), tmp_path / "out"
    turned = tmp_path / f"masks/{START_NS + STEP_NS}.json"
    masks = json.loads(turned.read_text())
    turned.write_text(json.dumps(masks | {"annotations": masks["annotations"][::-1]}))
    assert run(bag, out, "--option", "world=odom", "--formats", "bag").exit_code == 0
    before = instance_ids(out / "labelled")
    track = ("--option", "world=odom", "--formats", "bag", "--track")
    outcome = run(bag, out, *track)
    assert outcome.exit_code == 0, outcome.output
    tracked = [ldls.read_result(path) for path in sorted((out / "tracks").glob("*.npz"))]
    expected = [each.instance_ids[np.maximum(each.labels, 0)] for each in tracked]
    for found, wanted in zip(instance_ids(out / "labelled"), expected, strict=True):
        np.testing.assert_array_equal(found, wanted)
    assert [np.array_equal(*each) for each in zip(before, expected, strict=True)] == [True, False, True, True]
    inode = (out / "labelled/metadata.yaml").stat().st_ino
    assert run(bag, out, *track).exit_code == 0
    assert (out / "labelled/metadata.yaml").stat().st_ino == inode, "what is whole stays"


@pytest.mark.parametrize(
    "steps",
    [
        pytest.param(
            ["--formats bag", "--formats npz --track", "--formats bag --track"], id="tracks of a run without the bag"
        ),
        pytest.param(
            ["--formats npz --track", "--formats bag", "--formats bag --track"], id="tracks older than the bag"
        ),
        pytest.param(
            [
                "--sweeps 1 --formats bag",
                "--sweeps 1 --formats npz --frames 1:",
                "--sweeps 1 --formats bag --frames 1:",
            ],
            id="labels of other windows",
        ),
    ],
)
def test_a_bag_has_the_labels_that_there_are_now(tmp_path, steps):
    bag, out = recorded(tmp_path, "mcap", moving=(("odom", "base"),)), tmp_path / "out"
    turned = tmp_path / f"masks/{START_NS + STEP_NS}.json"
    masks = json.loads(turned.read_text())
    turned.write_text(json.dumps(masks | {"annotations": masks["annotations"][::-1]}))
    for step in steps:
        outcome = run(bag, out, "--option", "world=odom", *step.split())
        assert outcome.exit_code == 0, outcome.output
    of = out / "tracks" if "--track" in steps[-1] else out
    results = [ldls.read_result(path) for path in sorted(of.glob("*.npz"))]
    for found, each in zip(instance_ids(out / "labelled"), results, strict=True):
        np.testing.assert_array_equal(found, each.instance_ids[np.maximum(each.labels, 0)])


def test_a_bag_of_labels_that_a_run_of_other_formats_replaces_is_removed(tmp_path):
    bag, out = recorded(tmp_path, "rosbag1", moving=(("odom", "base"),)), tmp_path / "out"
    of_run = ("--option", "world=odom", "--sweeps", "1")
    run(bag, out, *of_run, "--formats", "bag")
    for more in ((), ("--track",)):
        assert "warning" not in run(bag, out, *of_run, *more, "--formats", "npz").output
    outcome = run(bag, out, *of_run, "--formats", "npz", "--frames", "1:")
    assert "labelled.bag: labels or tracks are others than before; removed" in " ".join(outcome.output.split())
    assert not (out / "labelled.bag").exists()


def test_a_bag_of_other_tracks_is_removed_before_there_are_new_ones(tmp_path, monkeypatch):
    bag, out = recorded(tmp_path, "mcap", moving=(("odom", "base"),)), tmp_path / "out"
    track = ("--option", "world=odom", "--track")
    run(bag, out, *track, "--formats", "npz,bag", "--frames", "1:")
    outcome = run(bag, out, *track, "--formats", "npz")
    assert "labels or tracks are others than before; removed" in " ".join(outcome.output.split())
    assert not (out / "labelled").exists()
    run(bag, out, *track, "--formats", "npz,bag")
    assert (out / "labelled").exists()
    (out / "tracks.csv").unlink()

    def killed(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("ldls.batch.run_bag.RunBag.write", killed)
    run(bag, out, *track, "--formats", "npz,bag")
    assert (out / "tracks.csv").exists()
    assert not (out / "labelled").exists()


@pytest.fixture
def elsewhere(tmp_path):
    """A bag of results, which was moved out of the folder of its run, and a command that labels otherwise."""
    bag, out = recorded(tmp_path, "mcap", moving=(("odom", "base"),)), tmp_path / "out"
    of_run = ("--option", "world=odom", "--sweeps", "1", "--formats")
    run(bag, out, *of_run, "bag")
    (out / "labelled").rename(tmp_path / "elsewhere")
    return tmp_path / "elsewhere", out / "labelled", lambda: run(bag, out, *of_run, "npz", "--frames", "1:")


def test_what_took_the_place_of_a_bag_stays(elsewhere):
    _, place, label = elsewhere
    place.mkdir()
    (place / "mine.txt").write_text("by hand")
    assert "warning" not in label().output
    assert (place / "mine.txt").read_text() == "by hand"


def test_a_link_to_a_bag_is_removed_and_not_the_bag(elsewhere):
    bag, place, label = elsewhere
    place.symlink_to(bag)
    assert label().exit_code == 0
    assert not place.is_symlink()
    assert (bag / "metadata.yaml").is_file()


def instance_ids(path):
    return [decode(cloud).fields["instance_id"] for _, _, cloud in messages(path, "/points_labelled")]
