"""Runs that label sweeps of a drive together: the labels, windows, frames that fail, and what is done again."""

import re
import shutil
import signal
from contextlib import nullcontext

import numpy as np
import pytest

import ldls
from batch import drives, runs
from command import command
from datasets import layouts
from ldls import batch
from ldls.batch import frame_work
from ldls.batch.frame_work import FrameWork
from ldls.batch.lock import HOLDER_NAME
from ldls.batch.plan import windows_of
from ldls.batch.ray_engine import _noted
from ldls.batch.ray_worker import RayWorker
from ldls.datasets import odometry_of, open_source
from ldls.errors import BatchError, InputError, LdlsWarning, LeftOutWarning, NothingInView, ParameterError, PoseError

N_FRAMES = 8


def run(drive, out, *, frames=slice(None), workers=None, engine="local", **settings):
    settings = {"masks": str(drive / "masks"), "sweeps": 1, **settings}
    return batch.run(drive, out, batch.RunSettings(**settings), frames=frames, workers=workers, engine=engine)


def words(drive, out, *more):
    return runs.arguments(drive, out, "--sweeps", 1, *more)


def by_hand(source, masks, frames):
    """The results of `segment_sweeps` of these frames together."""
    sweeps = []
    for index in frames:
        frame = source[index]
        (image,) = frame.images
        view = ldls.View(ldls.read_masks(masks / f"{frame.name}.json"), image.camera, image.name)
        sweeps.append(ldls.Sweep(frame.points, [view], frame.pose, frame.stamp))
    return ldls.segment_sweeps(sweeps)


def windows(out):
    """The frames by their last digits, as the journal says that they were labelled together."""
    return [
        "".join(name[-1] for name in record["window"]) for record in runs.records(out).values() if "window" in record
    ]


@pytest.fixture
def labelled(monkeypatch):
    """How many sweeps were labelled together each time from now on."""
    done = []
    segment_sweeps = frame_work.segment_sweeps
    noted = lambda sweeps, **options: done.append(len(sweeps)) or segment_sweeps(sweeps, **options)  # noqa: E731
    monkeypatch.setattr(frame_work, "segment_sweeps", noted)
    return done


@pytest.fixture
def whole(drive, tmp_path):
    """The files of an undisturbed run."""
    run(drive, tmp_path / "whole", workers=1)
    return runs.contents(tmp_path / "whole")


def test_labels_are_those_of_segment_sweeps_window_by_window(simulated, tmp_path):
    run(simulated, tmp_path / "out", masks=str(simulated / "masks_02"))
    source = open_source(simulated, truth=False)
    expected = [*by_hand(source, simulated / "masks_02", (0, 1, 2)), *by_hand(source, simulated / "masks_02", (3, 4))]
    alone = 0
    for name, frame, own in zip(source.names, source, expected, strict=True):
        result = ldls.read_result(tmp_path / f"out/{name}.npz")
        np.testing.assert_array_equal(result.labels, own.labels)
        np.testing.assert_array_equal(result.confidence, own.confidence)
        np.testing.assert_array_equal(result.views[0].in_view, own.views[0].in_view)
        assert result.instances == own.instances
        ldls.save(own, tmp_path / "one.label")
        assert (tmp_path / f"out/{name}.label").read_bytes() == (tmp_path / "one.label").read_bytes()
        single = ldls.segment(frame.points, [seen.view for seen in own.views])
        alone += int((single.categories != own.categories).sum())
        record = runs.records(tmp_path / "out")[name]
        assert record["stamp"] == frame.stamp and np.array_equal(record["pose"], frame.pose)
    assert alone > 50, "points that one sweep alone labels in another way"
    assert windows(tmp_path / "out") == ["012", "012", "012", "34", "34"]


@pytest.mark.parametrize("workers", [2, 5])
def test_any_number_of_workers_yields_the_same_bytes(drive, whole, tmp_path, workers):
    assert run(drive, tmp_path / "out", workers=workers).n_done == N_FRAMES
    assert runs.contents(tmp_path / "out") == whole


def test_a_ray_cluster_yields_the_same_bytes(drive, whole, tmp_path):
    pytest.importorskip("ray")
    assert run(drive, tmp_path / "out", workers=2, engine="ray").n_done == N_FRAMES
    assert runs.contents(tmp_path / "out") == whole


def test_a_worker_of_a_cluster_does_windows_and_notes_them(drive, whole, tmp_path):
    out, notes = tmp_path / "out", tmp_path / "out/.worker-0"
    out.mkdir()
    notes.touch()
    (out / HOLDER_NAME).write_text("this run")
    worker = RayWorker()
    settings = runs.stored(drive, sweeps=1)
    worker.open(FrameWork(open_source(drive), settings, out), ldls.__version__, "this run", notes.name)
    outcome = worker.do(((3, "000003"), (4, "000004"), (5, "000005")))
    assert [record["window"] for record in outcome.records] == [["000003", "000004", "000005"]] * 3
    assert (out / "000004.npz").read_bytes() == whole["000004.npz"]
    assert _noted(notes, {"000003", "000006"}) == {"000003": outcome}


@pytest.mark.parametrize(("step", "n"), [("line half written", 1), ("file written, not synced", 20)])
def test_a_run_that_was_killed_goes_on(tmp_path, step, n):
    drive = drives.small_drive(tmp_path / "drive", 24)
    run(drive, tmp_path / "whole")
    out = tmp_path / "out"
    killed = runs.killed(step, n, words(drive, out))
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    outcome = command(*words(drive, out))
    assert outcome.exit_code == 0, outcome.output
    assert runs.contents(out) == runs.contents(tmp_path / "whole")


@pytest.mark.parametrize("part", ["velodyne/000004.bin", "masks/000004.json"])
def test_a_frame_that_fails_leaves_its_window_alone_until_it_is_mended(drive, whole, tmp_path, part):
    out, sound = tmp_path / "out", (drive / part).read_bytes()
    (drive / part).write_bytes(sound[:-7])
    for _ in "again":
        summary = run(drive, out, formats=("npz", "label"))
        assert [failure.frame for failure in summary.failures] == ["000004"]
        assert (summary.n_done, windows(out)) == (7, ["012", "012", "012", "35", "35", "67", "67"])
    (one, _) = by_hand(open_source(drive), drive / "masks", (3, 5)) if "masks" in part else (None, None)
    if one is not None:
        np.testing.assert_array_equal(ldls.read_result(out / "000003.npz").labels, one.labels)
    run(drive, out, formats=("npz", "label", "ply"))
    (drive / part).write_bytes(sound)
    # the .ply is not asked for any more, but must not stay as it is
    summary = run(drive, out)
    assert (summary.n_done, summary.n_earlier) == (8, 5)
    run(drive, tmp_path / "at once", formats=("npz", "label", "ply"))
    at_once = runs.contents(tmp_path / "at once")
    assert all(runs.contents(out)[name] == at_once[name] for name in ("000003.ply", "000005.ply"))
    assert {name: runs.contents(out)[name] for name in whole if "jsonl" not in name} == {
        name: content for name, content in whole.items() if "jsonl" not in name
    }


def test_a_frame_that_fails_again_makes_nothing_be_written(drive, tmp_path):
    (drive / "masks/000004.json").unlink()
    run(drive, tmp_path / "out")
    before, journal = runs.times(tmp_path / "out"), (tmp_path / "out/journal.jsonl").read_bytes()
    assert run(drive, tmp_path / "out").n_earlier == 5
    assert {name: at for name, at in runs.times(tmp_path / "out").items() if "failures" not in name} == {
        name: at for name, at in before.items() if "failures" not in name
    }
    assert (tmp_path / "out/journal.jsonl").read_bytes() == journal


def test_a_file_that_is_missing_is_written_and_no_other(drive, whole, tmp_path, labelled):
    run(drive, tmp_path / "out")
    before = runs.times(tmp_path / "out")
    labelled.clear()
    (tmp_path / "out/000004.npz").unlink()
    assert run(drive, tmp_path / "out").n_earlier == 5
    assert labelled == [3]
    assert {name for name, at in runs.times(tmp_path / "out").items() if before[name] != at} == {"000004.npz"}
    assert runs.contents(tmp_path / "out") == whole


def test_formats_that_are_added_are_made_of_the_stored_results(drive, whole, tmp_path, labelled):
    run(drive, tmp_path / "out", formats=("npz",))
    assert sorted(labelled) == [2, 3, 3]
    labelled.clear()
    assert run(drive, tmp_path / "out").n_done == N_FRAMES
    assert not labelled
    assert runs.contents(tmp_path / "out") == whole


def test_frames_that_are_added_end_with_the_same_bytes(drive, whole, tmp_path):
    run(drive, tmp_path / "out", frames=slice(0, 4))
    assert windows(tmp_path / "out") == ["012", "012", "012", "3"]
    assert run(drive, tmp_path / "out").n_earlier == 3
    assert runs.contents(tmp_path / "out") == whole


def test_other_frames_have_other_neighbours_and_are_labelled_again(drive, whole, tmp_path, labelled):
    out = tmp_path / "out"
    run(drive, out)
    run(drive, tmp_path / "at once", frames=slice(1, None))
    labelled.clear()
    assert run(drive, out, frames=slice(1, None)).n_earlier == 0
    assert sorted(labelled) == [1, 3, 3]
    assert windows(out) == ["012", *["123"] * 3, *["456"] * 3, "7"]
    at_once = runs.without_journal(tmp_path / "at once")
    assert {name: content for name, content in runs.without_journal(out).items() if name in at_once} == at_once
    assert any(at_once[name] != whole[name] for name in at_once)
    run(drive, out)
    assert runs.contents(out) == whole


def test_sweeps_are_a_setting(drive, tmp_path):
    run(drive, tmp_path / "out")
    with pytest.raises(BatchError, match=r"settings\.sweeps was 1, is 2"):
        run(drive, tmp_path / "out", sweeps=2)
    with pytest.raises(ParameterError, match="sweeps: got -1, expected 0 to 100"):
        batch.RunSettings(sweeps=-1)


@pytest.mark.parametrize(
    ("stamps", "expected"),
    [
        pytest.param([0.1 * k for k in range(7)], "012 345 6", id="in a row"),
        pytest.param([0, 0.1, 1.2, 1.3, 2.3, 2.4, 2.5], "01 234 56", id="gaps"),
        pytest.param([0.2 + k for k in range(7)], "012 345 6", id="a second apart"),
        pytest.param([5, 5.1, 4, 4.1, 4.1, 4.2, 4.3], "01 23 456", id="back, and twice"),
        pytest.param([0, None, 0.2, 0.3, None, 9, 9.1], "012 34 56", id="not known"),
    ],
)
def test_windows_end_where_time_does_not_go_on(stamps, expected):
    chosen = tuple((k, str(k)) for k in range(7))
    found = windows_of(chosen, stamps, 1)
    assert " ".join("".join(name for _, name in window) for window in found) == expected
    assert windows_of(chosen, stamps, 0) == [(frame,) for frame in chosen]
    assert windows_of(chosen[::3], stamps, 0) == [(frame,) for frame in chosen[::3]]


def test_a_gap_in_a_drive_ends_a_window(tmp_path):
    drive = drives.small_drive(tmp_path / "drive", 5)
    lines = [0, 0.1, 1.5, 1.6, 1.7]
    (drive / "times.txt").write_text("".join(f"{stamp:e}\n" for stamp in lines))
    run(drive, tmp_path / "out")
    assert windows(tmp_path / "out") == ["01", "01", "234", "234", "234"]


def test_sweeps_that_are_all_alone_are_warned_of(tmp_path):
    drive = drives.small_drive(tmp_path / "drive", 4, period_s=2.0)
    said = r"no sweep comes later than .* by 1 s or less \(median gap 2 s\), .*; are stamps in seconds, and frames of"
    # there are no poses in such a gap, but for those at the stamps
    with pytest.warns(LdlsWarning, match=said) as caught:
        assert run(drive, tmp_path / "out").n_done == 4
    assert caught[0].filename == __file__
    assert windows(tmp_path / "out") == ["0", "1", "2", "3"]
    run(drive, tmp_path / "out", frames=slice(1))
    run(drive, tmp_path / "alone", sweeps=0)


@pytest.mark.parametrize("settings", [{}, {"sweeps": 0, "track": True}])
def test_without_poses_nothing_is_begun(tmp_path, settings):
    drive = drives.small_drive(tmp_path / "drive", 2, poses=False)
    whence = r"they come with poses\.txt and times\.txt; else give --poses FILE, or --poses kiss-icp"
    with pytest.raises(PoseError, match=rf"kitti-odometry\) have no poses, .*; {whence}"):
        run(drive, tmp_path / "out", **settings)
    (drive / "times.txt").unlink()
    with pytest.raises(
        PoseError, match=r"have no stamps, expected them and poses \(they come with poses\.txt and times"
    ):
        run(drive, tmp_path / "out", **settings)
    (drive / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n" * 2)
    with pytest.raises(
        PoseError, match=r"poses \(those of poses\.txt come with times\.txt, which is not in the folder\)"
    ):
        run(drive, tmp_path / "out", **settings)
    assert not (tmp_path / "out").exists()


@pytest.fixture
def gap(simulated, tmp_path):
    """The simulated drive, whose poses are those of the first two sweeps."""
    drive = shutil.copytree(simulated.parent, tmp_path / "gap" / simulated.parent.name) / simulated.name
    for path in sorted(drive.glob("oxts/data/*.txt"))[2:]:
        path.unlink()
    return drive


def test_poses_of_the_source_are_read_only_where_none_are_given(gap, simulated, tmp_path):
    masks, path = str(gap / "masks_02"), tmp_path / "poses.txt"
    with pytest.raises(PoseError, match="0000000002: stamp: no pose at .*; or leave poses out by --option poses=false"):
        open_source(gap)[2]
    assert run(gap, tmp_path / "plain", masks=masks, sweeps=0).n_done == 2
    summary = batch.run(gap, tmp_path / "none", batch.RunSettings(masks=masks), options={"poses": False})
    assert summary.n_done == 5
    stamps = open_source(simulated, truth=False).stamps
    path.write_text("".join(f"{stamp:.6f} {0.1 * k} 0 0 0 0 0 1\n" for k, stamp in enumerate(stamps)))
    (gap / "oxts/data/0000000000.txt").write_bytes(b"")
    assert not run(gap, tmp_path / "given", masks=masks, poses=str(path)).failures
    read = runs.records(tmp_path / "given").values()
    assert not any("oxts" in path for record in read for path in record["inputs"])
    outcome = command(*runs.arguments(gap, tmp_path / "said", "--sweeps", 1, "--poses", path), "--masks", masks)
    assert outcome.exit_code == 0, outcome.output


def test_the_first_frame_that_can_be_read_tells_whether_there_are_poses(drive, tmp_path):
    (drive / "velodyne/000000.bin").write_bytes(b"x")
    assert run(drive, tmp_path / "out").n_done == 7


def test_a_frame_without_a_pose_fails_alone(drive, tmp_path):
    (tmp_path / "poses.txt").write_text(drives.tum_poses(5))
    summary = run(drive, tmp_path / "out", poses=str(tmp_path / "poses.txt"))
    assert [failure.frame for failure in summary.failures] == ["000005", "000006", "000007"]
    assert summary.failures[0].code == "pose" and "no pose at 0.5" in summary.failures[0].message
    assert windows(tmp_path / "out") == ["012", "012", "012", "34", "34"]


def test_a_frame_with_a_point_too_far_away_fails_alone(simulated, tmp_path):
    drive = shutil.copytree(simulated.parent, tmp_path / simulated.parent.name) / simulated.name
    path = sorted(drive.glob("velodyne_points/data/*.bin"))[1]
    points = np.fromfile(path, "<f4")
    points[4 * 7 + 1] = 1e30
    points.tofile(path)
    summary = run(drive, tmp_path / "out", masks=str(drive / "masks_02"))
    (failure,) = summary.failures
    assert failure.frame == path.stem and "points: row 7 has a coordinate of 1e+30 m" in failure.message
    assert summary.n_done == len(open_source(drive)) - 1


def test_poses_that_were_changed_are_noticed(drive, tmp_path):
    run(drive, tmp_path / "out")
    (drive / "poses.txt").write_text(drives.kitti_poses(N_FRAMES, step=1.1))
    with pytest.raises(BatchError, match=r"poses\.txt, of which frame 000000 was made, was changed since"):
        run(drive, tmp_path / "out")


def test_measurements_of_raw_drives_are_inputs_of_the_frames_beside_them(simulated, tmp_path):
    drive = shutil.copytree(simulated.parent, tmp_path / simulated.parent.name) / simulated.name
    run(drive, tmp_path / "out", masks=str(drive / "masks_02"))
    path = drive / "oxts/data/0000000003.txt"
    path.write_text(path.read_text() + "\n")
    with pytest.raises(BatchError, match=r"0000000003\.txt, of which frame 000000000[234] was made, was changed"):
        run(drive, tmp_path / "out", masks=str(drive / "masks_02"))


@pytest.mark.parametrize("write", [drives.tum_poses, drives.kitti_poses])
def test_a_file_of_poses_stands_for_those_of_the_source(drive, whole, tmp_path, write):
    shutil.move(drive / "poses.txt", tmp_path / "unused.txt")
    (tmp_path / "given.txt").write_text(write(N_FRAMES))
    outcome = command(*words(drive, tmp_path / "out", "--poses", tmp_path / "given.txt"))
    assert outcome.exit_code == 0, outcome.output
    assert windows(tmp_path / "out") == ["012"] * 3 + ["345"] * 3 + ["67"] * 2
    for name in ("000003.label", "000006.label"):
        assert (tmp_path / "out" / name).read_bytes() == whole[name]
    (tmp_path / "given.txt").write_text(write(N_FRAMES, step=1.1))
    outcome = command(*words(drive, tmp_path / "out", "--poses", tmp_path / "given.txt"))
    assert outcome.exit_code == 1
    assert "settings.poses_sha256 was" in outcome.output


def test_odometry_stands_for_poses_and_is_kept(simulated, tmp_path):
    pytest.importorskip("kiss_icp", reason="the extra odometry is not installed")
    drive = shutil.copytree(simulated.parent, tmp_path / simulated.parent.name) / simulated.name
    shutil.rmtree(drive / "oxts")
    for clock in drive.glob("*/timestamps.txt"):
        clock.unlink()
    settings = {"masks": str(drive / "masks_02"), "poses": "kiss-icp"}
    run(drive, tmp_path / "out", **settings)
    kept = ldls.read_poses(tmp_path / "out/poses.txt")
    expected = odometry_of(open_source(drive))
    np.testing.assert_array_equal(kept.stamps, expected.stamps)
    np.testing.assert_allclose(kept.poses, expected.poses, atol=1e-12)
    assert windows(tmp_path / "out") == ["012"] * 3 + ["34"] * 2
    before = (tmp_path / "out/poses.txt").stat().st_mtime_ns
    assert run(drive, tmp_path / "out", **settings).n_earlier == 5
    assert (tmp_path / "out/poses.txt").stat().st_mtime_ns == before


def test_a_sweep_that_odometry_cannot_use_fails_alone_or_is_between_the_others(simulated, tmp_path):
    pytest.importorskip("kiss_icp", reason="the extra odometry is not installed")
    drive = shutil.copytree(simulated.parent, tmp_path / simulated.parent.name) / simulated.name
    name = open_source(drive).names[3]
    settings = {"masks": str(drive / "masks_02"), "poses": "kiss-icp"}
    path = drive / f"velodyne_points/data/{name}.bin"
    said = rf"1 of 5 frames \({name}\) are left out of the way of the lidar; {name}: "
    path.write_bytes(b"x")
    with pytest.warns(LeftOutWarning, match=said):
        summary = run(drive, tmp_path / "out", **settings)
    assert [failure.frame for failure in summary.failures] == [name] and summary.n_done == 4
    layouts.write_points(path, np.full((9, 4), np.nan, "<f4"))
    with pytest.warns() as caught:
        summary = run(drive, tmp_path / "other", **settings)
    assert {warning.category for warning in caught} == {LeftOutWarning, NothingInView}
    assert summary.n_done == 5
    placed = {frame: np.array(record["pose"]) for frame, record in runs.records(tmp_path / "other").items()}
    before, after = (placed[frame][:3, 3] for frame in open_source(drive).names[2::2])
    np.testing.assert_allclose(placed[name][:3, 3], (before + after) / 2, atol=1e-6)


def test_a_sweep_at_an_end_that_is_mended_needs_another_folder(simulated, tmp_path):
    pytest.importorskip("kiss_icp", reason="the extra odometry is not installed")
    drive = shutil.copytree(simulated.parent, tmp_path / simulated.parent.name) / simulated.name
    name = open_source(drive).names[-1]
    settings = {"masks": str(drive / "masks_02"), "poses": "kiss-icp"}
    path = drive / f"velodyne_points/data/{name}.bin"
    whole = path.read_bytes()
    path.write_bytes(b"x")
    with pytest.warns(LeftOutWarning, match="1 of 5 frames"):
        run(drive, tmp_path / "out", **settings)
    path.write_bytes(whole)
    (failure,) = run(drive, tmp_path / "out", **settings).failures
    assert failure.frame == name
    assert re.search(r"poses\.txt: stamp: no pose at .* give another --out to find the way anew", failure.message)
    assert run(drive, tmp_path / "other", **settings).n_done == 5


def test_a_file_of_poses_needs_no_first_sweep(drive, tmp_path):
    (tmp_path / "given.txt").write_text(drives.kitti_poses(N_FRAMES))
    (drive / "velodyne/000000.bin").write_bytes(b"x")
    summary = run(drive, tmp_path / "out", poses=str(tmp_path / "given.txt"))
    assert summary.n_done == N_FRAMES - 1 and [failure.frame for failure in summary.failures] == ["000000"]


def test_frames_without_times_are_not_silently_given_those_of_ten_a_second(drive, tmp_path):
    path = tmp_path / "given.txt"
    (drive / "times.txt").unlink()
    path.write_text(drives.tum_poses(N_FRAMES, period_s=0.5))
    with pytest.warns(
        LdlsWarning, match=r"given\.txt: frames of .* taken 0\.1 s apart from 0; .* 0\.0+ to 3\.50+ s; add"
    ) as caught:
        assert run(drive, tmp_path / "out", poses=path).n_done == N_FRAMES
    assert caught[0].filename == __file__
    path.write_text("".join(f"{1767528000 + 0.1 * k:.6f} {0.3 * k:.6f} 0 0 0 0 0 1\n" for k in range(N_FRAMES)))
    with pytest.raises(PoseError, match=r"poses from 1767528000\.0+ to .*, which is at none of the frames; add stamps"):
        run(drive, tmp_path / "none", poses=str(path))
    assert not (tmp_path / "none").exists()
    (drive / "times.txt").write_text("".join(f"{0.1 * k}\n" for k in range(N_FRAMES)))
    with pytest.raises(PoseError, match=r"are from 0\.0+ to 0\.7.* at none of the frames; give poses by the clock"):
        run(drive, tmp_path / "none", poses=str(path))
    (drive / "times.txt").unlink()
    path.write_text(drives.kitti_poses(N_FRAMES))
    assert run(drive, tmp_path / "kitti", poses=str(path)).n_done == N_FRAMES


@pytest.mark.parametrize("missing", ["velodyne/000003.bin", "image_2/000003.png"])
def test_a_file_of_poses_may_have_those_of_frames_that_are_left_out(drive, tmp_path, missing):
    path = tmp_path / "given.txt"
    path.write_text(drives.kitti_poses(N_FRAMES))
    (drive / missing).unlink()
    part = missing.split("/")[0]
    # a sweep that is not there is not missed; an image is
    opening = (lambda: pytest.warns(LeftOutWarning)) if part == "image_2" else nullcontext
    with opening():
        assert not run(drive, tmp_path / "out", poses=str(path)).failures
    assert runs.records(tmp_path / "out")["000004"]["pose"][0][3] == pytest.approx(4 * drives.STEP_M)
    lines = path.read_text().splitlines(keepends=True)
    del lines[3]
    path.write_text("".join(lines))
    with opening():
        assert not run(drive, tmp_path / "kept", poses=str(path)).failures
    assert runs.records(tmp_path / "kept")["000004"]["pose"][0][3] == pytest.approx(4 * drives.STEP_M)
    path.write_text("".join(lines[:-1]))
    expected = rf"has 6 poses for the 7 frames of .*, which left out 1 \(1 no {part}\), expected .* out \(000003\)"
    with opening(), pytest.raises(PoseError, match=expected):
        run(drive, tmp_path / "none", poses=str(path))


def test_a_file_of_poses_of_another_drive_is_refused(drive, tmp_path):
    (tmp_path / "given.txt").write_text(drives.kitti_poses(3))
    with pytest.raises(PoseError, match=r"given\.txt: has 3 poses for 8 stamps, expected a line for each"):
        run(drive, tmp_path / "out", poses=str(tmp_path / "given.txt"))
    (tmp_path / "given.txt").write_text("1 2 3\n")
    with pytest.raises((InputError, ValueError), match=r"given\.txt"):
        run(drive, tmp_path / "out", poses=str(tmp_path / "given.txt"))
    with pytest.raises(FileNotFoundError, match=r"kissicp: no such file, expected a file of poses by .*, or kiss-icp"):
        run(drive, tmp_path / "out", poses="kissicp")
    with pytest.raises(FileNotFoundError, match=r": a folder, expected a file of poses by TUM or KITTI"):
        run(drive, tmp_path / "out", poses=str(tmp_path))
    assert not (tmp_path / "out").exists()


def test_the_command_takes_sweeps_of_two(drive, tmp_path):
    outcome = command(*runs.arguments(drive, tmp_path / "out"), "--sweeps", "2")
    assert outcome.exit_code == 0, outcome.output
    assert windows(tmp_path / "out") == ["01234"] * 5 + ["567"] * 3
    outcome = command(*runs.arguments(drive, tmp_path / "out"), "--sweeps", "-1")
    assert outcome.exit_code == 2


@pytest.fixture
def timed(simulated, tmp_path):
    """The simulated drive with the times at which its sweeps begin and end."""
    drive = shutil.copytree(simulated.parent, tmp_path / "timed" / simulated.parent.name) / simulated.name
    stamps = [np.datetime64(line.replace(" ", "T"), "ns") for line in _lines(drive / "velodyne_points/timestamps.txt")]
    for name, later_ms in (("start", -50), ("end", 50)):
        lines = [str(stamp + np.timedelta64(later_ms, "ms")).replace("T", " ") for stamp in stamps]
        (drive / f"velodyne_points/timestamps_{name}.txt").write_text("".join(f"{line}\n" for line in lines))
    return drive


def _lines(path):
    return path.read_text().splitlines()


@pytest.mark.parametrize("sweeps", [0, 1])
def test_motion_within_a_sweep_is_taken_out_before_points_are_labelled(timed, tmp_path, sweeps):
    run(timed, tmp_path / "out", masks=str(timed / "masks_02"), sweeps=sweeps)
    for frame in open_source(timed, truth=False):
        points = ldls.read_result(tmp_path / f"out/{frame.name}.npz").points
        np.testing.assert_array_equal(points, frame.trajectory.deskew(frame.points, frame.times, frame.stamp))
        assert np.abs(points - frame.points).max() > 0.05


def test_a_file_of_poses_takes_motion_out_in_place_of_the_source(timed, tmp_path):
    source = open_source(timed, truth=False)
    stamps = np.array(source.stamps)
    way = "".join(f"{stamp:.6f} {2 * (stamp - stamps[0]):.6f} 0 0 0 0 0 1\n" for stamp in stamps)
    (tmp_path / "given.txt").write_text(way)
    run(timed, tmp_path / "out", masks=str(timed / "masks_02"), sweeps=0, poses=str(tmp_path / "given.txt"))
    for frame in source:
        points = ldls.read_result(tmp_path / f"out/{frame.name}.npz").points
        expected = frame.points.astype(float)
        expected[:, 0] += 2 * frame.times
        np.testing.assert_allclose(points, expected, atol=1e-5)


def test_poses_of_a_drive_that_say_nothing_of_a_sweep_can_be_left_out(timed, tmp_path):
    # the fourth measurement comes 1.5 s after the third, at the stamp of its sweep
    for clock in timed.glob("*/timestamps*.txt"):
        stamps = [np.datetime64(line.replace(" ", "T"), "ns") for line in _lines(clock)]
        stamps[3:] = [stamp + np.timedelta64(1400, "ms") for stamp in stamps[3:]]
        clock.write_text("".join(f"{str(stamp).replace('T', ' ')}\n" for stamp in stamps))
    masks = str(timed / "masks_02")
    failures = run(timed, tmp_path / "out", masks=masks, sweeps=0).failures
    assert [failure.frame[-1] for failure in failures] == ["2", "3"]
    for failure in failures:
        said = rf"^poses of {timed}: stamp: no pose .* gap of 1\.500 s .*; or leave poses out by --option poses=false"
        assert re.search(said, failure.message)
    settings = batch.RunSettings(masks=masks)
    assert not batch.run(timed, tmp_path / "left out", settings, options={"poses": False}).failures


def test_poses_that_say_nothing_of_a_sweep_fail_its_frame_alone(timed, tmp_path):
    source = open_source(timed, truth=False)
    # from the third sweep on; the first two lie before all of them
    way = "".join(f"{stamp:.6f} {0.1 * k} 0 0 0 0 0 1\n" for k, stamp in enumerate(source.stamps[2:]))
    (tmp_path / "given.txt").write_text(way)
    run(timed, tmp_path / "out", masks=str(timed / "masks_02"), sweeps=0, poses=str(tmp_path / "given.txt"))
    failed = {name: record["error"] for name, record in runs.records(tmp_path / "out").items() if "error" in record}
    assert [name[-1] for name in failed] == ["0", "1"]
    assert all("given.txt: stamp: no pose at" in error["message"] for error in failed.values())
