"""Runs over whole sources in this process: what they write, refuse, survive and go on with."""

import errno
import json
import os
import re
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import ldls
from batch import drives, runs
from command import command, python
from datasets import layouts, ros_samples
from ldls import batch
from ldls.batch import lock
from ldls.batch.journal import Journal
from ldls.batch.plan import check_names, parse_frames
from ldls.batch.poses import FOUND
from ldls.datasets import open_source
from ldls.errors import (
    BatchError,
    ChangedFileWarning,
    CorruptFileError,
    InputError,
    NothingInView,
    ParameterError,
    UnsafePathError,
)
from ldls.io import files
from ldls.viewing import overlay

STORED = batch.RunSettings(masks="unused")


def run(source, out, **options):
    settings = replace(STORED, masks=str(Path(source) / "masks"), **options.pop("settings", {}))
    return batch.run(source, out, settings, **options)


def test_outputs_are_those_of_segment_frame_by_frame(source, undisturbed, tmp_path):
    frame = open_source(source)[7]
    masks = ldls.read_masks(source / "masks/000007.json")
    ldls.save(ldls.segment(frame.points, masks, frame.images[0].camera), tmp_path / "one.label")
    assert undisturbed["000007.label"] == (tmp_path / "one.label").read_bytes()
    assert len({undisturbed[f"{number:06d}.label"] for number in range(60)}) > 50
    names = {f"{number:06d}{ending}" for number in range(60) for ending in (".npz", ".label")}
    assert set(undisturbed) == {"journal.jsonl", *names}


@pytest.mark.parametrize("workers", [1, 2, 7])
def test_any_number_of_workers_yields_the_same_bytes(source, undisturbed, tmp_path, workers):
    assert run(source, tmp_path, workers=workers).n_done == 60
    assert runs.contents(tmp_path) == undisturbed


@pytest.mark.parametrize("workers", [0, -1, 5000])
def test_workers_out_of_range(few, tmp_path, workers):
    with pytest.raises(ParameterError, match=f"workers: got {workers}"):
        run(few, tmp_path / "out", workers=workers)
    assert not (tmp_path / "out").exists()


def test_pictures_are_a_format(few, tmp_path):
    out = tmp_path / "out"
    outcome = command("run", few, "--masks", few / "masks", "--out", out, "--frames", ":2", "--formats", "png,npz")
    assert outcome.exit_code == 0, outcome.output
    result = ldls.read_result(out / "000001.npz")
    overlay(result, open_source(few)[1].images[0].read()).save(tmp_path / "expected.png")
    with Image.open(out / "000001.png") as picture, Image.open(tmp_path / "expected.png") as expected:
        assert picture.tobytes() == expected.tobytes()


@pytest.mark.parametrize(
    ("ending", "hint"),
    [
        pytest.param("lable", "did you mean 'label'?", id="a slip"),
        pytest.param(".ply", "did you mean 'ply'?", id="with a dot"),
        pytest.param("42", "", id="nothing like it"),
    ],
)
def test_unknown_formats_are_refused_before_anything_is_done(few, tmp_path, ending, hint):
    outcome = command("run", few, "--masks", few / "masks", "--out", tmp_path / "out", "--formats", ending)
    assert outcome.exit_code == 1
    assert f"formats: '{ending}' is unknown; expected some of npz, label, ply" in outcome.output
    assert outcome.output.rstrip().endswith(hint)
    assert not (tmp_path / "out").exists()


def test_a_missing_extra_stops_the_run(few, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "laspy", None)
    outcome = command("run", few, "--masks", few / "masks", "--out", tmp_path / "out", "--formats", "las")
    assert outcome.exit_code == 1
    assert "pip install 'ldls[las]'" in outcome.output
    assert not (tmp_path / "out/failures.jsonl").exists()


def test_parameters_of_the_method_are_options(few, tmp_path):
    words = ["--sigma", 0.1, "--neighbors", 4, "--iterations", 7, "--keep-outliers", "--formats", "npz"]
    outcome = command("run", few, "--masks", few / "masks", "--out", tmp_path / "out", "--frames", "0", *words)
    assert outcome.exit_code == 0, outcome.output
    params = ldls.read_result(tmp_path / "out/000000.npz").params
    assert params == ldls.Params(sigma=0.1, neighbors=4, iterations=7, remove_outliers=False, threads=params.threads)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        pytest.param("2:9:3", ["000002", "000005", "000008"], id="with a step"),
        pytest.param("10:", ["000010", "000011"], id="to the end"),
        pytest.param(":2", ["000000", "000001"], id="from the start"),
        pytest.param("4", ["000004"], id="one"),
        pytest.param("11:500", ["000011"], id="past the end"),
    ],
)
def test_frames_and_formats(few, tmp_path, text, expected):
    out = tmp_path / "out"
    outcome = command("run", few, "--masks", few / "masks", "--out", out, "--frames", text, "--formats", "label,ply")
    assert outcome.exit_code == 0, outcome.output
    assert f"{len(expected)} of {len(expected)} frames done" in outcome.output
    made = {path.name for path in out.iterdir()} - {"journal.jsonl"}
    assert made == {f"{name}.{ending}" for name in expected for ending in ("label", "ply")}


@pytest.mark.parametrize("text", ["12:", "5:2", "100:200:5"])
def test_frames_that_the_source_has_not(few, tmp_path, text):
    outcome = command("run", few, "--masks", few / "masks", "--out", tmp_path / "out", "--frames", text)
    assert outcome.exit_code == 1
    assert f"frames: got {text}, {few} has 12 frames, counted from 0" in " ".join(outcome.output.split())
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("text", ["1:2:0", "-3:", "a:b", "1:2:3:4", ""])
def test_frames_that_are_no_slice(text):
    with pytest.raises(ParameterError, match="START:STOP:STEP"):
        parse_frames(text)


def test_boxes_of_each_frame(few, tmp_path):
    out = tmp_path / "out"
    spec = f"boxes:{few}/label_2/{{frame}}.txt"
    outcome = command("run", few, "--segmenter", spec, "--out", out)
    assert outcome.exit_code == 0, outcome.output
    assert "12 of 12 frames done" in outcome.output
    boxes = few / "label_2/000003.txt"
    boxes.write_text(boxes.read_text().replace("20.00", "18.00"))
    outcome = command("run", few, "--segmenter", spec, "--out", out)
    assert outcome.exit_code == 1
    assert "label_2/000003.txt, of which frame 000003 was made, was changed since" in outcome.output


def test_boxes_that_a_frame_lacks_are_named(few, tmp_path):
    lacking, empty = few / "label_2/000001.txt", few / "label_2/000002.txt"
    lacking.unlink()
    empty.write_text("")
    words = ("--segmenter", f"boxes:{few}/label_2/{{frame}}.txt", "--out", tmp_path / "out", "--frames", ":3")
    outcome = command("run", few, *words)
    assert f"000001 failed (masks): --segmenter: there is no {lacking}; make it, empty where" in outcome.output
    (failure,) = map(json.loads, (tmp_path / "out/failures.jsonl").read_text().splitlines())
    assert (failure["frame"], failure["code"]) == ("000001", "input")


ONE_IMAGE = [
    pytest.param("segmenter", "boxes:{source}/label_2/000000.txt", 3, 1, "frame", id="boxes"),
    pytest.param("segmenter", "grabcut:{source}/label_2/000000.txt", 3, 1, "frame", id="grabcut"),
    pytest.param("segmenter", "boxes:{source}/label_2/{camera}.txt", 2, 2, "frame", id="boxes of cameras"),
    pytest.param("segmenter", "boxes:{source}/label_2/{frame}.txt", 1, 2, "camera", id="boxes for two cameras"),
    pytest.param("masks", "{source}/masks/image_2/{frame}.json", 1, 2, "camera", id="masks for two cameras"),
]


@pytest.mark.parametrize(("option", "place", "n_frames", "n_cameras", "word"), ONE_IMAGE)
@pytest.mark.parametrize("name", ["run", "view"])
def test_masks_of_one_image_are_not_given_to_others(tmp_path, name, option, place, n_frames, n_cameras, word):
    source = layouts.many_frames(tmp_path / "source", 3, cameras=range(2, 2 + n_cameras))
    place = place.replace("{source}", str(source))
    where = ["--out", tmp_path / "out"] if name == "run" else ["--picture", tmp_path / "seen.png"]
    cameras = ["--option", f"camera={','.join(map(str, range(2, 2 + n_cameras)))}"]
    outcome = command(name, source, f"--{option}", place, "--frames", f":{n_frames}", *cameras, *where)
    assert outcome.exit_code == 1
    count = max(n_frames, n_cameras)
    assert f"error: --{option}: {place} is the file of one image, there are {count} {word}s" in outcome.output
    assert f"put {{{word}}} into the path" in outcome.output
    assert {path.name for path in tmp_path.iterdir()} == {"source"}


def test_masks_of_one_image_are_given_to_it(few, tmp_path):
    words = ("--segmenter", f"boxes:{few}/label_2/000003.txt", "--frames", 3, "--out", tmp_path / "out")
    outcome = command("run", few, *words)
    assert outcome.exit_code == 0, outcome.output
    assert "1 of 1 frames done" in outcome.output


def test_rings_with_masks_of_each_camera(tmp_path):
    source = layouts.many_frames(tmp_path / "source", 3, cameras=(2, 3))
    ring = open_source(source, camera=(2, 3))
    for number, place in enumerate([source / "masks", f"{source}/masks/{{camera}}/{{frame}}.json"]):
        out = tmp_path / f"out {number}"
        summary = batch.run(ring, out, batch.RunSettings(masks=str(place)))
        assert summary.n_done == 3
        frame = ring[1]
        masks = [ldls.read_masks(source / f"masks/image_{camera}/000001.json") for camera in (2, 3)]
        views = [ldls.View(own, image.camera) for own, image in zip(masks, frame.images, strict=True)]
        ldls.save(ldls.segment(frame.points, views), tmp_path / "one.label")
        assert (out / "000001.label").read_bytes() == (tmp_path / "one.label").read_bytes()


@pytest.mark.parametrize("n_cameras", [1, 2], ids=["one camera", "two cameras"])
def test_a_bag_with_stored_masks(tmp_path, n_cameras):
    topics = ("/left/image_raw", "/right/image_raw")[:n_cameras]
    bag = ros_samples.Recording(
        image_topics=topics, info_topics=("/left/camera_info", "/right/camera_info")[:n_cameras]
    ).write(tmp_path / "small.bag")
    opened = open_source(bag, truth=False, image_topics=topics)
    for image in opened[0].images:
        for name in opened.names:
            layouts.write_text(tmp_path / f"masks/{image.name}/{name}.json", json.dumps(layouts.coco(20)))
    settings = runs.stored(tmp_path)
    for n_earlier in (0, 3):
        # the cloud of this bag lies beside its images
        with pytest.warns(NothingInView, match="3 of 3 frames") as caught:
            summary = batch.run(opened, tmp_path / "out", settings)
        assert caught[0].filename == __file__
        assert (summary.n_done, summary.n_earlier) == (3, n_earlier)


def test_one_corrupt_frame_of_a_thousand(tmp_path):
    source = layouts.many_frames(tmp_path / "source", 1000)
    sound = (source / "velodyne/000417.bin").read_bytes()
    (source / "velodyne/000417.bin").write_bytes(sound[:-3])
    out = tmp_path / "out"
    words = runs.arguments(source, out)
    outcome = command(*words)
    assert outcome.exit_code == 2, outcome.output
    assert "999 of 1,000 frames done, 1 failed" in outcome.output
    assert "000417 failed (read)" in outcome.output
    (line,) = (out / "failures.jsonl").read_text().splitlines()
    failure = json.loads(line)
    assert (failure["frame"], failure["stage"], failure["code"]) == ("000417", "read", "truncated_file")
    assert "000417.bin" in failure["message"]
    assert len(list(out.glob("*.label"))) == 999
    (source / "velodyne/000417.bin").write_bytes(sound)
    outcome = command(*words)
    assert outcome.exit_code == 0, outcome.output
    assert "1,000 of 1,000 frames done, 999 of them by earlier runs" in outcome.output
    assert not (out / "failures.jsonl").exists()
    assert len(list(out.glob("*.label"))) == 1000


@pytest.mark.parametrize(
    ("break_it", "stage", "code"),
    [
        pytest.param(lambda s: (s / "masks/000002.json").unlink(), "masks", "input", id="no masks"),
        pytest.param(lambda s: (s / "masks/000002.json").write_text("{"), "masks", "corrupt_file", id="half a file"),
        pytest.param(lambda s: (s / "calib/000002.txt").write_text(""), "read", None, id="empty calibration"),
        pytest.param(lambda s: (s / "velodyne/000002.bin").write_bytes(b"x" * 17), "read", None, id="corrupt cloud"),
    ],
)  # fmt: skip
def test_a_bad_frame_is_passed_over(few, tmp_path, break_it, stage, code):
    break_it(few)
    summary = run(few, tmp_path / "out")
    (failure,) = summary.failures
    assert (failure.frame, failure.stage, summary.n_done) == ("000002", stage, 11)
    assert code is None or failure.code == code
    assert not (tmp_path / "out/000002.label").exists()


def test_a_cut_off_line_of_the_journal_is_dropped(source, undisturbed, tmp_path):
    run(source, tmp_path)
    journal = tmp_path / "journal.jsonl"
    for cut in (10, 3000, len(journal.read_bytes()) - 1):
        journal.write_bytes(undisturbed["journal.jsonl"][:cut])
        run(source, tmp_path)
        assert runs.contents(tmp_path) == undisturbed


def test_what_is_no_journal_is_refused(few, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out/journal.jsonl").write_text("a diary\n")
    with pytest.raises(CorruptFileError, match="not a journal of ldls"):
        run(few, tmp_path / "out")
    assert (tmp_path / "out/journal.jsonl").read_text() == "a diary\n"


def test_files_that_went_missing_or_shrank_are_made_again(source, undisturbed, tmp_path):
    run(source, tmp_path)
    (tmp_path / "000003.label").unlink()
    (tmp_path / "000004.label").write_bytes(b"")
    with pytest.warns(ChangedFileWarning, match=r"files of 1 frames were changed .* \(000004\)") as caught:
        assert run(source, tmp_path).n_earlier == 58
    assert caught[0].filename == __file__
    assert runs.contents(tmp_path) == undisturbed


def test_left_over_parts_are_swept(few, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / f".000001.label.0123{files.UNFINISHED}").write_bytes(b"half")
    (out / "notes.txt").write_text("the user's own")
    run(few, out)
    assert not list(out.glob(".*"))
    assert (out / "notes.txt").exists()


@pytest.mark.parametrize(
    ("options", "named"),
    [
        pytest.param({"settings": {"params": ldls.Params(sigma=2.0)}}, "params.sigma was 0.1, is 2.0", id="sigma"),
        pytest.param({"settings": {"min_score": 0.5}}, "settings.min_score was None, is 0.5", id="score"),
    ],
)  # fmt: skip
def test_a_run_of_other_settings_is_refused(few, tmp_path, options, named):
    run(few, tmp_path / "out")
    before = runs.contents(tmp_path / "out")
    with pytest.raises(BatchError, match="holds a run of other settings") as caught:
        run(few, tmp_path / "out", **options)
    assert named in str(caught.value)
    assert runs.contents(tmp_path / "out") == before


def test_a_run_that_did_no_frame_binds_nobody(few, tmp_path):
    assert len(run(few, tmp_path / "out", settings={"categories": ("zebrra",)}).failures) == 12
    assert run(few, tmp_path / "out").n_done == 12
    run(few, tmp_path / "new")
    assert runs.contents(tmp_path / "out") == runs.contents(tmp_path / "new")


@pytest.mark.parametrize(
    "ending", [b'{"frame":"000000","files":{"000000.npz"', b"a diary\n"], ids=["cut off", "foreign"]
)
def test_a_run_that_may_have_done_frames_is_kept(few, tmp_path, ending):
    run(few, tmp_path / "out", settings={"categories": ("zebrra",)})
    journal = tmp_path / "out/journal.jsonl"
    journal.write_bytes(journal.read_bytes() + ending)
    before = runs.contents(tmp_path / "out")
    with pytest.raises(BatchError, match="holds a run of other settings"):
        run(few, tmp_path / "out")
    assert runs.contents(tmp_path / "out") == before


def test_poses_that_sweeps_told_belong_to_their_source(few, tmp_path):
    run(few, tmp_path / "out", settings={"categories": ("zebrra",)})
    (tmp_path / "out/poses.txt").write_text(f"# {FOUND}\n{drives.tum_poses(12)}")
    other = layouts.many_frames(tmp_path / "other", 12)
    with pytest.raises(BatchError, match=r"source\.path was"):
        run(other, tmp_path / "out")


def test_a_run_of_another_source_is_refused(few, tmp_path):
    run(few, tmp_path / "out")
    other = layouts.many_frames(tmp_path / "other", 12)
    with pytest.raises(BatchError, match=r"source\.path was '.*source', is '.*other'"):
        batch.run(other, tmp_path / "out", replace(STORED, masks=str(few / "masks")))


def test_a_command_may_be_spelt_from_another_folder(few, tmp_path, monkeypatch):
    run(few, tmp_path / "out")
    monkeypatch.chdir(few / "velodyne")
    assert batch.run("..", tmp_path / "out", replace(STORED, masks="../masks")).n_earlier == 12


def test_a_segmenter_is_the_file_that_its_path_leads_to(few, tmp_path, monkeypatch):
    other = layouts.many_frames(tmp_path / "other", 12)
    monkeypatch.chdir(few)
    batch.run(few, tmp_path / "out", batch.RunSettings(segmenter="boxes:label_2/{frame}.txt"))
    monkeypatch.chdir(few / "velodyne")
    settings = batch.RunSettings(segmenter="boxes:../label_2/{frame}.txt")
    assert batch.run("..", tmp_path / "out", settings).n_earlier == 12
    monkeypatch.chdir(other)
    with pytest.raises(BatchError, match=r"segmenter was 'boxes:.*source/label_2/{frame}\.txt', is 'boxes:.*other"):
        batch.run(few, tmp_path / "out", batch.RunSettings(segmenter="boxes:label_2/{frame}.txt"))


@pytest.mark.parametrize("spec", ["torchvision", "torchvision:maskrcnn_resnet50_fpn_v2"])
def test_a_segmenter_without_a_file_is_recorded_as_it_is(spec):
    assert batch.RunSettings(segmenter=spec).record()["segmenter"] == spec


def test_a_run_of_another_version_is_refused(few, tmp_path):
    run(few, tmp_path / "out")
    journal = tmp_path / "out/journal.jsonl"
    journal.write_text(journal.read_text().replace(f'"version":"{ldls.__version__}"', '"version":"0.0.1"'))
    with pytest.raises(BatchError, match=rf"settings\.version was '0\.0\.1', is '{ldls.__version__}'"):
        run(few, tmp_path / "out")


@pytest.mark.parametrize("kind", ["velodyne/000004.bin", "calib/000004.txt", "masks/000004.json"])
@pytest.mark.parametrize(
    "change",
    [
        pytest.param(lambda path: path.write_bytes(path.read_bytes() + b"\n"), id="written"),
        pytest.param(lambda path: path.unlink(), id="removed"),
    ],
)
def test_a_changed_input_is_refused(few, tmp_path, kind, change):
    run(few, tmp_path / "out", frames=slice(0, 5))
    source = open_source(few)
    change(few / kind)
    with pytest.raises(BatchError, match=f"{kind}, of which frame 000004 was made, was changed since"):
        settings = replace(STORED, masks=str(few / "masks"))
        batch.run(source, tmp_path / "out", settings, frames=slice(0, 5))


def test_threads_of_params_do_not_matter(few, tmp_path):
    run(few, tmp_path / "out")
    assert run(few, tmp_path / "out", settings={"params": ldls.Params(threads=2)}).n_earlier == 12


def test_a_second_run_is_refused_while_the_first_lives(few, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    hold = "import sys, time; from pathlib import Path; from ldls.batch.lock import only_run\n"
    hold += "with only_run(Path(sys.argv[1])): print('held', flush=True); time.sleep(60)"
    with runs.started([out], program=["-c", hold]) as holder:
        assert holder.stdout.readline() == "held\n"
        outcome = command(*runs.arguments(few, out))
        assert outcome.exit_code == 1
        assert f"another run is at work here (process {holder.pid} on " in outcome.output
        assert {path.name for path in out.iterdir()} == {lock.LOCK_NAME, lock.HOLDER_NAME}
    outcome = command(*runs.arguments(few, out))
    assert outcome.exit_code == 0, outcome.output
    assert not (out / lock.LOCK_NAME).exists()


def test_full_disk(source, undisturbed, small_disk):
    words = runs.arguments(source, small_disk)
    for _ in range(2):
        outcome = command(*words)
        assert outcome.exit_code == 1
        assert "No space left on device while" in outcome.output
        assert "ing frame 000" in outcome.output
        left = runs.contents(small_disk)
        assert 10 < len(left) < 45
        assert {name for name in left if name.startswith(".")} == set()
        assert all(content == undisturbed[name] for name, content in left.items() if name != "journal.jsonl")
        assert left["journal.jsonl"].endswith(b"\n")
    subprocess.run(["mount", "-o", "remount,size=20m", str(small_disk)], check=True)
    outcome = command(*words)
    assert outcome.exit_code == 0, outcome.output
    assert runs.contents(small_disk) == undisturbed


@pytest.mark.parametrize("n", [1, 2, 20, 61], ids=lambda n: f"sync {n}")
@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT, errno.EROFS], ids=errno.errorcode.get)
def test_disk_trouble_of_every_kind(source, undisturbed, tmp_path, monkeypatch, n, code):
    calls = iter(range(1, 10_000))
    sync = os.fsync

    def failing(handle):
        if next(calls) >= n:
            raise OSError(code, os.strerror(code))
        sync(handle)

    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", failing)
        with pytest.raises(OSError, match=os.strerror(code)) as caught:
            run(source, tmp_path)
    assert caught.value.errno == code
    assert str(tmp_path) in caught.value.filename
    assert n <= 2 or "frame 000" in caught.value.strerror
    assert all(content == undisturbed[name] for name, content in runs.without_journal(tmp_path).items())
    run(source, tmp_path)
    assert runs.contents(tmp_path) == undisturbed


def test_nothing_is_at_work_once_a_run_has_failed(source, tmp_path, monkeypatch):
    """Whoever keeps the error keeps the frames of its stack, and all that waits in them to go on."""

    def failing(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Journal, "add", failing)
    monkeypatch.setattr(sys.modules["ldls.batch.run"], "GROUP_S", 0.0)
    before = threading.enumerate()
    with pytest.raises(OSError, match=os.strerror(errno.ENOSPC)) as kept:
        run(source, tmp_path)
    assert threading.enumerate() == before
    assert kept.tb is not None


@pytest.mark.parametrize(
    "names",
    [
        pytest.param(["../../etc/passwd"], id="parent"),
        pytest.param(["/etc/passwd"], id="absolute"),
        pytest.param(["a/b"], id="separator"),
        pytest.param(["a\\b"], id="Windows separator"),
        pytest.param(["C:x"], id="drive"),
        pytest.param(["a\0b"], id="NUL"),
        pytest.param(["a\nb"], id="line break"),
        pytest.param(["nul"], id="device"),
        pytest.param([".hidden"], id="hidden"),
        pytest.param([""], id="empty"),
        pytest.param(["\udcff"], id="not UTF-8"),
        pytest.param(["é" * 101], id="too many bytes"),
        pytest.param(["a", "A"], id="cases"),
        pytest.param(["caf\u00e9", "cafe\u0301"], id="two ways to write an accent"),
        pytest.param(["a", "a"], id="twice"),
    ],
)
def test_names_that_cannot_be_files(names):
    with pytest.raises(UnsafePathError):
        check_names(names, ["label"])


def test_failures_so_far_are_kept_where_a_run_is_interrupted(few, tmp_path):
    (few / "masks/000000.json").write_text("{")

    def stop(finished, failed, total):
        if failed and finished > 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(few, tmp_path, on_progress=stop)
    (line,) = (tmp_path / "failures.jsonl").read_text().splitlines()
    assert json.loads(line)["frame"] == "000000"


def test_a_log_has_lines_meanwhile(few, tmp_path):
    outcome = command("run", few, "--masks", few / "masks", "--out", tmp_path)
    lines = outcome.stdout.splitlines()
    first, last = (
        next(at for at, line in enumerate(lines) if re.fullmatch(rf"labelling: {n} of 12 frames, .* a second", line))
        for n in (1, 12)
    )
    assert first < last < next(at for at, line in enumerate(lines) if "objects found" in line)


def test_a_log_that_nobody_reads_stops_nothing(few, tmp_path):
    with runs.started(runs.arguments(few, tmp_path / "out")) as running:
        running.stdout.close()
        running.wait()
    assert len(list((tmp_path / "out").glob("*.npz"))) == 12


def test_quiet_prints_nothing(few, tmp_path):
    outcome = command("run", few, "--masks", few / "masks", "--out", tmp_path / "out", "--quiet")
    assert (outcome.exit_code, outcome.output) == (0, "")
    assert (tmp_path / "out/000000.npz").exists()
    (few / "masks/000000.json").write_text("{")
    outcome = command("run", few, "--masks", few / "masks", "--out", tmp_path / "other", "-q")
    assert (outcome.exit_code, outcome.stdout) == (2, "")
    assert "000000 failed (masks)" in outcome.stderr


def test_names_that_meet_by_their_endings():
    check_names(["a", "a_panoptic"], ["npz"])
    with pytest.raises(UnsafePathError, match="one file"):
        check_names(["a", "a_panoptic"], ["npz", "panoptic"])


class Renamed:
    """A source whose frames have other names."""

    def __init__(self, source, names):
        self.source, self.names = source, tuple(names)
        self.kind, self.path, self.camera_names = source.kind, source.path, source.camera_names

    def __len__(self):
        return len(self.names)

    def __getitem__(self, index):
        return self.source[index]

    def files(self, index):
        return self.source.files(index)


def test_unsafe_names_are_refused_before_anything_is_written(few, tmp_path):
    renamed = Renamed(open_source(few), ["a", "../a"])
    with pytest.raises(UnsafePathError, match=r"'\.\./a'"):
        batch.run(renamed, tmp_path / "out", replace(STORED, masks=str(few / "masks")))
    assert not (tmp_path / "out").exists()


def test_frames_of_unicode_names(tmp_path):
    names = ["Straße 1", "東京", "🚗"]
    source = layouts.plain_folder(tmp_path / "Ünï", frames=names)
    (source / "masks").mkdir()
    for name in names:
        (source / f"masks/{name}.json").write_text(json.dumps(layouts.coco(20)))
    assert run(source, tmp_path / "öut").n_done == 3
    assert {path.stem for path in (tmp_path / "öut").glob("*.label")} == set(names)
    assert run(source, tmp_path / "öut").n_earlier == 3


@pytest.fixture
def read_only(tmp_path):
    place = tmp_path / "sealed"
    place.mkdir()
    if os.geteuid() != 0:
        place.chmod(0o500)
        yield place
        place.chmod(0o700)
        return
    # root writes where others may not, save on a file system that is read-only
    mount = ["mount", "-t", "tmpfs", "-o", "ro,size=64k", "none", str(place)]
    if subprocess.run(mount, check=False).returncode != 0:
        pytest.skip("nothing is read-only here")
    yield place
    subprocess.run(["umount", str(place)], check=True)


@pytest.mark.parametrize("below", ["", "new/folder"], ids=["itself", "a folder in it"])
def test_a_read_only_folder(few, read_only, below):
    outcome = command(*runs.arguments(few, read_only / below))
    assert outcome.exit_code == 1
    assert str(read_only) in outcome.output
    assert not list(read_only.iterdir())


MEMORY = """
import resource, sys
from pathlib import Path
from ldls import batch

def measure(finished, _failed, _total):
    if finished > 1000:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        print(pages * resource.getpagesize())

source, out = sys.argv[1:]
batch.run(source, out, batch.RunSettings(masks=f"{source}/masks"), on_progress=measure)
"""


def test_memory_stays_flat(tmp_path):
    source = layouts.many_frames(tmp_path / "source", 4500)
    # in a process of its own: what other tests have left in this one moves its memory as well
    done = python("-c", MEMORY, source, tmp_path / "out")
    assert done.returncode == 0, done.stderr
    used = [int(line) for line in done.stdout.split()]
    # what is there at the least, for momentary peaks depend on what else the machine does; where it does much,
    # allocators go on for some thousand frames to gather what they keep, 4 MB
    assert (min(used[-500:]) - min(used[:500])) / 3000 < 2048


def test_masks_that_are_nowhere(few, tmp_path):
    with pytest.raises(InputError, match="there is no"):
        batch.run(few, tmp_path / "out", batch.RunSettings(masks=str(tmp_path / "none")))


def test_neither_masks_nor_a_segmenter(few, tmp_path):
    with pytest.raises(ParameterError, match=r"got neither, and .*source names no masks of its own") as failed:
        batch.run(few, tmp_path / "out", batch.RunSettings())
    assert str(failed.value).endswith(f"; perhaps masks={few / 'masks'}?")


@pytest.mark.parametrize(
    ("options", "named"),
    [
        pytest.param({"masks": "a", "segmenter": "torchvision"}, "got both", id="both"),
        pytest.param({"masks": "a", "formats": ()}, "formats", id="no format"),
    ],
)
def test_settings_that_contradict_themselves(options, named):
    with pytest.raises(ParameterError, match=named):
        batch.RunSettings(**options)


POSES = ldls.Trajectory(np.zeros(1), np.eye(4)[None])


@pytest.mark.parametrize(
    ("options", "said"),
    [
        pytest.param({"sweeps": "2"}, "sweeps: got '2', expected a whole number", id="text for a number"),
        pytest.param({"sweeps": 1.5}, "sweeps: got 1.5, expected a whole number", id="half a sweep"),
        pytest.param({"sweeps": True}, "sweeps: got True, expected a whole number", id="a flag for a number"),
        pytest.param({"poses": POSES}, "poses: expected text or a path, got Trajectory", id="poses for their file"),
        pytest.param({"track": 1}, "track: got 1, expected True or False", id="a number for a flag"),
        pytest.param({"formats": "npz"}, "formats: got 'npz', expected a list", id="one format"),
        pytest.param({"params": None}, "params: expected Params, got NoneType; make", id="no parameters"),
    ],
)
def test_settings_of_another_type(options, said):
    with pytest.raises(InputError, match=f"^{said}"):
        batch.RunSettings(**options)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        pytest.param({"settings": None}, "settings: expected RunSettings, got NoneType; make", id="no settings"),
        pytest.param({"frames": 3}, "frames: expected slice, got int; make one with slice", id="a number of frames"),
        pytest.param({"frames": slice(0, 1.5)}, "frames: got slice.0, 1.5, None., expected whole", id="half a frame"),
        pytest.param({"frames": slice(None, None, -1)}, "frames: .* a step from 1, as in slice", id="backwards"),
        pytest.param({"frames": slice(0, 5, 0)}, "frames: .* a step from 1, as in slice", id="no step"),
        pytest.param({"workers": "2"}, "workers: got '2', expected a whole number", id="workers"),
    ],
)
def test_arguments_of_another_type_are_refused_before_anything_is_done(few, tmp_path, options, said):
    arguments = {"settings": replace(STORED, masks=str(few / "masks")), **options}
    with pytest.raises(InputError, match=f"^{said}"):
        batch.run(few, tmp_path / "out", **arguments)
    assert not (tmp_path / "out").exists()


def test_unknown_engine(few, tmp_path):
    with pytest.raises(ParameterError, match="engine: got 'slurm', expected one of local"):
        run(few, tmp_path / "out", engine="slurm")


def test_warnings_of_frames_are_said_once(few, tmp_path):
    for number in range(12):
        layouts.write_points(few / f"velodyne/{number:06d}.bin", np.full((10, 4), np.nan, "<f4"))
    outcome = command(*runs.arguments(few, tmp_path / "out"))
    assert outcome.exit_code == 0, outcome.output
    assert outcome.output.count("no row is finite") == 1


def test_intensities_that_las_cannot_hold_are_said_once(few, tmp_path):
    pytest.importorskip("laspy", reason="the extra las is not installed")
    for number in range(12):
        path = few / f"velodyne/{number:06d}.bin"
        points = np.fromfile(path, "<f4").reshape(-1, 4)
        points[number, 3] = np.nan
        layouts.write_points(path, points)
    outcome = command(*runs.arguments(few, tmp_path / "out"), "--formats", "las")
    assert outcome.exit_code == 0, outcome.output
    assert outcome.output.count("intensities hold NaN, which are 0") == 1
    assert len(list((tmp_path / "out").glob("*.las"))) == 12


def test_records_reach_the_journal_while_the_run_lasts(few, tmp_path, monkeypatch):
    # the function of that name hides the module
    monkeypatch.setattr(sys.modules["ldls.batch.run"], "GROUP_S", 0.0)
    seen = []
    journal = tmp_path / "out/journal.jsonl"
    run(few, tmp_path / "out", on_progress=lambda *_: seen.append(journal.read_text().count("\n")))
    assert seen == sorted(seen)
    assert seen[5] >= 6


@pytest.mark.parametrize("by", ["command", "call"])
def test_options_of_the_source_choose_and_belong_to_the_run(tmp_path, by):
    source = layouts.many_frames(tmp_path / "source", 2, cameras=(2, 3))
    for number in (2, 3):
        out, masks = tmp_path / f"out {number}", source / f"masks/image_{number}"
        if by == "call":
            options = {"camera": number, "truth": False}
            batch.run(source, out, batch.RunSettings(masks=str(masks)), options=options)
        else:
            options = ("--option", f"camera={number}", "--option", "truth=false")
            outcome = command("run", source, "--masks", masks, *options, "--out", out)
            assert outcome.exit_code == 0, outcome.output
        frame = open_source(source, camera=number)[0]
        one = ldls.segment(frame.points, ldls.read_masks(masks / "000000.json"), frame.images[0].camera)
        ldls.save(one, tmp_path / "one.label")
        assert (out / "000000.label").read_bytes() == (tmp_path / "one.label").read_bytes()
    with pytest.raises(BatchError, match="options"):
        batch.run(source, out, batch.RunSettings(masks=str(masks)), options={"camera": 2})


def test_settings_of_numpy_are_those_of_python(few, tmp_path):
    params = {"neighbors": 10, "sigma": 0.5}
    plain = runs.stored(few, min_score=0.25, sweeps=0, categories=("car", 1),
                              params=ldls.Params(**params))  # fmt: skip
    of_numpy = batch.RunSettings(
        masks=str(few / "masks"),
        min_score=np.float32(0.25),
        sweeps=np.int64(0),
        categories=(np.str_("car"), np.int64(1)),
        params=ldls.Params(neighbors=np.int64(10), sigma=np.float64(0.5)),
    )
    assert of_numpy.record() == plain.record()
    assert not batch.run(few, tmp_path / "out", of_numpy, frames=slice(1)).failures
