"""`ldls view`, and --rerun of other commands, from the outside."""

import csv
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import ldls
from command import command, process
from datasets import layouts
from ldls.cli.recording_options import default_target
from ldls.cli.view import image_files
from ldls.viewing import overlay
from viewing.recorded import Recorded, vectors


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(no_display, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def saved(small_scene, tmp_path):
    result = ldls.segment(*small_scene)
    ldls.save(result, tmp_path / "frame.npz")
    Image.new("RGB", (80, 60), (10, 90, 200)).save(tmp_path / "image.png")
    return result


def test_a_result_is_recorded_with_its_diffusion(saved):
    done = command("view", "frame.npz", "--image", "image.png")
    assert done.exit_code == 0, done.output
    assert "open it with: rerun frame.rrd" in done.output
    found = Recorded("frame.rrd")
    np.testing.assert_array_equal(vectors(found.last("world/points", "Points3D:positions")), saved.points)
    assert r"world/camera/camera\ 0/image" in found.entities
    assert len(found.each("diffusion/points", "Points3D:colors")) == 11
    assert command("view", "frame.npz", "--rerun", "plain.rrd", "--diffusion", 0).exit_code == 0
    plain = Recorded("plain.rrd")
    assert plain.timelines == {"frame"} and not plain.each(r"world/camera/camera\ 0/image/masks", "EncodedImage:blob")


def test_a_ring_takes_an_image_for_each_camera(small_scene, saved):
    points, masks, camera = small_scene
    views = [ldls.View(masks, camera, "left"), ldls.View(masks, camera, "right")]
    ldls.save(ldls.segment(points, views), "ring.npz")
    for images in (["image.png", "image.png"], ["right=image.png", "left=image.png"]):
        done = command("view", "ring.npz", *(word for image in images for word in ("--image", image)), "--diffusion", 0)
        assert done.exit_code == 0, done.output
        assert {"world/camera/left/image", "world/camera/right/image"} <= Recorded("ring.rrd").entities
    for image, message in {"image.png": "of which camera", "nosuch=image.png": "no camera nosuch"}.items():
        done = command("view", "ring.npz", "--image", image, "--diffusion", 0)
        assert done.exit_code == 1 and message in done.stderr and "one of left, right" in done.stderr
    one = command("view", "ring.npz", "--image", "right=image.png", "--diffusion", 0)
    assert one.exit_code == 0 and "world/camera/left/image" not in Recorded("ring.rrd").entities


def test_images_without_a_name_are_of_the_cameras_that_are_not_named():
    for texts in (["cam3=a.png", "b.png", "c.png"], ["b.png", "cam3=a.png", "c.png"], ["b.png", "c.png", "cam3=a.png"]):
        files = image_files(texts, ("cam1", "cam2", "cam3"))
        assert files == {"cam1": "b.png", "cam2": "c.png", "cam3": "a.png"}


def test_names_of_images_may_have_a_sign_of_equality(tmp_path):
    file = str(tmp_path / "a=b.png")
    Path(file).touch()
    assert image_files([file], ("camera 0",)) == {"camera 0": file}
    assert image_files([file, "c.png"], ("cam1", "cam2")) == {"cam1": file, "cam2": "c.png"}


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        pytest.param(["cam1=a.png", "cam1=b.png"], "cam1 has a.png and b.png", id="two of a camera"),
        pytest.param(["a.png"] * 4, "got 4 images", id="too many"),
        pytest.param(["a.png"], "a.png is of which camera? Expected CAMERA=FILE with one of cam1, cam2", id="one"),
        pytest.param(["cam2=b.png", "a.png"], "a.png is of which camera? .* one of cam1, cam3", id="one of two"),
        pytest.param(["nosuch=b.png"], "no camera nosuch, expected one of cam1, cam2, cam3", id="no such camera"),
    ],
)
def test_images_of_no_one_camera_are_refused(texts, message):
    with pytest.raises(ldls.InputError, match=message.replace("?", r"\?")):
        image_files(texts, ("cam1", "cam2", "cam3"))


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("drive")
    words = "simulate --layout kitti-raw --count 3 --lidar vlp-16 --rig robot --cores 1"
    done = command(*words.split(), folder)
    assert done.exit_code == 0, done.output
    (found,) = folder.glob("*/*_sync")
    return found


def test_a_drive_is_segmented_and_recorded_frame_by_frame(drive):
    done = command("view", drive, "--masks", drive / "masks_02", "--rerun", "drive.rrd")
    assert done.exit_code == 0, done.output
    assert "3 of 3 frames; wrote drive.rrd" in done.output
    found = Recorded("drive.rrd")
    rows = found.each("world/points", "Points3D:positions")
    assert [row.times["frame"] for row in rows] == [0, 1, 2] and found.timelines == {"frame", "time"}
    source = ldls.datasets.open_source(drive)
    for index, row in enumerate(rows):
        frame = source[index]
        np.testing.assert_array_equal(vectors(row.values["Points3D:positions"]), frame.points[:, :3])
        assert row.times["time"] == pytest.approx(frame.stamp * 1e9, abs=1e3)
        masks = ldls.read_masks(drive / f"masks_02/{frame.name}.json")
        expected = ldls.segment(frame.points, masks, frame.images[0].camera).categories
        np.testing.assert_array_equal(row.values["Points3D:class_ids"].to_numpy(), expected)
    assert "world/truth" in found.entities and "diffusion" not in found.entities


def test_without_masks_frames_are_shown_as_they_are(drive):
    done = command("view", drive, "--frames", "1", "--rerun", "raw.rrd")
    assert done.exit_code == 0 and "1 of 3 frames" in done.output, done.output
    found = Recorded("raw.rrd")
    assert "world/truth" in found.entities and "world/objects" not in found.entities
    assert len(found.each("world/points", "Points3D:positions")) == 1


def test_results_of_a_run_are_shown_and_nothing_is_segmented(drive, monkeypatch):
    words = ["--out", "results", "--formats", "npz", "--frames", "0:2"]
    done = command("run", drive, "--masks", drive / "masks_02", *words)
    assert done.exit_code == 0, done.output
    monkeypatch.setattr("ldls.label_diffusion.diffuse_labels", None)
    done = command("view", drive, "--results", "results", "--frames", "0:2", "--rerun", "a.rrd")
    assert done.exit_code == 0, done.output
    name = ldls.datasets.open_source(drive).names[1]
    row = Recorded("a.rrd").each("world/points", "Points3D:class_ids")[1].values
    with np.load(f"results/{name}.npz") as stored:
        np.testing.assert_array_equal(row["Points3D:class_ids"].to_numpy(), stored["categories"])


@pytest.mark.parametrize("target", [["--picture", "seen.png"], ["--rerun", "seen.rrd"]], ids=["picture", "recording"])
def test_results_of_another_drive_are_refused(drive, tmp_path, target):
    done = command("run", drive, "--masks", drive / "masks_02", "--out", "out", "--formats", "npz", "--frames", "0:2")
    assert done.exit_code == 0, done.output
    first, second = ldls.datasets.open_source(drive).names[:2]
    shutil.copy(f"out/{second}.npz", f"out/{first}.npz")
    expected, got = (len(ldls.datasets.open_source(drive)[index].points) for index in (0, 1))
    message = f"out/{first}.npz: expected {expected:,} points, those of frame {first} of {drive}, got {got:,}; give"
    alone = command("view", drive, "--results", "out", "--frames", "0", *target)
    assert alone.exit_code == 1 and message in " ".join(alone.stderr.split()), alone.output
    assert not list(tmp_path.glob("seen*"))
    both = command("view", drive, "--results", "out", "--frames", "0:2", *target)
    assert both.exit_code == 2 and f"{first} failed" in both.output and "1 of 3 frames" in both.output, both.output


def test_a_frame_that_the_run_has_not_done_is_named_as_such(drive):
    done = command("run", drive, "--masks", drive / "masks_02", "--out", "out", "--formats", "npz", "--frames", "0:1")
    assert done.exit_code == 0, done.output
    name = ldls.datasets.open_source(drive).names[1]
    both = command("view", drive, "--results", "out", "--frames", "0:2", "--rerun", "seen.rrd")
    said = (
        f"{name} failed: --results: out has no {name}.npz; `ldls run` has not done this frame; run it, or choose others"
    )
    assert both.exit_code == 2 and f"{said} by --frames" in " ".join(both.stderr.split()), both.output


def test_the_command_that_opens_a_recording_can_be_pasted(saved):
    done = command("view", "frame.npz", "--rerun", "mein Bild.rrd", "--diffusion", 0)
    assert done.exit_code == 0 and "open it with: rerun 'mein Bild.rrd'" in done.output


def test_objects_of_a_drive_keep_their_numbers(drive):
    done = command("run", drive, "--masks", drive / "masks_02", "--out", "out", "--sweeps", "1", "--track")
    assert done.exit_code == 0, done.output
    done = command("view", drive, "--results", "out/tracks", "--rerun", "a.rrd")
    assert done.exit_code == 0, done.output
    with Path("out/tracks.csv").open(newline="") as file:
        expected = {(row["frame"], f"{row['name']} {row['track']}") for row in csv.DictReader(file)}
    names = ldls.datasets.open_source(drive).names
    rows = Recorded("a.rrd").each("world/boxes")
    shown = [[label.partition(",")[0] for label in row.values["Boxes3D:labels"].to_pylist()] for row in rows]
    assert {(frame, label) for frame, own in zip(names, shown, strict=True) for label in own} == expected
    assert len(set.intersection(*map(set, shown))) > 3


def test_a_sweep_of_several_is_recorded_without_its_diffusion(drive, capfd):
    done = command("run", drive, "--masks", drive / "masks_02", "--out", "out", "--sweeps", "1")
    assert done.exit_code == 0, done.output
    first = f"out/{ldls.datasets.open_source(drive).names[0]}.npz"
    for words in ([first], [drive, "--results", "out", "--frames", "0:1"]):
        done = command("view", *words, "--rerun", "one.rrd")
        assert done.exit_code == 0, done.output
        assert done.output.count("without its diffusion: its graph has 3 sweeps") == 1
        found = Recorded("one.rrd")
        assert "world/points" in found.entities and "diffusion/points" not in found.entities
        none = command("view", *words, "--rerun", "one.rrd", "--diffusion", 0)
        assert none.exit_code == 0 and "without its diffusion" not in none.output
        wished = command("view", *words, "--rerun", "none.rrd", "--diffusion", 5)
        assert wished.exit_code == 1 and "error: --diffusion: cannot be shown, its graph has 3 sweeps" in wished.stderr
        assert not Path("none.rrd").exists() and "Dropping data" not in capfd.readouterr().err


def test_frames_that_fail_are_named_and_passed_over(tmp_path):
    source = layouts.kitti_object(tmp_path / "kitti")
    (source / "velodyne/000001.bin").write_bytes(b"123")
    done = command("view", source, "--rerun", "a.rrd")
    assert done.exit_code == 2
    assert done.stderr.startswith("000001 failed") and "2 of 3 frames" in done.stdout
    assert "failed" not in done.stdout
    assert len(Recorded("a.rrd").each("world/points", "Points3D:positions")) == 2
    for broken in (source / "velodyne").iterdir():
        broken.write_bytes(b"123")
    none = command("view", source, "--rerun", "b.rrd")
    assert none.exit_code == 1 and "not a multiple" in none.stderr
    assert not list(tmp_path.glob("*b.rrd*"))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        pytest.param(["frame.npz", "--rerun", "a.html"], "expected spawn or a file that ends in .rrd", id="target"),
        pytest.param(["frame.npz", "--masks", "m"], "frame.npz is a result", id="masks of a result"),
        pytest.param(["frame.npz", "--image", "image.png", "--image", "image.png"], "got 2 images", id="many images"),
        pytest.param(["frame.npz", "--image", "a=image.png"], "no camera a, expected one of camera 0", id="no camera"),
        pytest.param(["frame.npz", "--image", "nothing.png"], "nothing.png", id="no such image"),
        pytest.param(["kitti", "--image", "image.png"], "kitti is a source", id="an image of a source"),
        pytest.param(["no.npz", "--image", "image.png"], "no.npz: there is no such file", id="no such result"),
        pytest.param(["kitti", "--min-score", "0.5"], "choose among", id="scores without masks"),
        pytest.param(["kitti", "--results", "kitti", "--min-score", "0"], "--min-score", id="scores of labels"),
        pytest.param(["frame.npz", "--picture", "a.png", "--diffusion", "2"], "--rerun", id="diffusion of a picture"),
        pytest.param(["kitti", "--frames", "7:9"], "has 3 frames", id="no such frames"),
        pytest.param(["kitti", "--masks", "m", "--results", "kitti"], "one of them", id="labels from two places"),
        pytest.param(["kitti", "--results", "kitti"], "--formats npz", id="results of another format"),
        pytest.param(["nowhere"], "no such file or folder", id="nothing there"),
    ],
)
def test_wrong_wishes_are_refused(saved, tmp_path, arguments, message):
    layouts.kitti_object(tmp_path / "kitti")
    done = command("view", *arguments)
    assert done.exit_code == 1 and message in " ".join(done.stderr.split()), done.output
    assert not list(tmp_path.glob("*.rrd"))


def test_the_missing_extra_is_named_before_any_work(saved, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    done = command("view", "frame.npz")
    assert done.exit_code == 1 and "pip install 'ldls[viz]'" in done.stderr


def test_segment_and_demo_record_too(small_scene, saved, tmp_path):
    points, masks, camera = small_scene
    np.hstack([points, np.zeros((len(points), 1), np.float32)]).tofile("p.bin")
    ldls.save(masks, "m.npz")
    rows = {"P2": camera.projection, "R0_rect": np.eye(3), "Tr_velo_to_cam": np.eye(4)[:3]}
    layouts.write_text(tmp_path / "c.txt", "".join(f"{key}: {layouts.row(m)}\n" for key, m in rows.items()))
    words = "segment --points p.bin --calib c.txt --masks m.npz --image image.png --out out --rerun s.rrd --diffusion 4"
    done = command(*words.split())
    assert done.exit_code == 0 and "rerun s.rrd" in done.output, done.output
    found = Recorded("s.rrd")
    assert "world/camera/image_2/image" in found.entities
    assert len(found.each("diffusion/points", "Points3D:colors")) == 4
    done = command("demo", "--rerun", "d.rrd")
    assert done.exit_code == 0 and "world/boxes" in Recorded("d.rrd").entities, done.output
    bad = command(*words.replace("s.rrd", "s.png").split())
    assert bad.exit_code == 1


def test_where_there_is_a_display_the_viewer_is_the_target(monkeypatch):
    assert default_target("a") == "a.rrd"
    monkeypatch.setenv("DISPLAY", ":0")
    assert default_target("a") == "spawn"


def test_the_command_ends_by_itself_and_says_one_line(saved):
    done = process("view", "frame.npz", "--rerun", "a.rrd")
    assert (done.returncode, done.stderr) == (0, "") and len(done.stdout.splitlines()) == 1


def test_a_result_as_pictures_needs_no_recording(saved, tmp_path):
    done = command("view", "frame.npz", "--image", "image.png", "--picture", "seen.png")
    assert done.exit_code == 0, done.output
    assert {path.name for path in tmp_path.glob("seen*")} == {"seen.png", "seen-birds-eye.png", "seen-comparison.png"}
    assert not list(tmp_path.glob("*.rrd"))
    assert command("view", "frame.npz", "--picture", "seen.png", "--rerun", "seen.rrd").exit_code == 0
    assert (tmp_path / "seen.rrd").is_file()


def test_an_image_of_another_size_leaves_no_picture(saved, tmp_path):
    Image.new("RGB", (60, 80)).save(tmp_path / "other.png")
    done = command("view", "frame.npz", "--image", "other.png", "--picture", "seen.png")
    assert done.exit_code == 1 and "got 80 x 60 (height x width), the masks are of 60 x 80" in done.stderr
    assert not list(tmp_path.glob("seen*"))


@pytest.mark.parametrize(
    ("picture", "message"),
    [("seen.jpg", "cannot write '.jpg' pictures, expected .png"), ("nowhere/seen.png", "no such folder to write to")],
)
def test_a_place_that_no_picture_can_be_written_to_is_refused_before_anything_is_drawn(
    saved, drive, tmp_path, picture, message
):
    of_frames = [drive, "--masks", drive / "masks_02"]
    for words in (["frame.npz"], of_frames):
        done = command("view", *words, "--picture", picture, "--rerun", "seen.rrd")
        assert done.exit_code == 1 and message in done.output and "failed" not in done.output, done.output
    assert {path.name for path in tmp_path.glob("seen*")} == set()


def test_frames_of_a_source_as_pictures_have_the_tracks_of_their_run(drive, tmp_path, monkeypatch):
    done = command("run", drive, "--masks", drive / "masks_02", "--out", "out", "--sweeps", "1", "--track")
    assert done.exit_code == 0, done.output
    monkeypatch.setitem(sys.modules, "rerun", None)
    done = command("view", drive, "--results", "out/tracks", "--frames", "1:", "--picture", "seen.png")
    assert done.exit_code == 0 and "2 of 3 frames; wrote seen-FRAME.png and others" in done.output, done.output
    source = ldls.datasets.open_source(drive)
    kinds = ("", "-birds-eye", "-comparison")
    expected = {f"seen-{name}{kind}.png" for name in source.names[1:] for kind in kinds}
    assert {path.name for path in tmp_path.glob("*.png")} == expected
    tracked = ldls.read_result(f"out/tracks/{source.names[1]}.npz")
    assert any(instance.track for instance in tracked.instances)
    picture = overlay(tracked, source[1].images[0].read())
    np.testing.assert_array_equal(np.asarray(Image.open(f"seen-{source.names[1]}.png")), np.asarray(picture))


@pytest.mark.parametrize("more", [[], ["--rerun", "a.rrd"]], ids=["alone", "beside a recording"])
def test_frames_without_labels_are_no_pictures(drive, tmp_path, more):
    done = command("view", drive, "--frames", "1", "--picture", "seen.png", *more)
    assert done.exit_code == 1 and "no labels to draw; give --masks, --segmenter or --results" in done.output
    assert not list(tmp_path.glob("*.png"))
