"""Frames and formats that are added to a finished run: only what is missing is done."""

import json
import signal

import pytest

from batch import runs
from command import command
from datasets import layouts
from ldls import batch
from ldls.errors import BatchError, ChangedFileWarning, UnsafePathError
from ldls.sequences import LabelDiffusion

ALL = ("npz", "label", "ply", "png", "pcd", "csv", "kitti-boxes", "lidarseg", "panoptic")


def run(source, out, *formats, masks=None, **options):
    settings = batch.RunSettings(masks=str(source / "masks") if masks is None else masks, formats=formats)
    return batch.run(source, out, settings, **options)


@pytest.fixture
def labelled(monkeypatch):
    """The frames that are labelled from now on: their numbers of points."""
    done = []
    segment = LabelDiffusion.segment

    def noted(self, points, *arguments, **options):
        done.append(len(points))
        return segment(self, points, *arguments, **options)

    monkeypatch.setattr(LabelDiffusion, "segment", noted)
    return done


@pytest.fixture
def whole(few, tmp_path):
    """The files of a run that had all formats and frames from the start."""
    run(few, tmp_path / "whole", *ALL)
    return runs.contents(tmp_path / "whole")


@pytest.mark.parametrize(
    ("first", "then", "n_labelled"),
    [
        pytest.param(("npz",), ALL, 0, id="from npz"),
        pytest.param(("npz", "label"), ALL[2:], 0, id="others instead"),
        pytest.param(("label", "png"), ALL, 12, id="without npz"),
        pytest.param(("png", "npz", "ply"), ("label", *ALL[4:]), 0, id="to pictures"),
    ],
)
def test_formats_that_are_added_end_with_the_same_bytes(few, tmp_path, whole, labelled, first, then, n_labelled):
    out = tmp_path / "out"
    run(few, out, *first)
    before = runs.times(out)
    labelled.clear()
    assert run(few, out, *then).n_done == 12
    assert len(labelled) == n_labelled
    assert {name: runs.times(out)[name] for name in before} == before
    expected = {name: content for name, content in whole.items() if not name.endswith("jsonl")}
    assert {name: content for name, content in runs.contents(out).items() if not name.endswith("jsonl")} == expected
    assert runs.contents(out)["journal.jsonl"] == whole["journal.jsonl"]


def test_frames_that_are_added_end_with_the_same_bytes(few, tmp_path, whole, labelled):
    out = tmp_path / "out"
    for frames, n_earlier in ((slice(8, 10), 0), (slice(0, 9, 2), 1), (slice(None), 6), (slice(0, 3), 3)):
        summary = run(few, out, *ALL, frames=frames)
        assert (summary.n_earlier, summary.n_done) == (n_earlier, len(range(12)[frames]))
    assert len(labelled) == 12
    assert runs.contents(out) == whole


def test_a_frame_with_less_than_the_others_gets_what_it_lacks(few, tmp_path, whole):
    out = tmp_path / "out"
    run(few, out, "npz", frames=slice(0, 4))
    run(few, out, "label", frames=slice(2, 7))
    assert {path.name for path in out.glob("00000[0-6].*")} == {
        *(f"00000{k}.npz" for k in range(4)),
        *(f"00000{k}.label" for k in range(2, 7)),
    }
    run(few, out, *ALL)
    assert runs.contents(out) == whole


def test_the_command_adds_formats_and_frames(few, tmp_path):
    words = runs.arguments(few, tmp_path / "out")
    assert "5 of 5 frames done" in command(*words, "--frames", ":5", "--formats", "npz").output
    outcome = command(*words, "--formats", "npz,label")
    assert outcome.exit_code == 0, outcome.output
    assert "12 of 12 frames done" in outcome.output
    assert len(list((tmp_path / "out").glob("*.label"))) == len(list((tmp_path / "out").glob("*.npz"))) == 12


def test_labels_of_other_settings_are_not_mixed(few, tmp_path):
    run(few, tmp_path / "out", "npz")
    with pytest.raises(
        BatchError, match=r"settings\.masks was '.*/masks', is '.*/others/{frame}\.json'.*formats may be added"
    ):
        run(few, tmp_path / "out", "npz", "png", masks=f"{few}/others/{{frame}}.json")


def test_an_input_changed_since_is_refused_for_added_formats_too(few, tmp_path):
    run(few, tmp_path / "out", "npz")
    layouts.write_image(few / "image_2/000003.png", (61, 80))
    with pytest.raises(BatchError, match=r"image_2/000003\.png, of which frame 000003 was made, was changed since"):
        run(few, tmp_path / "out", "npz", "png")


def test_a_result_that_was_changed_is_not_a_source_of_formats(few, tmp_path, labelled):
    out = tmp_path / "out"
    run(few, out, "npz", "label")
    content = bytearray((out / "000003.npz").read_bytes())
    content[-1] ^= 1
    (out / "000003.npz").write_bytes(content)
    labelled.clear()
    run(few, out, "label", "ply")
    assert len(labelled) == 1
    with pytest.warns(ChangedFileWarning, match=r"files of 1 frames were changed .*\(000003\)"):
        run(few, out, "npz", "ply")


def test_failures_of_frames_that_are_not_asked_for_stay_listed(few, tmp_path):
    (few / "masks/000002.json").unlink()
    out = tmp_path / "out"
    assert [failure.frame for failure in run(few, out, "npz").failures] == ["000002"]
    assert run(few, out, "npz", "label", frames=slice(5, 8)).failures == ()
    assert json.loads((out / "failures.jsonl").read_text())["frame"] == "000002"


def test_added_frames_and_formats_meet_no_file_of_others(tmp_path):
    source = layouts.kitti_object(tmp_path / "source", ("a", "a_panoptic"))
    for name in ("a", "a_panoptic"):
        layouts.write_text(source / f"masks/{name}.json", json.dumps(layouts.coco(20)))
    run(source, tmp_path / "out", "npz", frames=slice(1, 2))
    with pytest.raises(UnsafePathError, match="'a' and 'a_panoptic': would be written to one file"):
        run(source, tmp_path / "out", "panoptic", frames=slice(0, 1))


def test_frames_of_which_the_source_has_no_more_stay_in_the_journal(few, tmp_path):
    out = tmp_path / "out"
    run(few, out, "npz")
    for part, ending in (("velodyne", "bin"), ("calib", "txt"), ("image_2", "png")):
        (few / f"{part}/000004.{ending}").unlink()
    assert run(few, out, "npz", "label").n_done == 11
    assert list(runs.records(out)) == [*(f"{k:06d}" for k in range(12) if k != 4), "000004"]


@pytest.mark.parametrize(
    ("step", "n"),
    [
        pytest.param("file synced, not renamed", 5, id="a file"),
        pytest.param("file renamed", 9, id="files that the journal does not know"),
        pytest.param("line half written", 1, id="half a line"),
        pytest.param("line written", 2, id="lines of some"),
        pytest.param("journal in order, not renamed", 1, id="the journal"),
    ],
)
def test_killed_while_formats_are_added(source, tmp_path, step, n):
    words = runs.arguments(source, tmp_path / "out")
    assert command(*words, "--frames", ":40", "--formats", "npz").exit_code == 0
    more = [*words, "--formats", "npz,label,ply"]
    killed = runs.killed(step, n, more)
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    outcome = command(*more)
    assert outcome.exit_code == 0, outcome.output
    assert "were changed" not in outcome.output
    assert command(*runs.arguments(source, tmp_path / "at once"), "--formats", "npz,label,ply").exit_code == 0
    assert runs.contents(tmp_path / "out") == runs.contents(tmp_path / "at once")
