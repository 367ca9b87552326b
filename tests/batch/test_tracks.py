"""The tracks of a run: what the tracker says of the stored results, whole or not there, and done again when need be."""

import csv
import json
import re
import shutil
import signal
import sys
from collections import Counter
from contextlib import nullcontext

import numpy as np
import pytest

import ldls
from batch import drives, runs
from command import command
from datasets import layouts
from ldls import batch
from ldls.batch import frame_work, journal, run_tracks
from ldls.batch.known_files import is_written
from ldls.batch.poses import Poses
from ldls.datasets import open_source
from ldls.errors import (
    ChangedFileWarning,
    LdlsWarning,
    LeftOutWarning,
    LimitError,
    ParameterError,
    PoseError,
    UnsafePathError,
    UnsupportedFormatError,
)
from ldls.io.labels import read_labeling, write_labeling


def run(drive, out, **settings):
    of_run = {name: settings.pop(name) for name in ("frames", "objects") if name in settings}
    settings = {"masks": str(drive / "masks"), "sweeps": 1, "track": True, "formats": ("npz",), **settings}
    return batch.run(drive, out, batch.RunSettings(**settings), **of_run)


def rows(out):
    with (out / "tracks.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def tracks(out):
    """The files of the tracks."""
    return {name: content for name, content in runs.contents(out).items() if name.startswith("tracks")}


def run_with_map(drive, out, path, **settings):
    settings = runs.stored(drive, sweeps=1, formats=("npz",), **settings)
    return batch.run(drive, out, settings, map_file=path)


@pytest.fixture
def tracked(drive, tmp_path):
    """A finished run, and the files of its tracks."""
    run(drive, tmp_path / "out")
    return tmp_path / "out", tracks(tmp_path / "out")


@pytest.fixture
def numbered(monkeypatch):
    """The sweeps that are tracked together each time from now on."""
    done = []

    class Noted(ldls.Tracker):
        def track(self, sweeps, results):
            done.append(len(sweeps))
            return super().track(sweeps, results)

    monkeypatch.setattr(run_tracks, "Tracker", Noted)
    return done


@pytest.mark.parametrize("sweeps", [0, 1])
def test_tracks_are_those_of_the_tracker_window_by_window(simulated, tmp_path, sweeps):
    out = tmp_path / "out"
    summary = run(simulated, out, masks=str(simulated / "masks_02"), sweeps=sweeps)
    source, tracker = open_source(simulated, truth=False), ldls.Tracker()
    found = iter(rows(out))
    for window in ((0, 1, 2), (3, 4)) if sweeps else ((0,), (1,), (2,), (3,), (4,)):
        results = [ldls.read_result(out / f"{source.names[index]}.npz") for index in window]
        placed = [ldls.Sweep(source[k].points, (), source[k].pose, source[k].stamp) for k in window]
        for index, sweep, result in zip(window, placed, tracker.track(placed, results), strict=True):
            ldls.save(result, tmp_path / "one.label")
            path = out / f"tracks/{source.names[index]}.label"
            assert path.read_bytes() == (tmp_path / "one.label").read_bytes()
            assert ldls.read_result(path.with_suffix(".npz")).instances == result.instances
            numbers = {instance.label: instance.track for instance in result.instances}
            read = read_labeling(path).instances
            np.testing.assert_array_equal(read, [numbers.get(label, 0) for label in result.labels.tolist()])
            for each in result.objects:
                if each.n_points:
                    row = next(found)
                    world = sweep.pose @ [*each.centroid, 1]
                    assert (row["frame"], int(row["track"])) == (source.names[index], numbers[each.label])
                    assert (int(row["label"]), int(row["category"]), row["name"]) == (
                        each.label, each.category, each.name,
                    )  # fmt: skip
                    assert int(row["n_points"]) == each.n_points
                    place = [float(row[f"world_{axis}_m"]) for axis in "xyz"]
                    np.testing.assert_allclose(place, world[:3], atol=1e-4)
                    velocity = [float(row[f"velocity_{axis}_m_s"]) for axis in "xy"]
                    np.testing.assert_allclose(velocity, result.instances[each.label - 1].velocity, atol=1e-4)
    assert next(found, None) is None
    last_names = {row["track"]: row["name"] for row in rows(out)}
    assert summary.tracks == Counter(last_names.values())
    assert summary.objects == Counter(row["name"] for row in rows(out))
    assert summary.tracks["car"] < summary.objects["car"]
    by_frame = [{row["track"] for row in rows(out) if row["frame"] == name} for name in source.names]
    assert len(set.intersection(*by_frame)) >= 3, "objects go on as themselves over all windows"


@pytest.mark.parametrize("sweeps", [0, 1])
def test_masks_that_number_classes_anew_in_each_frame_have_the_same_tracks(drive, tmp_path, sweeps):
    expected = run(drive, tmp_path / "expected", sweeps=sweeps)
    for number, path in enumerate(sorted((drive / "masks").iterdir())):
        masks = ldls.read_masks(path)
        names = [*sorted({mask.name for mask in masks}), "cone", "drum"][:: 1 if number % 2 else -1]
        table = {100 + place: name.upper() if number % 3 else name for place, name in enumerate(names)}
        categories = [100 + names.index(mask.name) for mask in masks]
        rles = [mask.rle for mask in masks]
        ldls.save(ldls.InstanceMasks(rles, masks.image_size, categories=categories, names=table), path)
    summary = run(drive, tmp_path / "out", sweeps=sweeps)
    assert summary.tracks == expected.tracks and summary.objects == expected.objects and len(summary.objects) == 2
    known, found = rows(tmp_path / "expected"), rows(tmp_path / "out")
    for one, other in zip(known, found, strict=True):
        assert [one[name] for name in ("frame", "track", "name")] == [
            other[name] for name in ("frame", "track", "name")
        ]
    assert len({(row["category"], row["name"]) for row in found}) == 2


def test_results_with_tracks_are_in_the_formats_that_name_instances(drive, tmp_path):
    out, formats = tmp_path / "out", ("panoptic", "lidarseg", "png")
    run(drive, out, formats=formats, frames=slice(3))
    both = {f"tracks/{k:06d}{ending}" for k in range(3) for ending in (".label", "_panoptic.npz")}
    of_all = {"tracks.csv", "tracks/objects.jsonl", "tracks/tracks.json"}
    assert {*tracks(out)} == both | of_all
    run(drive, out, formats=("csv",), frames=slice(3))
    assert {*tracks(out)} - {*both} == {f"tracks/{k:06d}.csv" for k in range(3)} | of_all
    assert {*both} < {*tracks(out)}, "files that are there stay"


def test_files_of_every_format_score_the_same(simulated, tmp_path):
    run(simulated, tmp_path / "out", masks=str(simulated / "masks_02"), formats=("npz", "panoptic"))
    (tmp_path / "truth").mkdir()
    for frame in open_source(simulated):
        write_labeling(tmp_path / f"truth/{frame.name}.npz", frame.truth)
    tracked = tmp_path / "out/tracks"
    words = [
        f"npz:{tracked}",
        tmp_path / "truth",
        *(f"--beside={word}={word}:{tracked}" for word in ("label", "panoptic")),
    ]
    outcome = command("evaluate", *words, "--name", "npz", "--track", "--out", tmp_path / "t")
    assert outcome.exit_code == 0, outcome.output
    found = {word: {} for word in ("npz", "label", "panoptic")}
    for row in json.loads((tmp_path / "t/tracking.json").read_text())["rows"]:
        found[row.pop("method")][row["class"]] = row
    assert found["npz"] == found["label"] == found["panoptic"]
    assert found["npz"]["Car"]["S_assoc"] > 60


@pytest.fixture
def overlooked(drive):
    """The drive with a frame whose image shows nothing of the objects that the tracker knows, and a broken one."""
    path = drive / "masks/000005.json"
    ldls.save(ldls.InstanceMasks([], ldls.read_masks(path).image_size), path)
    (drive / "velodyne/000006.bin").write_bytes(b"x")
    return drive


@pytest.mark.parametrize("frames", [slice(None), slice(2, 7)])
@pytest.mark.parametrize("earlier", [None, {"track": False}, {"track": True, "formats": ("label",)}])
def test_the_table_of_objects_is_that_of_the_tracked_results(overlooked, tmp_path, frames, earlier):
    out = tmp_path / "out"
    if earlier is not None:
        run(overlooked, out, sweeps=0, **earlier)
    for name in ("objects.csv", "objects.json"):
        summary = run(overlooked, out, sweeps=0, frames=frames, objects=tmp_path / name)
        files = {f"{k:06d}": out / f"tracks/{k:06d}.npz" for k in range(8)[frames] if k != 6}
        results = {frame: ldls.read_result(file) for frame, file in files.items()}
        ldls.save_objects(results, tmp_path / f"expected-{name}")
        assert (tmp_path / name).read_bytes() == (tmp_path / f"expected-{name}").read_bytes()
    assert len(results["000005"].to_table()) == 2, "of objects that no mask shows"
    assert summary.objects == Counter(row["name"] for result in results.values() for row in result.to_table())


def test_tracks_are_counted_in_the_frames_that_were_chosen(drive, tmp_path):
    for k in range(4, 8):
        path = drive / f"masks/{k:06d}.json"
        ldls.save(ldls.read_masks(path).filter(categories=["car"]), path)
    assert run(drive, tmp_path / "out", sweeps=0).tracks.keys() == {"car", "person"}
    assert run(drive, tmp_path / "out", sweeps=0, frames=slice(7, 8)).tracks == {"car": 1}


def test_a_map_holds_what_the_tracked_results_leave_standing(drive, tmp_path):
    place = tmp_path / "out/map.ply"
    run_with_map(drive, tmp_path / "out", place, track=True)
    before = place.read_bytes()
    source, tracker, places = open_source(drive, truth=False), ldls.Tracker(), ldls.LabelledMap()
    for window in ((0, 1, 2), (3, 4, 5), (6, 7)):
        results = [ldls.read_result(tmp_path / f"out/{source.names[index]}.npz") for index in window]
        placed = [ldls.Sweep(source[k].points, (), source[k].pose, source[k].stamp) for k in window]
        for sweep, result in zip(placed, tracker.track(placed, results), strict=True):
            places.add(sweep, result)
    assert len(places) > 100
    ldls.save(places, tmp_path / "expected.ply")
    assert before == (tmp_path / "expected.ply").read_bytes()
    place.unlink()
    run_with_map(drive, tmp_path / "out", place, track=True)
    assert place.read_bytes() == before, "of what earlier runs did, too"


def test_a_map_without_tracks_or_of_no_format_is_refused_before_anything_is_done(drive, tmp_path):
    with pytest.raises(ParameterError, match=r"map_file: .*map\.ply is without what moves, .* add --track"):
        run_with_map(drive, tmp_path / "out", tmp_path / "map.ply")
    with pytest.raises(UnsupportedFormatError, match=r"cannot write '\.xyz' maps"):
        run_with_map(drive, tmp_path / "out", tmp_path / "map.xyz", track=True)
    with pytest.raises(FileNotFoundError, match="no such folder to write to"):
        run_with_map(drive, tmp_path / "out", tmp_path / "nowhere/map.ply", track=True)
    assert not (tmp_path / "out").exists()


def test_a_finished_run_is_not_tracked_again(drive, tracked, numbered):
    out, before = tracked
    run(drive, out)
    assert numbered == []
    assert tracks(out) == before


def test_tracks_of_labels_that_a_run_without_them_replaces_are_removed(drive, tmp_path):
    out = tmp_path / "out"
    run(drive, out, frames=slice(0, 6))
    (out / "tracks/notes.txt").write_text("the user's own")
    run(drive, out, frames=slice(6, 8), track=False)
    run(drive, out, frames=slice(0, 6), track=False, formats=("label",))
    assert len(rows(out)) > 0, "those of labels that are the same stay"
    with pytest.warns(LdlsWarning, match=r"labelled together with others .* removed tracks/ .*--track") as caught:
        run(drive, out, frames=slice(1, 6), track=False)
    assert [warning.filename for warning in caught] == [__file__]
    assert tracks(out) == {"tracks/notes.txt": b"the user's own"}


@pytest.mark.parametrize("name", ["tracks/000004.label", "tracks.csv", "tracks/objects.jsonl", "tracks/tracks.json"])
@pytest.mark.parametrize("change", ["missing", "changed"])
def test_tracks_that_are_not_whole_are_made_again(drive, tracked, numbered, name, change):
    out, before = tracked
    (out / name).unlink()
    if change == "changed":
        (out / name).write_text("{")
    (out / "tracks/.left.ldls-part").write_text("of a killed run")
    run(drive, out)
    assert numbered == [3, 3, 2]
    assert tracks(out) == before


def test_tracks_are_those_of_all_frames_that_are_done(drive, tracked, tmp_path, numbered):
    _, before = tracked
    parts = tmp_path / "parts"
    run(drive, parts, frames=slice(0, 3))
    assert {row["frame"] for row in rows(parts)} == {"000000", "000001", "000002"}
    run(drive, parts, frames=slice(3, None))
    assert numbered == [3, 3, 3, 2]
    assert tracks(parts) == before


DAMAGES = {
    "of another frame": lambda path: shutil.copy(path.with_name("000004.npz"), path),
    "cut off": lambda path: path.write_bytes(path.read_bytes()[:-100]),
    "missing": lambda path: path.unlink(),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_tracks_and_map_are_made_of_results_as_the_run_wrote_them_alone(drive, tracked, tmp_path, damage, numbered):
    out, settings = tmp_path / "parts", runs.stored(drive, sweeps=1, formats=("npz",), track=True)
    run(drive, out, frames=slice(0, 6), track=False)
    DAMAGES[damage](out / "000005.npz")
    said = r"parts: results \(\.npz\) of 1 frames outside --frames \(000005\) are missing, .*; run them again"
    with pytest.warns(LeftOutWarning, match=said) as caught:
        batch.run(drive, out, settings, frames=slice(6, 8), map_file=tmp_path / "map.ply")
    assert [warning.filename for warning in caught] == [__file__]
    assert numbered == [3, 2, 2]
    assert "000005" not in {row["frame"] for row in rows(out)} and not (out / "tracks/000005.label").exists()
    with nullcontext() if damage == "missing" else pytest.warns(ChangedFileWarning, match="000005"):
        batch.run(drive, out, settings, map_file=tmp_path / "map.ply")
    assert runs.contents(out) == runs.contents(tracked[0])
    run_with_map(drive, tracked[0], tmp_path / "expected.ply", track=True)
    assert (tmp_path / "map.ply").read_bytes() == (tmp_path / "expected.ply").read_bytes()


def test_digests_of_results_are_read_once(drive, tracked, monkeypatch):
    read = []
    for module in (frame_work, journal):
        monkeypatch.setattr(module, "is_written", lambda path, state: read.append(path.name) or is_written(path, state))
    run(drive, tracked[0], frames=slice(0, 3))
    assert sorted(read) == [f"{number:06d}.npz" for number in range(8)]


def test_tracks_may_be_added_to_a_finished_run(drive, tracked, tmp_path):
    later = tmp_path / "later"
    run(drive, later, track=False)
    assert not tracks(later)
    run(drive, later)
    assert runs.contents(later) == runs.contents(tracked[0])


def test_frames_that_failed_are_passed_over(drive, tmp_path, numbered):
    sound = (drive / "velodyne/000004.bin").read_bytes()
    (drive / "velodyne/000004.bin").write_bytes(b"x")
    assert run(drive, tmp_path / "out").n_done == 7
    assert numbered == [3, 2, 2]
    assert not (tmp_path / "out/tracks/000004.label").exists()
    (drive / "velodyne/000004.bin").write_bytes(sound)
    run(drive, tmp_path / "out")
    assert numbered == [3, 2, 2, 3, 3, 2]
    assert (tmp_path / "out/tracks/000004.label").exists()


def test_a_frame_without_a_pose_is_left_out_where_each_is_alone(drive, tmp_path):
    (drive / "times.txt").unlink()
    (drive / "times.txt").write_text("".join(f"{0.1 * k:e}\n" for k in range(8)))
    (tmp_path / "poses.txt").write_text(drives.tum_poses(8))
    out = tmp_path / "out"
    run(drive, out, sweeps=0, poses=str(tmp_path / "poses.txt"))
    journal = (out / "journal.jsonl").read_text()
    line = next(line for line in journal.splitlines() if '"frame":"000005"' in line)
    (out / "journal.jsonl").write_text(journal.replace(line, re.sub(r'"pose":\[\[.*?\]\]', '"pose":null', line)))
    with pytest.warns(LeftOutWarning, match=r"1 frames \(000005\) have no pose") as caught:
        run(drive, out, sweeps=0, poses=str(tmp_path / "poses.txt"), objects=tmp_path / "objects.csv")
    assert caught[0].filename == __file__
    with (tmp_path / "objects.csv").open(newline="") as file:
        found = {(row["frame"], row["track"] != "0") for row in csv.DictReader(file)}
    assert found == {(f"{k:06d}", k != 5) for k in range(8)}, "its objects are in the table without tracks"
    assert not (out / "tracks/000005.label").exists() and (out / "tracks/000006.label").exists()


@pytest.mark.parametrize(("step", "n"), [("file renamed", 19), ("file synced, not renamed", 16)])
def test_killed_while_tracks_are_written(drive, tracked, tmp_path, step, n):
    out = tmp_path / "killed"
    words = runs.arguments(drive, out, "--sweeps", 1, "--track", "--formats", "npz")
    killed = runs.killed(step, n, words)
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    assert not (out / "tracks/tracks.json").exists()
    outcome = command(*words)
    assert outcome.exit_code == 0, outcome.output
    assert f"tracks in {out / 'tracks'}" in outcome.output
    assert re.search(r"category +\S objects +\S tracks", outcome.output)
    assert runs.contents(out) == runs.contents(tracked[0])


def test_more_objects_than_sixteen_bits_number(drive, tmp_path, monkeypatch):
    monkeypatch.setattr(run_tracks, "MOST_TRACKS", 1)
    with pytest.raises(LimitError, match=r"more than 1 objects up to frame 000000, .* --frames"):
        run(drive, tmp_path / "out")
    assert not (tmp_path / "out/tracks.csv").exists()


def test_without_scipy_nothing_is_begun(drive, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "scipy.optimize", None)
    with pytest.raises(ImportError, match=r"pip install 'ldls\[eval\]'"):
        run(drive, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_sweeps_in_disorder_are_refused_before_anything_is_done(drive, tmp_path):
    stamps = [0, 0.1, 0.2, 0.25, 0.24, 0.5, 0.6, 0.7]
    (drive / "times.txt").write_text("".join(f"{stamp:e}\n" for stamp in stamps))
    (drive / "poses.txt").unlink()
    (tmp_path / "poses.txt").write_text(drives.tum_poses(8))
    said = r"frame 000004 \(0\.240000 s\) comes after 000003 .*; mend the stamps of the source$"
    with pytest.raises(PoseError, match=said):
        run(drive, tmp_path / "out", poses=str(tmp_path / "poses.txt"))
    assert not (tmp_path / "out").exists()


def test_scenes_in_disorder_are_told_of_the_option_that_takes_one(tmp_path):
    source = open_source(layouts.nuscenes(tmp_path))
    source.stamps = source.stamps[::-1]
    chosen = tuple(enumerate(source.names))
    settings = batch.RunSettings(masks="masks", track=True)
    with pytest.raises(PoseError, match="comes after .*; take one drive by --option scene=NAME"):
        Poses(source, settings).check(chosen)


def test_two_frames_of_one_stamp_are_not_tracked_and_begin_a_window_without_tracks(drive, tmp_path):
    stamps = [0, 0.1, 0.2, 0.3, 0.3, 0.5, 0.6, 0.7]
    (drive / "times.txt").write_text("".join(f"{stamp:e}\n" for stamp in stamps))
    with pytest.raises(PoseError, match=r"poses\.txt: line 4 is the pose at 0\.3.* line 5 that at 0\.3.*; mend these"):
        run(drive, tmp_path / "out")
    (drive / "poses.txt").unlink()
    (tmp_path / "poses.txt").write_text(drives.tum_poses(8))
    said = r"frames 000003 and 000004 have one stamp \(0\.3.* mend the stamps of the source, or take one"
    with pytest.raises(PoseError, match=said):
        run(drive, tmp_path / "out", poses=str(tmp_path / "poses.txt"))
    settings = {"masks": str(drive / "masks"), "sweeps": 2, "poses": str(tmp_path / "poses.txt")}
    assert batch.run(drive, tmp_path / "out", batch.RunSettings(**settings)).n_done == 8


def test_a_link_in_the_place_of_the_tracks_is_not_followed(drive, tmp_path):
    run(drive, tmp_path / "out")
    (tmp_path / "elsewhere").mkdir()
    shutil.rmtree(tmp_path / "out/tracks")
    (tmp_path / "out/tracks").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(UnsafePathError, match="is a link"):
        run(drive, tmp_path / "out")
    assert not list((tmp_path / "elsewhere").iterdir())


def test_frames_whose_files_would_be_those_of_the_tracks(tmp_path):
    with pytest.raises(UnsafePathError, match="frame 'tracks'"):
        run_tracks.RunTracks(tmp_path, ["a", "Tracks"])


def test_a_note_that_names_other_files_has_nothing_removed(drive, tracked):
    out, before = tracked
    note = (out / "tracks/tracks.json").read_text()
    (out / "tracks/tracks.json").write_text(note.replace('"files": {', '"files": {"000001.npz": [0, ""],'))
    (out / "tracks.csv").unlink()
    run(drive, out)
    assert (out / "000001.npz").exists()
    assert tracks(out) == before
