import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import ldls
from batch import runs
from command import command
from ldls.io.labels import write_annotations, write_labeling
from ldls.labeling import Labeling

NAMES = ("background", "Car", "Pedestrian", "Van")


def write_frame(folder, name, truth, prediction):
    for side, classes, write, ending in (
        ("truth", truth, write_annotations, ".txt"),
        ("mine", prediction, write_labeling, ".npz"),
    ):
        (folder / side).mkdir(exist_ok=True)
        array = np.array(classes)
        write(folder / side / f"{name}{ending}", Labeling(array, (array > 0).astype(int), array < 0, NAMES))


@pytest.fixture
def frames(tmp_path):
    write_frame(tmp_path, "1", [1, 1, 0, 2], [1, 1, 0, 0])
    write_frame(tmp_path, "2", [1, 1, 3, 0], [1, 0, 1, 0])
    return tmp_path


def evaluate(folder, *options):
    return command("evaluate", folder / "mine", folder / "truth", *options)


def scores(folder):
    """Scores by class and column."""
    rows = json.loads((folder / "semantic.json").read_text())["rows"]
    return {f"{row['class']} {column}": value for row in rows for column, value in row.items()}


def test_tables_are_printed_and_written(frames):
    outcome = evaluate(frames, "--out", frames / "new/tables", "--name", "my method")
    assert outcome.exit_code == 0, outcome.output
    for text in ("my method", "Points by class", "Instances", "Panoptic quality", "2 frames, 7 of 8 points counted"):
        assert text in outcome.output
    written = {path.name for path in (frames / "new/tables").iterdir()}
    assert written == {
        f"{stem}.{ending}"
        for stem in ("semantic", "instances", "panoptic", "frames")
        for ending in ("md", "csv", "json")
    }
    row = scores(frames / "new/tables")
    assert (row["Car precision"], row["Car recall"], row["Pedestrian recall"]) == (100.0, 75.0, 0.0)


def test_tables_are_written_where_nobody_reads_what_is_printed(frames):
    (frames / "mine/2.npz").unlink()
    words = ["evaluate", frames / "mine", frames / "truth", "--missing", "skip", "--out", frames / "tables"]
    with runs.started(words) as running:
        running.stdout.close()
        running.wait()
    assert scores(frames / "tables")["Car recall"] == 100


@pytest.mark.parametrize(
    ("words", "read", "out"),
    [
        pytest.param("label:mine/semantic.json truth/1.txt", "mine/semantic.json", "mine", id="predictions"),
        pytest.param("mine/1.npz annotations:truth/tracking.csv", "truth/tracking.csv", "truth", id="truth"),
        pytest.param(
            "mine/reliability.npz truth/1.txt --calib . --image mine", "mine/reliability.png", "mine", id="image"
        ),
        pytest.param("mine/1.npz truth/1.txt --beside a=label:mine/frames.md", "mine/frames.md", "link", id="beside"),
    ],
)
def test_tables_are_written_over_no_input(frames, monkeypatch, words, read, out):
    monkeypatch.chdir(frames)
    (frames / "link").symlink_to("mine")
    shutil.copy("mine/1.npz", "mine/reliability.npz")
    (frames / read).write_bytes(b"mine")
    outcome = command("evaluate", *words.split(), "--out", out, COLUMNS="500")
    assert outcome.exit_code == 1
    assert outcome.stderr.startswith(f"error: --out: would write over {out}/"), outcome.stderr
    assert (frames / read).read_bytes() == b"mine"
    assert not list((frames / out).glob("panoptic*"))


def test_tables_may_lie_with_the_labels_and_be_written_again(frames):
    for _ in range(2):
        outcome = evaluate(frames, "--out", frames / "mine")
        assert outcome.exit_code == 0, outcome.output


def test_methods_stand_side_by_side(frames):
    shutil.copytree(frames / "mine", frames / "other")
    outcome = evaluate(frames, "--beside", f"a network={frames / 'other'}", "--out", frames / "t")
    assert outcome.exit_code == 0, outcome.output
    rows = json.loads((frames / "t/semantic.json").read_text())["rows"]
    assert [row["method"] for row in rows] == ["mine"] * 3 + ["a network"] * 3
    assert [row["IoU"] for row in rows[:3]] == [row["IoU"] for row in rows[3:]]
    assert "\n2 frames, 7 of 8 points counted" in outcome.output
    assert "do not compare" not in outcome.output


@pytest.fixture
def results(tmp_path, small_scene):
    """A whole result in `mine`, and the two boxes before the wall in `truth`."""
    points, masks, camera = small_scene
    (tmp_path / "mine").mkdir()
    (tmp_path / "truth").mkdir()
    instances = np.where(points[:, 2] < 12, np.where(points[:, 0] < 0, 2, 1), 0)
    truth = Labeling(instances, instances, np.zeros(len(points), bool), NAMES)
    for name in "12":
        ldls.save(ldls.segment(points, masks, camera), tmp_path / f"mine/{name}.npz")
        write_annotations(tmp_path / f"truth/{name}.txt", truth)
    return tmp_path


def test_whole_results_tell_what_their_masks_allow_and_how_sure_they_are(results):
    outcome = evaluate(results, "--out", results / "t")
    assert outcome.exit_code == 0, outcome.output
    rows = json.loads((results / "t/semantic.json").read_text())["rows"]
    assert [row["method"] for row in rows] == ["mine"] * 3 + ["bound"] * 3
    assert [row["IoU"] for row in rows[3:]] == [100.0] * 3
    rows = json.loads((results / "t/reliability.json").read_text())["rows"]
    assert [(row["method"], row["points"]) for row in rows] == [("mine", "in view"), ("mine", "of objects")]
    mean = np.mean([ldls.read_result(results / f"mine/{name}.npz").confidence for name in "12"])
    assert rows[0]["confidence"] == pytest.approx(100 * mean, rel=1e-6)  # all points are in view
    assert {"coverage.md", "coverage.png", "reliability.png"} <= {path.name for path in (results / "t").iterdir()}
    assert "reliability.png, coverage.png to" in outcome.output


def test_of_labels_of_several_sweeps_the_bound_is_said_to_be_of_each_alone(results):
    said = "bound: of the masks of each sweep alone; labels of 1 frame come from those of other sweeps, too"
    assert "bound: of" not in evaluate(results).output
    result = ldls.read_result(results / "mine/2.npz")
    ldls.save(replace(result, report=replace(result.report, n_sweeps=5)), results / "mine/2.npz")
    assert said in evaluate(results).output


def test_where_one_result_is_not_whole_there_is_no_bound(results):
    result = ldls.read_result(results / "mine/2.npz")
    write_labeling(results / "mine/2.npz", Labeling.from_segmentation(result))
    outcome = evaluate(results, "--out", results / "t")
    assert outcome.exit_code == 0, outcome.output
    assert "bound" not in outcome.output
    assert "Reliability" not in outcome.output
    assert not (results / "t/coverage.png").exists()


def test_a_method_of_the_name_bound_stays(results):
    outcome = evaluate(results, "--out", results / "t", "--name", "bound")
    assert outcome.exit_code == 0, outcome.output
    assert len(json.loads((results / "t/semantic.json").read_text())["rows"]) == 3


def test_a_confidence_out_of_range_is_one_line(results):
    with np.load(results / "mine/2.npz") as file:
        arrays = dict(file)
    np.savez(results / "mine/2.npz", **arrays | {"confidence": arrays["confidence"] + 1})
    outcome = evaluate(results)
    assert outcome.exit_code == 1
    assert "frame 2: expected confidence from 0 to 1" in outcome.stderr
    np.savez(results / "mine/2.npz", **arrays | {"confidence": arrays["labels"].astype(str)})
    outcome = evaluate(results)
    assert outcome.exit_code == 1
    assert "2.npz: confidence is <U" in outcome.stderr


def test_a_point_that_one_method_leaves_out_counts_for_none(frames):
    shutil.copytree(frames / "mine", frames / "other")
    write_labeling(
        frames / "other/1.npz", Labeling(np.array([1, 1, 0, 0]), np.array([1, 1, 0, 0]), np.arange(4) > 2, NAMES)
    )
    outcome = evaluate(frames, "--beside", f"other={frames / 'other'}", "--out", frames / "t")
    assert outcome.exit_code == 0, outcome.output
    rows = json.loads((frames / "t/semantic.json").read_text())["rows"]
    # the pedestrian that both would have missed is the point left out
    assert [row["true points"] for row in rows if row["class"] == "Pedestrian"] == [0, 0]
    assert "2 frames, 6 of 8 points counted; no method is scored on those out of view by other" in outcome.output


def test_methods_of_different_frames_do_not_compare(frames):
    shutil.copytree(frames / "mine", frames / "other")
    (frames / "other/2.npz").unlink()
    outcome = evaluate(frames, "--beside", f"other={frames / 'other'}", "--missing", "skip")
    assert outcome.exit_code == 0, outcome.output
    assert "mine: 2 frames, 7 of 8 points counted" in outcome.output
    assert "other: 1 frame, 4 of 4 points counted" in outcome.output
    assert "their scores do not compare" in outcome.output


@pytest.fixture
def seen(tmp_path, small_scene):
    """Ours as .npz, the same labels as .label with 0 out of view, and whole true labels of 300 points all around."""
    points, masks, camera = small_scene
    behind = points * (1, 1, -1)
    result = ldls.segment(np.vstack([points, behind]), masks, camera)
    for folder in ("ours", "theirs", "truth"):
        (tmp_path / folder).mkdir()
    ldls.save(result, tmp_path / "ours/7.npz")
    ldls.save(result, tmp_path / "theirs/7.label")
    # a car stands behind, which nobody can find in the image
    one = np.where(points[:, 2] < 12, np.where(points[:, 0] < 0, 30 | 1 << 16, 10 | 2 << 16), 40)
    np.tile(one, 2).astype("<u4").tofile(tmp_path / "truth/7.label")
    np.save(tmp_path / "7.npy", result.points)
    return tmp_path


def scores_by_method(folder):
    rows = json.loads((folder / "semantic.json").read_text())["rows"]
    return {(row.pop("method"), row["class"]): row for row in rows}


def test_equal_labels_of_different_formats_have_equal_scores(seen):
    words = [seen / "theirs", seen / "truth", "--beside", f"mine={seen / 'ours'}", "--out", seen / "t"]
    outcome = command("evaluate", *words)
    assert outcome.exit_code == 0, outcome.output
    found = scores_by_method(seen / "t")
    for name in ("Car", "Pedestrian", "mean"):
        assert found["theirs", name] == found["mine", name]
    assert found["theirs", "Car"]["true points"] == 120
    assert found["theirs", "Car"]["IoU"] > 90
    # the bound is that of the method that has masks, whichever comes first
    assert found["bound", "Car"]["IoU"] >= found["mine", "Car"]["IoU"]
    assert "500 of 1,000 points counted; no method is scored on those out of view by mine" in outcome.output
    instances = json.loads((seen / "t/instances.json").read_text())["rows"]
    counts = {(row.pop("method"), *row.values()) for row in instances}
    assert {row[1:] for row in counts if row[0] == "theirs"} == {row[1:] for row in counts if row[0] == "mine"}


def test_labels_alone_count_everywhere_unless_a_calibration_tells(seen):
    words = ["evaluate", seen / "theirs", seen / "truth", "--out", seen / "t"]
    outcome = command(*words)
    assert outcome.exit_code == 0, outcome.output
    assert scores_by_method(seen / "t")["theirs", "Car"]["true points"] == 240
    assert "1,000 of 1,000 points counted; no file tells which points a camera sees" in outcome.output
    (seen / "7.txt").write_text(
        "P2: 100 0 40 0 0 100 30 0 0 0 1 0\nR0_rect: 1 0 0 0 1 0 0 0 1\nTr_velo_to_cam: 1 0 0 0 0 1 0 0 0 0 1 0\n"
    )
    Image.new("RGB", (80, 60)).save(seen / "7.png")
    outcome = command(*words, "--calib", seen, "--points", seen, "--image", seen)
    assert outcome.exit_code == 0, outcome.output
    assert scores_by_method(seen / "t")["theirs", "Car"]["true points"] == 120
    assert "500 of 1,000 points counted; no method is scored on those out of view by the calibration" in outcome.output
    outcome = command(*words, "--calib", seen)
    assert outcome.exit_code == 1
    assert "frame 7: needs its points; name their folder (--points)" in outcome.stderr


def test_each_method_has_the_format_that_its_files_tell(seen):
    result = ldls.read_result(seen / "ours/7.npz")
    folders = ("ours", "nuscenes", "text")
    for folder in folders[1:]:
        (seen / folder).mkdir()
    ldls.save(result, seen / "nuscenes/7_panoptic.npz")
    write_annotations(seen / "text/7.txt", Labeling.from_segmentation(result))
    others = (f"--beside={name}={seen / folder}" for name, folder in zip("abc", folders, strict=True))
    outcome = command("evaluate", seen / "theirs", seen / "truth", "--out", seen / "t", *others)
    assert outcome.exit_code == 0, outcome.output
    found = scores_by_method(seen / "t")
    for name in "abc":
        assert found[name, "mean"] == found["theirs", "mean"]


def test_a_format_can_be_said_of_each_side(seen):
    result = ldls.read_result(seen / "ours/7.npz")
    ldls.save(result, seen / "ours/7.label")
    (seen / "truth/7.label").rename(seen / "truth/7.data")
    words = [f"label:{seen / 'ours/7.label'}", f"label:{seen / 'truth/7.data'}", "--out", seen / "t"]
    outcome = command("evaluate", *words, "--beside", f"whole=npz:{seen / 'ours/7.npz'}", "--missing", "skip")
    assert outcome.exit_code == 0, outcome.output
    found = scores_by_method(seen / "t")
    assert found["7", "mean"] == found["whole", "mean"]


def test_a_method_of_another_number_of_points_is_refused(seen):
    (seen / "other").mkdir()
    nothing = np.zeros(999, np.uint32)
    nothing.tofile(seen / "other/7.label")
    words = ["evaluate", seen / "theirs", seen / "truth", "--beside"]
    outcome = command(*words, f"other={seen / 'other'}")
    assert outcome.exit_code == 1
    assert f"{seen / 'other/7.label'}: frame 7: prediction has 999 points, truth 1,000" in outcome.stderr
    write_labeling(seen / "other/7.npz", Labeling(nothing, nothing, nothing > 0, NAMES))
    outcome = command(*words, f"other={seen / 'other'}")
    assert outcome.exit_code == 1
    assert "frame 7: other has 999 points, the truth 1,000; all must be of the whole cloud" in outcome.stderr


@pytest.mark.parametrize(
    ("text", "message"),
    [
        pytest.param("other", "expected NAME=PATH, or NAME=FORMAT:PATH", id="no name"),
        pytest.param("=mine", "expected NAME=PATH, or NAME=FORMAT:PATH", id="an empty name"),
        pytest.param("other=nowhere", "nowhere: no such file or folder; expected PATH, or FORMAT:PATH", id="no path"),
        pytest.param("other=cvat:mine", "FORMAT:PATH with one of npz, panoptic, label, lidarseg", id="no such format"),
        pytest.param("mine=mine", "'mine' is the name of another method; give each its own (--name)", id="twice"),
    ],
)
def test_another_method_needs_a_name_of_its_own_and_a_path(frames, monkeypatch, text, message):
    monkeypatch.chdir(frames)
    outcome = evaluate(frames, "--beside", text)
    assert outcome.exit_code == 1
    assert message in outcome.stderr


def test_options_reach_the_scores(frames):
    assert evaluate(frames, "--out", frames / "t", "--leave-out", "").exit_code == 0
    assert scores(frames / "t")["Car precision"] == 75.0
    assert evaluate(frames, "--out", frames / "t", "--categories", "Van,Car").exit_code == 0
    assert scores(frames / "t")["Van recall"] == 0.0
    assert evaluate(frames, "--out", frames / "t", "--min-points", "2").exit_code == 0
    rows = json.loads((frames / "t/instances.json").read_text())["rows"]
    assert [row["FN"] for row in rows if row["class"] == "Pedestrian"] == [0, 0]


def test_images_without_the_cameras_that_took_them_are_refused(frames):
    outcome = evaluate(frames, "--image", frames)
    assert outcome.exit_code == 1
    assert "--image: its images say what a camera of --calib sees" in outcome.stderr


def test_range_comes_of_the_points(frames):
    for name in "12":
        np.save(frames / f"{name}.npy", np.array([[1, 0, 0], [30, 0, 0], [1, 1, 0], [2, 0, 0]], np.float32))
    outcome = evaluate(frames, "--max-range", "20")
    assert outcome.exit_code == 1
    assert "has no ranges of its points; give its --points" in outcome.stderr
    outcome = evaluate(frames, "--max-range", "20", "--points", frames, "--out", frames / "t")
    assert outcome.exit_code == 0, outcome.output
    assert scores(frames / "t")["Car recall"] == 100.0
    assert "5 of 8 points counted" in outcome.output


def test_a_frame_without_its_pair(frames):
    (frames / "mine/2.npz").unlink()
    outcome = evaluate(frames, "--out", frames / "t")
    assert outcome.exit_code == 1
    assert outcome.stderr.startswith("error: frames without their pair: 2 of ")
    assert not (frames / "t").exists()
    outcome = evaluate(frames, "--missing", "skip")
    assert outcome.exit_code == 0, outcome.output
    assert "1 frame, 4 of 4" in outcome.output
    assert "left out for want of their pair: 1 frame" in outcome.output


@pytest.mark.parametrize(
    ("change", "message"),
    [
        pytest.param(
            lambda f: write_frame(f, "1", [1, 1], [1, 1, 1]), "frame 1: prediction has 3 points, truth 2", id="length"
        ),
        pytest.param(lambda f: (f / "truth/1.txt").write_text("1 gnome\n" * 4), "['gnome']", id="unknown class"),
        pytest.param(lambda f: (f / "truth/1.txt").write_text("Car\n" * 4), "line 1: expected 'instance", id="broken"),
        pytest.param(lambda f: (f / "mine/1.npz").write_bytes(b"PK"), "not a whole .npz", id="cut prediction"),
    ],
)
def test_bad_files_are_one_line_and_nothing_is_written(frames, change, message):
    change(frames)
    outcome = evaluate(frames, "--out", frames / "t")
    assert outcome.exit_code == 1
    assert message in outcome.stderr
    assert not (frames / "t").exists()


def test_formats_are_asked_for_where_no_file_tells(frames):
    for name in "12":
        (frames / f"truth/{name}.txt").write_text("")
    outcome = evaluate(frames)
    assert outcome.exit_code == 1
    assert "may be kitti-boxes or annotations; say which by FORMAT:PATH" in outcome.stderr
    outcome = command("evaluate", frames / "mine", f"kitti-boxes:{frames / 'truth'}")
    assert outcome.exit_code == 1
    assert "frame 1: needs its points" in outcome.stderr


def test_real_frames_against_their_boxes(data_folder, tmp_path):
    training = data_folder / "kitti/training"
    out = tmp_path / "results"
    labels = tmp_path / "label_2"
    labels.mkdir()
    for name in ("000000", "000003"):
        shutil.copy(training / f"label_2/{name}.txt", labels)
        outcome = command(
            "segment", "--points", training / f"velodyne/{name}.bin", "--calib", training / f"calib/{name}.txt",
            "--masks", training / f"masks/{name}.json", "--out", out, "--formats", "npz",
        )  # fmt: skip
        assert outcome.exit_code == 0, outcome.output
    words = ["evaluate", out, labels, "--points", training / "velodyne", "--calib", training / "calib"]
    outcome = command(*words, "--image", training / "image_2", "--out", tmp_path / "t")
    assert outcome.exit_code == 0, outcome.output
    row = scores(tmp_path / "t")
    assert row["Car IoU"] > 60
    assert row["Pedestrian IoU"] > 60
    outcome = command(*words)
    assert outcome.exit_code == 0, outcome.output
    (warning,) = outcome.stderr.strip().splitlines()
    assert warning.endswith("name their folder (--image)")


def test_names_of_ones_own_can_be_background(frames):
    (frames / "truth/1.txt").write_text("1 Car\n1 Car\n1 gnome\n0 background\n")
    outcome = evaluate(frames, "--background", "gnome", "--out", frames / "t")
    assert outcome.exit_code == 0, outcome.output
    assert scores(frames / "t")["Car precision"] == 100.0


def test_a_scored_name_that_occurs_nowhere_is_warned_of_beside_the_tables(frames):
    (frames / "truth/1.txt").write_text("1 Car\n1 gnome\n0 background\n0 background\n")
    outcome = evaluate(frames, "--categories", "car,persn", "--background", "gnome", "--out", frames / "t")
    assert outcome.exit_code == 0
    assert outcome.stderr.endswith("warning: --categories: 'persn' is unknown; did you mean 'person'?\n")
    assert scores(frames / "t")["car recall"] > 0
    outcome = evaluate(frames, "--categories", "car,gnom", "--background", "gnome")
    assert outcome.stderr.endswith("warning: --categories: 'gnom' is unknown; did you mean 'gnome'?\n")
    # of one's own, and of a vocabulary though no frame has it
    outcome = evaluate(frames, "--categories", "Gnome,zebra,Car", "--out", frames / "t")
    assert outcome.exit_code == 0
    assert "warning" not in outcome.stderr
    assert scores(frames / "t")["Gnome recall"] == 0.0


def test_scored_names_that_all_occur_nowhere_are_refused(frames):
    outcome = evaluate(frames, "--categories", "persn,forklft", "--out", frames / "t")
    assert outcome.exit_code == 1
    assert outcome.stderr.endswith("error: --categories: 'persn' is unknown; did you mean 'person'?\n")
    assert not (frames / "t").exists()


@pytest.fixture
def drive(tmp_path):
    """Four sweeps with two cars and a person; `switching` gives one car another number at half time."""
    for folder in ("truth", "steady", "switching", "anew"):
        (tmp_path / folder).mkdir()
    classes = np.array([10, 10, 10, 10, 252, 252, 30, 40], "<u4")
    for sweep in range(4):
        numbers = {
            "truth": [1, 1, 1, 1, 2, 2, 3, 0],
            "steady": [700, 700, 700, 700, 60_000, 60_000, 2, 0],
            "switching": [1 + sweep // 2 * 4] * 4 + [2, 2, 3, 0],
            "anew": [10 * sweep + number for number in (1, 1, 1, 1, 2, 2, 3, 0)],
        }
        for folder, each in numbers.items():
            (classes | np.array(each, "<u4") << 16).tofile(tmp_path / folder / f"{sweep:06}.label")
    return tmp_path


def tracking(folder):
    rows = json.loads((folder / "tracking.json").read_text())["rows"]
    return {(row["method"], row["class"]): row for row in rows}


def test_a_drive_is_scored_over_its_sweeps(drive):
    others = (f"--beside={name}={drive / name}" for name in ("switching", "anew"))
    words = [drive / "steady", drive / "truth", *others, "--out", drive / "t"]
    outcome = command("evaluate", *words, "--track")
    assert outcome.exit_code == 0, outcome.output
    assert "Objects over the drive" in outcome.output
    assert "panoptic, tracking and frames as .md, .csv and .json" in outcome.output
    rows = tracking(drive / "t")
    assert (rows["steady", "all"]["LSTQ"], rows["steady", "all"]["MOTSA"]) == (100.0, 100.0)
    found = rows["switching", "all"]
    assert (found["objects"], found["object frames"], found["id switches"]) == (3, 12, 1)
    assert found["S_assoc"] == pytest.approx(100 * (0.5 + 1 + 1) / 3)
    assert rows["switching", "Car"]["S_assoc"] == pytest.approx(75.0)
    assert found["a hundred frames"] == pytest.approx(100 / 12)
    assert rows["anew", "all"]["S_assoc"] == pytest.approx(25.0)
    assert rows["anew", "all"]["id switches"] == 9
    assert "tracking" not in command("evaluate", *words).output


def test_numbers_of_every_format_that_has_them_are_followed(drive):
    # truth as arrays, and a prediction as of nuScenes: its numbers count from 1 in each class
    (drive / "arrays").mkdir()
    (drive / "nuscenes").mkdir()
    for sweep in range(4):
        values = np.fromfile(drive / f"truth/{sweep:06}.label", "<u4")
        classes = np.array([1, 1, 1, 1, 1, 1, 2, 0])
        write_labeling(drive / f"arrays/{sweep:06}.npz", Labeling(classes, values >> 16, np.zeros(8, bool), NAMES))
        panoptic = np.array([17001] * 4 + [17002] * 2 + [2001, 0], np.uint16)
        np.savez(drive / f"nuscenes/{sweep:06}_panoptic.npz", data=panoptic)
    words = [drive / "nuscenes", drive / "arrays", f"--beside=steady={drive / 'steady'}"]
    outcome = command("evaluate", *words, "--track", "--out", drive / "t")
    assert outcome.exit_code == 0, outcome.output
    rows = tracking(drive / "t")
    for method in ("nuscenes", "steady"):
        assert (rows[method, "all"]["LSTQ"], rows[method, "all"]["objects"]) == (100.0, 3)


def test_labels_of_single_frames_are_no_drive_where_their_run_has_tracks(drive):
    for method in ("anew", "steady"):
        (drive / method / "tracks").mkdir()
    (drive / "anew/tracks/tracks.json").write_text("{}")
    words = [drive / "steady", drive / "truth", f"--beside=anew={drive / 'anew'}"]
    outcome = command("evaluate", *words, "--track")
    assert outcome.exit_code == 1
    assert f"--track: files in {drive / 'anew'} number the objects of each frame anew" in outcome.stderr
    assert outcome.stderr.rstrip().endswith(f"which are in {drive / 'anew/tracks'}")
    assert command("evaluate", *words).exit_code == 0


def test_what_masks_allow_is_no_drive(results):
    outcome = evaluate(results, "--track", "--out", results / "t")
    assert outcome.exit_code == 0, outcome.output
    assert {method for method, _ in tracking(results / "t")} == {"mine"}


def test_boxes_are_no_truth_of_a_drive(seen):
    (seen / "boxes").mkdir()
    (seen / "boxes/7.txt").write_text("Car 0 0 0 0 0 9 9 1.5 1.6 4 0 1 20 0\n")
    outcome = command("evaluate", seen / "theirs", f"kitti-boxes:{seen / 'boxes'}", "--track")
    assert outcome.exit_code == 1
    assert "--track: TRUTH is kitti-boxes, which numbers the objects of each frame anew" in outcome.stderr


def test_the_classes_of_nuscenes_are_scored_together(tmp_path):
    for side, codes in (("mine", [17, 2, 0, 17, 7]), ("truth", [17, 2, 2, 7, 7])):
        (tmp_path / side).mkdir()
        np.array(codes, np.uint8).tofile(tmp_path / side / "1_lidarseg.bin")
    outcome = evaluate(tmp_path, "--categories", "nuscenes", "--out", tmp_path / "t")
    assert outcome.exit_code == 0, outcome.output
    # the strollers do not count
    assert "1 frame, 3 of 5 points counted" in outcome.output
    row = scores(tmp_path / "t")
    assert (row["car IoU"], row["pedestrian IoU"], row["barrier IoU"]) == (100.0, 50.0, None)
    assert "1 frame, 3 of 5 points counted" in evaluate(tmp_path, "--categories", "nuScenes").output
    outcome = evaluate(tmp_path, "--categories", "nuScenes,car")
    assert outcome.exit_code == 1
    assert outcome.output == "error: --categories: nuscenes stands for all 16 classes of its challenge; give it alone\n"
    outcome = evaluate(tmp_path, "--categories", "nuscenes", "--leave-out", "Van")
    assert outcome.exit_code == 1
    assert "--leave-out: the 16 classes of nuScenes have their own; leave it out" in outcome.output
