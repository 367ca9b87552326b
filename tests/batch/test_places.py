"""A run writes over no file that no run in its folder wrote: it may be an input."""

import json
import shutil
from dataclasses import replace

import pytest

import ldls.batch.odometry as found_poses
from batch import drives, runs
from datasets import layouts
from ldls import batch, read_poses
from ldls.batch.lock import only_run
from ldls.datasets import open_source
from ldls.errors import BatchError, InputError, ParameterError, UnsafePathError
from ldls.io import read_masks, save

REASON = "which no run here wrote and the run would write over; an output is never written over an input"


def run(source, out, *formats, masks=None, **options):
    settings = batch.RunSettings(masks=str(masks or source / "masks"), formats=formats)
    return batch.run(source, out, settings, **options)


def as_npz(source):
    for path in sorted((source / "masks").glob("*.json")):
        save(read_masks(path), path.with_suffix(".npz"))
        path.unlink()
    return source / "masks"


@pytest.mark.parametrize(
    ("place", "word", "file"),
    [
        pytest.param(lambda source: source / "image_2", "png", r"000000\.png, .* and 4 more", id="images"),
        pytest.param(as_npz, "npz", r"000000\.npz, .* and 4 more", id="masks"),
        pytest.param(lambda source: source / "label_2", "kitti-boxes", r"000000\.txt, .* and 4 more", id="boxes"),
    ],
)
def test_files_of_others_are_refused_before_anything_is_done(few, place, word, file):
    out = place(few)
    before = runs.contents(few)
    with pytest.raises(BatchError, match=rf"{out.name}: holds {file}, {REASON}, so give another --out"):
        run(few, out, word)
    assert runs.contents(few) == before


def test_a_format_whose_places_are_taken_is_refused_when_it_is_added(few):
    images = runs.contents(few / "image_2")
    run(few, few / "image_2", "npz")
    with pytest.raises(BatchError, match=r"holds 000000\.png, "):
        run(few, few / "image_2", "npz", "png")
    assert runs.contents(few / "image_2").items() >= images.items()
    assert run(few, few / "image_2", "npz", "label").n_done == 12


def test_a_frame_that_is_not_asked_for_yet_keeps_its_place(few, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out/000007.npz").write_bytes(b"mine")
    with pytest.raises(BatchError, match=r"holds 000007\.npz, "):
        run(few, tmp_path / "out", "npz", frames=slice(0, 3))
    assert run(few, tmp_path / "out", "label").n_done == 12


def test_what_a_run_could_not_record_is_its_own(few, tmp_path):
    out = tmp_path / "out"
    run(few, out, "npz", "label")
    header, *lines = (out / "journal.jsonl").read_bytes().splitlines(keepends=True)
    # as a killed run leaves it: files of all frames, and no record, or those of some
    for kept in ([], lines[:5]):
        (out / "journal.jsonl").write_bytes(b"".join([header, *kept]))
        assert run(few, out, "npz", "label").n_earlier == len(kept)
    (out / "journal.jsonl").write_bytes(header)
    assert batch.run(few, out, runs.stored(few, sweeps=0, min_score=0.5)).n_done == 12


def test_formats_that_were_begun_are_in_the_journal_in_one_order(few, tmp_path):
    for formats in (("label",), ("npz", "label"), ("npz",)):
        run(few, tmp_path / "out", *formats)
    header = json.loads((tmp_path / "out/journal.jsonl").read_text().splitlines()[0])
    assert header["written_formats"] == ["npz", "label"]


def test_names_are_one_where_they_are_to_the_file_system(few, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "000001.NPZ").write_bytes(b"mine")
    if (out / "000001.npz").exists():
        with pytest.raises(BatchError, match=r"holds 000001\.npz, "):
            run(few, out, "npz")
    else:
        assert run(few, out, "npz").n_done == 12
    assert (out / "000001.NPZ").read_bytes() == b"mine"


@pytest.mark.parametrize("file", ["failures.jsonl", "tracks.csv", "tracks/notes.txt"])
def test_what_a_run_writes_of_all_frames_takes_no_others_place(drive, tmp_path, file):
    out = tmp_path / "out"
    layouts.write_text(out / file, "mine")
    settings = runs.stored(drive, sweeps=1, track=True)
    with pytest.raises(BatchError, match=rf"out: holds {file.partition('/')[0]}, {REASON}"):
        batch.run(drive, out, settings)
    assert runs.contents(out) == {file: b"mine"}


def test_tracks_of_others_are_refused_when_a_run_is_to_be_tracked(drive, tmp_path):
    out = tmp_path / "out"
    layouts.write_text(out / "tracks.csv", "mine")
    settings = runs.stored(drive, sweeps=1)
    assert batch.run(drive, out, settings).n_done == 8
    with pytest.raises(BatchError, match=rf"out: holds tracks\.csv, {REASON}"):
        batch.run(drive, out, replace(settings, track=True))
    assert (out / "tracks.csv").read_text() == "mine"
    (out / "tracks.csv").unlink()
    for _ in range(2):
        assert batch.run(drive, out, replace(settings, track=True)).tracks


def test_failures_of_earlier_runs_are_replaced(few, tmp_path):
    masks = few / "masks/000003.json"
    content = masks.read_text()
    masks.write_text("{")
    assert len(run(few, tmp_path / "out", "npz").failures) == 1
    masks.write_text(content)
    assert run(few, tmp_path / "out", "npz").n_done == 12
    assert not (tmp_path / "out/failures.jsonl").exists()


def test_poses_that_sweeps_tell_take_no_others_place(drive, tmp_path, monkeypatch):
    poses = tmp_path / "out/poses.txt"
    layouts.write_text(poses, drives.tum_poses(8))
    monkeypatch.setattr(found_poses, "odometry_of", lambda _: read_poses(tmp_path / "told.txt"))
    layouts.write_text(tmp_path / "told.txt", drives.tum_poses(8))
    settings = runs.stored(drive, sweeps=1, poses="kiss-icp")
    with pytest.raises(BatchError, match=r"poses\.txt: is there, no run here wrote it, .* by --poses .*poses\.txt, or"):
        batch.run(drive, tmp_path / "out", settings)
    assert poses.read_text() == drives.tum_poses(8)
    poses.unlink()
    assert batch.run(drive, tmp_path / "out", settings).n_done == 8
    before = poses.read_bytes()
    assert batch.run(drive, tmp_path / "out", settings).n_earlier == 8
    assert poses.read_bytes() == before


def test_tables_of_a_run_are_none_of_its_inputs(few, tmp_path):
    with pytest.raises(InputError, match=r"objects: would write over .*000002\.json, which is an input"):
        run(few, tmp_path / "out", "npz", objects=few / "masks/000002.json")
    shutil.copy(few / "velodyne/000002.bin", few / "map.ply")
    (few / "velodyne/000002.bin").unlink()
    (few / "velodyne/000002.bin").symlink_to(few / "map.ply")
    with pytest.raises(InputError, match=r"map_file: would write over .*map\.ply, which is an input"):
        run(few, tmp_path / "out", "npz", map_file=few / "map.ply")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("how", "cameras"),
    [
        pytest.param({"masks": "masks/{frame}.json"}, (2,), id="masks by a pattern"),
        pytest.param({"masks": "masks"}, (2, 3), id="masks in the folder of a camera"),
        pytest.param({"segmenter": "boxes:masks/{frame}.json"}, (2,), id="boxes of each frame"),
    ],
)
def test_files_of_masks_wherever_they_lie_are_inputs(tmp_path, how, cameras):
    drive = layouts.many_frames(tmp_path / "drive", n_frames=2, cameras=cameras)
    ((option, place),) = how.items()
    kind, colon, path = place.rpartition(":")
    settings = batch.RunSettings(**{option: f"{kind}{colon}{drive / path}"})
    table = drive / "masks" / ("image_3" if len(cameras) > 1 else "") / "000001.json"
    source = open_source(drive, camera=cameras)
    with pytest.raises(InputError, match=r"objects: would write over .*000001\.json, which is an input"):
        batch.run(source, tmp_path / "out", settings, objects=table)


@pytest.mark.parametrize(
    "options",
    [
        pytest.param({"objects": "000003.csv"}, id="objects in the place of a frame"),
        pytest.param({"objects": "TRACKS.csv"}, id="objects in that of the table of tracks"),
        pytest.param({"map_file": "000003.ply"}, id="a map in the place of a frame"),
        pytest.param({"map_file": "tracks/000003.ply"}, id="a map in the place of a tracked frame"),
        pytest.param({"objects": "tracks/tracks.json"}, id="objects in that of the note of tracks"),
    ],
)
def test_files_of_all_frames_are_not_written_over_those_of_one(drive, tmp_path, options):
    settings = runs.stored(drive, formats=("npz", "ply"), track=True)
    batch.run(drive, tmp_path / "out", settings)
    before = runs.contents(tmp_path / "out")
    ((name, file),) = options.items()
    said = rf"{name}: .*{file} is the name of a file that runs write there; give another"
    with pytest.raises(ParameterError, match=said):
        batch.run(drive, tmp_path / "out", settings, **{name: tmp_path / "out" / file})
    assert runs.contents(tmp_path / "out") == before
    batch.run(drive, tmp_path / "out", settings, **{name: tmp_path / "out" / f"other-{file[-6:]}"})


@pytest.mark.parametrize("other", [{}, {"poses": "given.txt"}, {"poses": "kiss-icp", "sweeps": 0}])
def test_odometry_begins_in_no_folder_of_other_settings(drive, tmp_path, monkeypatch, other):
    out = tmp_path / "out"
    layouts.write_text(tmp_path / "given.txt", drives.tum_poses(8))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(found_poses, "odometry_of", lambda _: read_poses(tmp_path / "given.txt"))
    batch.run(drive, out, runs.stored(drive, **{"sweeps": 1, **other}))
    (out / "poses.txt").unlink(missing_ok=True)
    before = runs.contents(out)
    monkeypatch.setattr(found_poses, "odometry_of", lambda _: pytest.fail("the work is done"))
    settings = runs.stored(drive, sweeps=1, poses="kiss-icp")
    with pytest.raises(BatchError, match=r"holds a run of other settings: settings\.(poses|same_object) was .*; give"):
        batch.run(drive, out, settings)
    with only_run(out), pytest.raises(BatchError, match="another run is at work here"):
        batch.run(drive, out, settings)
    assert runs.contents(out) == before


def test_odometry_that_fails_leaves_no_new_folder(drive, tmp_path, monkeypatch):
    def fail(_):
        raise InputError("the way is lost")

    monkeypatch.setattr(found_poses, "odometry_of", fail)
    with pytest.raises(InputError, match="the way is lost"):
        batch.run(drive, tmp_path / "out", runs.stored(drive, sweeps=1, poses="kiss-icp"))
    assert not (tmp_path / "out").exists()


def test_found_poses_that_are_gone_are_found_again(drive, tmp_path, monkeypatch):
    out, settings = tmp_path / "out", runs.stored(drive, sweeps=1, poses="kiss-icp")
    layouts.write_text(tmp_path / "told.txt", drives.tum_poses(8))
    monkeypatch.setattr(found_poses, "odometry_of", lambda _: read_poses(tmp_path / "told.txt"))
    batch.run(drive, out, settings)
    (out / "poses.txt").unlink()
    assert batch.run(drive, out, settings).n_earlier == 8


def test_a_link_that_leads_nowhere_is_no_folder_to_write_to(few, tmp_path):
    (tmp_path / "disk").symlink_to(tmp_path / "unmounted")
    for out in ("disk", "disk/out"):
        with pytest.raises(
            UnsafePathError, match=r"disk: is a link that leads nowhere \(to .*unmounted\), expected a fol"
        ):
            run(few, tmp_path / out, "npz")
    assert not (tmp_path / "unmounted").exists()
    (tmp_path / "unmounted").mkdir()
    assert run(few, tmp_path / "disk/out", "npz").n_done == 12
