"""The table of the objects of a run."""

import json
import shutil
from dataclasses import replace

import pytest

import ldls
from batch import runs
from command import command
from datasets import layouts
from ldls import batch
from ldls.datasets import open_source
from ldls.errors import UnsupportedFormatError

ENDINGS = ["csv", "json"]


@pytest.fixture
def settings(few):
    return runs.stored(few)


@pytest.fixture
def expected(few, tmp_path):
    """The tables of the results of all frames, in their order."""
    frames = open_source(few)
    results = {}
    for name, frame in zip(frames.names, frames, strict=True):
        (image,) = frame.images
        masks = ldls.read_masks(few / f"masks/{name}.json")
        results[name] = ldls.segment(frame.points, [ldls.View(masks, image.camera, image.name)])
    for ending in ENDINGS:
        ldls.save_objects(results, tmp_path / f"expected.{ending}")
    return {ending: (tmp_path / f"expected.{ending}").read_bytes() for ending in ENDINGS}


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_run_writes_one_table_of_all_frames_in_their_order(few, settings, expected, tmp_path, ending):
    path = tmp_path / f"objects.{ending}"
    summary = batch.run(few, tmp_path / "out", settings, objects=path, workers=3)
    assert path.read_bytes() == expected[ending]
    assert expected[ending].count(b"\n") > sum(summary.objects.values()) > 12


def test_a_finished_run_given_again_writes_it_without_labelling(few, settings, expected, tmp_path):
    before = batch.run(few, tmp_path / "out", settings)
    journal = (tmp_path / "out/journal.jsonl").read_bytes()
    again = batch.run(few, tmp_path / "out", settings, objects=tmp_path / "out/objects.csv", engine=no_engine)
    assert (tmp_path / "out/objects.csv").read_bytes() == expected["csv"]
    assert (again.n_earlier, again.objects) == (12, before.objects)
    assert (tmp_path / "out/journal.jsonl").read_bytes() == journal


def no_engine(work, frames):
    assert not frames
    yield from ()


def test_frames_that_an_engine_lost_are_not_done(few, settings, tmp_path):
    summary = batch.run(few, tmp_path / "out", settings, engine=lambda work, windows: (outcome for outcome in ()))
    assert (summary.n_frames, summary.n_done, summary.failures) == (12, 0, ())


def test_a_run_that_goes_on_writes_the_table_of_all(few, settings, expected, tmp_path):
    batch.run(few, tmp_path / "out", settings)
    journal = tmp_path / "out/journal.jsonl"
    # as a kill leaves it: half of the frames, and half a line
    journal.write_bytes(b"".join(journal.read_bytes().splitlines(keepends=True)[:7]) + b'{"frame":')
    for number in range(6, 12):
        (tmp_path / f"out/{number:06d}.label").unlink()
    summary = batch.run(few, tmp_path / "out", settings, objects=tmp_path / "objects.csv")
    assert (summary.n_earlier, summary.n_done) == (6, 12)
    assert (tmp_path / "objects.csv").read_bytes() == expected["csv"]


def test_frames_that_fail_have_no_rows(few, settings, tmp_path):
    (few / "masks/000003.json").write_text("{")
    batch.run(few, tmp_path / "out", settings, objects=tmp_path / "objects.json")
    content = json.loads((tmp_path / "objects.json").read_text())
    assert [image["frame"] for image in content["images"]] == [f"{n:06d}" for n in range(12) if n != 3]


def test_another_ending_is_refused_before_anything_is_done(few, settings, tmp_path):
    with pytest.raises(UnsupportedFormatError, match=r"objects\.xlsx: cannot write '\.xlsx' tables of objects"):
        batch.run(few, tmp_path / "out", settings, objects=tmp_path / "objects.xlsx")
    assert not (tmp_path / "out").exists()


def test_a_folder_that_is_not_there_is_named_before_anything_is_done(few, settings, tmp_path):
    with pytest.raises(FileNotFoundError, match="make it first"):
        batch.run(few, tmp_path / "out", settings, objects=tmp_path / "none/objects.csv")
    assert not (tmp_path / "out").exists()


def test_the_command_writes_it_where_it_is_called(few, expected, tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    outcome = command(*runs.arguments(few, tmp_path / "out", "--objects", "objects.csv"))
    assert outcome.exit_code == 0, outcome.output
    assert (tmp_path / "here/objects.csv").read_bytes() == expected["csv"]
    assert "objects in objects.csv" in outcome.output


def test_boxes_of_kitti_are_a_format(few, tmp_path):
    shutil.rmtree(few / "label_2", ignore_errors=True)
    outcome = command(*runs.arguments(few, tmp_path / "out", "--formats", "kitti-boxes,npz", "--frames", ":2"))
    assert outcome.exit_code == 0, outcome.output
    ldls.save(ldls.read_result(tmp_path / "out/000001.npz"), tmp_path / "expected.txt")
    assert (tmp_path / "out/000001.txt").read_bytes() == (tmp_path / "expected.txt").read_bytes() != b""


def test_boxes_of_kitti_are_of_one_camera(tmp_path):
    source = layouts.nuscenes(tmp_path / "source")
    outcome = command(*runs.arguments(source, tmp_path / "out", "--formats", "npz,kitti-boxes"))
    assert outcome.exit_code == 1 and not (tmp_path / "out").exists()
    said = " ".join(outcome.output.split())
    assert "--formats: kitti-boxes are of one camera, the source has 6; leave them out, and give --objects, a" in said


def test_a_format_that_is_added_changes_nothing_of_the_table(few, settings, expected, tmp_path):
    batch.run(few, tmp_path / "out", settings, frames=slice(5))
    added = replace(settings, formats=("npz", "kitti-boxes"))
    summary = batch.run(few, tmp_path / "out", added, objects=tmp_path / "objects.json")
    assert (summary.n_done, (tmp_path / "objects.json").read_bytes()) == (12, expected["json"])
    assert len(list((tmp_path / "out").glob("*.txt"))) == 12
