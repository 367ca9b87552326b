import itertools
import json
import os
import re
import shutil

import numpy as np
import pytest
from PIL import Image
from rich.table import Table

import ldls
from command import command, python
from ldls.cli.frame_files import camera_name
from ldls.cli.messages import console
from ldls.viewing.formats import ENDINGS


def arguments(folder, out, **changes):
    files = {
        "points": folder / "input/points.bin",
        "calib": folder / "input/calib.txt",
        "masks": folder / "input/masks.npz",
        "image": folder / "input/image.png",
        "out": out,
    } | changes
    return ["segment", *(word for key, value in files.items() for word in (f"--{key}", value))]


def test_demo_writes_results_and_beats_direct_projection(demo):
    folder, outcome = demo
    assert outcome.exit_code == 0, outcome.output
    assert {path.name for path in folder.iterdir()} == {
        "demo.npz", "demo.label", "demo.ply", "demo.png", "demo-birds-eye.png", "demo-comparison.png", "input",
    }  # fmt: skip
    (mean,) = (line for line in outcome.output.splitlines() if "mean" in line)
    direct, method = (float(cell) for cell in mean.replace("│", " ").split()[1:3])
    assert method > direct
    found, accuracy = (
        sorted(re.findall(r"│ +(\d+) │ (\w+) ", part)) for part in outcome.output.split("accuracy against")
    )
    assert len(found) > 3 and accuracy == found, "both tables have the numbers that pictures have"
    with np.load(folder / "demo.npz") as stored:
        assert len(set(stored["object_category"].tolist())) >= 3


def test_segment_on_the_files_of_the_demo_gives_the_same(demo, tmp_path):
    folder, _ = demo
    outcome = command(*arguments(folder, tmp_path, picture=tmp_path / "seen.png"))
    assert outcome.exit_code == 0, outcome.output
    assert "objects found" in outcome.output
    assert "diffusion" in outcome.output
    with np.load(folder / "demo.npz") as expected, np.load(tmp_path / "points.npz") as stored:
        np.testing.assert_array_equal(stored["labels"], expected["labels"])
    with Image.open(tmp_path / "points.png") as picture, Image.open(folder / "demo.png") as first:
        assert picture.tobytes() == first.tobytes()
    for kind in ("", "-birds-eye", "-comparison"):
        assert (tmp_path / f"seen{kind}.png").read_bytes() == (folder / f"demo{kind}.png").read_bytes()


@pytest.mark.parametrize("name", ["truck [parked]", "truck [/parked]", "truck [red]:car:"])
def test_names_and_paths_are_printed_as_they_are(demo, tmp_path, name):
    masks = ldls.read_masks(demo[0] / "input/masks.npz")
    named = ldls.InstanceMasks.from_array(masks.to_array(), categories=[1] * len(masks), names={1: name})
    ldls.save(named, tmp_path / "masks.npz")
    out = tmp_path / name
    out.mkdir(parents=True)
    outcome = command(*arguments(demo[0], out, masks=tmp_path / "masks.npz", formats="npz"))
    assert outcome.exit_code == 0, outcome.output
    assert f" {name} " in outcome.output and f"wrote {out / 'points.npz'}" in outcome.output
    point = np.flatnonzero(ldls.read_result(out / "points.npz").labels > 0)[0]
    explained = command("explain", point, out / "points.npz")
    assert explained.exit_code == 0 and f" {name} " in explained.output and "\\[" not in explained.output
    shown = command("masks", "show", tmp_path / "masks.npz")
    assert shown.exit_code == 0 and f" {name} " in shown.output


def test_segment_and_explain_take_the_number_of_columns(demo, tmp_path):
    folder, _ = demo
    points = ldls.read_points(folder / "input/points.bin")
    wide = tmp_path / "wide.bin"
    np.column_stack([points, np.zeros((len(points), 4), "<f4")]).astype("<f4").tofile(wide)
    words = [*arguments(folder, tmp_path / "out"), "--points", wide, "--columns", 8]
    outcome = command(*words, "--formats", "npz")
    assert outcome.exit_code == 0, outcome.output
    with np.load(folder / "demo.npz") as expected, np.load(tmp_path / "out/wide.npz") as stored:
        np.testing.assert_array_equal(stored["labels"], expected["labels"])
    files = [
        word
        for name, ending in (("calib", "txt"), ("masks", "npz"))
        for word in (f"--{name}", folder / f"input/{name}.{ending}")
    ]
    outcome = command("explain", "4477", "--points", wide, "--columns", "8", *files)
    assert outcome.exit_code == 0, outcome.output


@pytest.mark.parametrize("ending", ["csv", "json"])
def test_segment_writes_a_table_of_the_objects(demo, tmp_path, ending):
    outcome = command(*arguments(demo[0], tmp_path / "out", objects=tmp_path / f"out/objects.{ending}"))
    assert outcome.exit_code == 0, outcome.output
    ldls.save_objects({"points": ldls.read_result(tmp_path / "out/points.npz")}, tmp_path / f"expected.{ending}")
    written = (tmp_path / f"out/objects.{ending}").read_bytes()
    assert written == (tmp_path / f"expected.{ending}").read_bytes()
    assert written.count(b"person") > 0
    assert f"objects.{ending}" in outcome.output.splitlines()[-1]


def test_an_unknown_ending_of_the_table_is_refused_before_anything_is_done(demo, tmp_path):
    outcome = command(*arguments(demo[0], tmp_path / "out", objects=tmp_path / "objects.xlsx"))
    assert outcome.exit_code == 1
    assert "cannot write '.xlsx' tables of objects, expected .csv, .json" in outcome.stderr
    assert not (tmp_path / "out").exists()


def test_a_picture_of_another_format_is_refused_before_anything_is_done(demo, tmp_path):
    outcome = command(*arguments(demo[0], tmp_path / "out", picture=tmp_path / "seen.jpg"))
    assert outcome.exit_code == 1
    assert "cannot write '.jpg' pictures, expected .png" in outcome.stderr
    assert not (tmp_path / "out").exists()


def test_formats_can_be_chosen_and_an_image_is_not_needed(demo, tmp_path):
    words = arguments(demo[0], tmp_path)
    at = words.index("--image")
    del words[at : at + 2]
    outcome = command(*words, "--formats", "label,png,label")
    assert outcome.exit_code == 0, outcome.output
    assert outcome.output.count("points.label") == 1
    assert {path.name for path in tmp_path.iterdir()} == {"points.label", "points.png"}


def test_real_frame(frame_571, tmp_path):
    outcome = command(
        "segment", "--points", frame_571.points_path, "--calib", frame_571.calib_path, "--masks", frame_571.masks_path,
        "--image", frame_571.image_path, "--out", tmp_path / "new/folder", "--paper",
    )  # fmt: skip
    assert outcome.exit_code == 0, outcome.output
    assert "17 of 19 objects found" in outcome.output
    in_view = frame_571.expected["in_view"]
    with np.load(tmp_path / "new/folder/000571.npz") as stored:
        np.testing.assert_array_equal(stored["labels"][in_view], frame_571.expected["labels"])


@pytest.mark.parametrize(
    ("option", "fault", "message"),
    [
        pytest.param("points", lambda p: p.write_bytes(b"1234567"), "points.bin: 7 bytes", id="cut points"),
        pytest.param("calib", lambda p: p.write_text("P2: 1 2 3"), "expected 12 numbers", id="calib"),
        pytest.param("masks", lambda p: p.write_bytes(b"PK"), "not a whole .npz", id="masks"),
        pytest.param("image", lambda p: p.write_bytes(b"PNG"), "not a whole image", id="image"),
        pytest.param("image", lambda p: Image.new("RGB", (375, 1242)).save(p), "swapped?", id="image size"),
    ],
)
def test_bad_files_are_one_line_and_nothing_is_written(demo, tmp_path, option, fault, message):
    original = demo[0] / "input" / {"calib": "calib.txt", "image": "image.png"}.get(option, f"{option}.bin")
    original = original.with_suffix(".npz") if option == "masks" else original
    broken = tmp_path / original.name
    shutil.copy(original, broken)
    fault(broken)
    out = tmp_path / "out"
    outcome = command(*arguments(demo[0], out, **{option: broken}))
    assert outcome.exit_code == 1
    assert outcome.stderr.startswith("error: ")
    assert message in outcome.stderr
    assert not out.exists()


def test_parameters_out_of_range_are_refused(demo, tmp_path):
    outcome = command(*arguments(demo[0], tmp_path / "out"), "--neighbors", "0")
    assert outcome.exit_code == 1
    assert "neighbors: got 0, expected 1 to 255" in outcome.stderr
    assert not (tmp_path / "out").exists()


def test_a_missing_file_is_named(demo, tmp_path):
    missing = arguments(demo[0], tmp_path / "out", points=tmp_path / "none.bin")
    outcome = command(*missing, COLUMNS="500")  # so that no long path is broken
    assert outcome.exit_code == 2
    assert "none.bin" in outcome.stderr


def test_help_teaches_and_comes_at_once():
    before = os.times()
    outcome = python("-c", "from ldls.cli import app; app()", "--help")
    after = os.times()
    assert outcome.returncode == 0, outcome.stderr
    computed_s = after.children_user + after.children_system - before.children_user - before.children_system
    assert computed_s < 2, "half a second is promised on an idle machine"
    assert "segment" in outcome.stdout
    assert "demo" in outcome.stdout


def test_version():
    assert command("--version").output == f"ldls {ldls.__version__}\n"


def test_every_format_can_be_asked_for(demo, tmp_path):
    words = ["--formats", ",".join(ENDINGS)]
    outcome = command(*arguments(demo[0], tmp_path), *words)
    assert outcome.exit_code == 0, outcome.output
    endings = ENDINGS.values()
    assert {path.name for path in tmp_path.iterdir()} == {f"points{ending}" for ending in endings}


@pytest.mark.parametrize("width", [80, 120])
def test_help_fits_the_terminal(width):
    text = command("run", "--help", COLUMNS=str(width)).output
    lines = [line.strip() for line in text.splitlines()]
    start = next(at for at, line in enumerate(lines) if line.startswith("Files appear"))
    paragraph = lines[start : lines.index("", start)]
    # no line but the last ends where the next word had found room
    for line, following in itertools.pairwise(paragraph):
        assert len(line) + 1 + len(following.split()[0]) > width - 4
    assert "Examples:" in lines


@pytest.mark.parametrize("width", [20, 30])
def test_tables_fold_what_a_narrow_terminal_has_no_room_for(capsys, width):
    table = Table("camera", "object", "1000000")
    table.add_row("CAM_FRONT_RIGHT", "truck [parked]", "123")
    screen = console()
    screen.width = width
    screen.print(table)
    lines = [line.split("│") for line in capsys.readouterr().out.splitlines() if line.startswith("│")]
    assert ["".join(cells).replace(" ", "") for cells in zip(*lines, strict=True)][1:-1] == [
        "CAM_FRONT_RIGHT", "truck[parked]", "123",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("calibration", "camera", "name"),
    [
        pytest.param("P2: 1\n", None, "image_2", id="KITTI's left colour one"),
        pytest.param("P2: 1\n", "3", "image_3", id="another of KITTI's"),
        pytest.param("P2: 1\n", "image_3", "image_3", id="another by the name of its images"),
        pytest.param(None, None, "image_02", id="a day of KITTI raw"),
        pytest.param("cam0: {}\n", "cam1", "cam1", id="one of Kalibr's"),
        pytest.param("M1: {}\n", "2", "camera 2", id="one of a pair"),
        pytest.param("K: []\n", None, "", id="the only one"),
    ],
)
def test_a_camera_has_the_name_that_it_was_chosen_by(tmp_path, calibration, camera, name):
    if calibration is not None:
        tmp_path /= "calib.yaml"
        tmp_path.write_text(calibration)
    assert camera_name(tmp_path, camera) == name


@pytest.mark.parametrize("name", ["segment", "explain"])
def test_a_camera_of_opencv_and_the_lidar_beside_it_give_the_same(demo, tmp_path, name):
    folder, _ = demo
    camera = ldls.read_camera(folder / "input/calib.txt")
    fx, fy, u, v = camera.projection[[0, 1, 0, 1], [0, 1, 2, 2]].tolist()
    assert not camera.projection[:, 3].any()
    (tmp_path / "camera.xml").write_text(
        f"<?xml version='1.0'?><opencv_storage><K type_id='opencv-matrix'><rows>3</rows><cols>3</cols>"
        f"<data>{fx} 0. {u} 0. {fy} {v} 0. 0. 1.</data></K><D></D></opencv_storage>"
    )
    back = np.linalg.inv(camera.T_camera_lidar)
    (tmp_path / "lidar.json").write_text(
        json.dumps({"pose_of": "camera", "translation": back[:3, 3].tolist(), "rotation": back[:3, :3].tolist()})
    )
    words = arguments(folder, tmp_path, calib=tmp_path / "camera.xml", extrinsic=tmp_path / "lidar.json")
    if name == "explain":
        chosen = ["--points", "--masks", "--calib", "--extrinsic"]
        pairs = [words[at : at + 2] for at in range(1, len(words), 2) if words[at] in chosen]
        words = ["explain", "1000", *itertools.chain(*pairs), "--json"]
    outcome = command(*words)
    assert outcome.exit_code == 0, outcome.output
    if name == "segment":
        with np.load(folder / "demo.npz") as expected, np.load(tmp_path / "points.npz") as stored:
            np.testing.assert_array_equal(stored["labels"], expected["labels"])


@pytest.mark.parametrize(
    ("words", "message"),
    [
        pytest.param(
            {"calib": "points.bin"},
            "of a calibration; is it one?",
            id="cloud as calibration",
        ),
        pytest.param({"masks": "image.png"}, "colours do not tell which instance", id="image as masks"),
        pytest.param({"points": "image.png"}, "cannot read '.png' clouds, expected .bin", id="image as points"),
        pytest.param({"points": "calib.txt"}, "calib.txt: line 1: expected a number", id="calibration as points"),
    ],
)
def test_files_in_the_wrong_place_are_named(demo, tmp_path, words, message):
    files = {option: demo[0] / "input" / name for option, name in words.items()}
    outcome = command(*arguments(demo[0], tmp_path / "out", **files))
    assert outcome.exit_code == 1
    assert message in outcome.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        pytest.param(["--converge", "--iterations", "3"], "--iterations: with --converge", id="steps to the end"),
        pytest.param(["--diffusion", "2"], "--diffusion: a recording shows it", id="diffusion without a recording"),
        pytest.param(["--image-id", "5"], "--image-id: which image of --masks", id="the image of a segmenter's masks"),
    ],
)
def test_options_that_would_change_nothing_are_refused(demo, tmp_path, words, message):
    files = arguments(demo[0], tmp_path / "out")
    if "--image-id" in words:
        at = files.index("--masks")
        files[at : at + 2] = ["--segmenter", "boxes:boxes.txt"]
    outcome = command(*files, *words)
    assert outcome.exit_code == 1
    assert message in outcome.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("words", [["view"], ["explain", "5"]], ids=["view", "explain"])
def test_labels_without_points_are_refused_with_what_is_needed(demo, words):
    outcome = command(*words, demo[0] / "demo.label")
    assert outcome.exit_code == 1
    assert "demo.label: expected the .npz of a result" in outcome.stderr


def test_polygons_take_the_size_of_the_image_from_the_calibration(demo, tmp_path):
    (tmp_path / "a.txt").write_text("2 0.275 0.429 0.208 0.669 0.370 0.611 0.342 0.429\n")
    (tmp_path / "camera.json").write_text(
        '{"K": [721.54, 0, 609.56, 0, 721.54, 172.85, 0, 0, 1], "D": [], "image_width": 1242, "image_height": 375}'
    )
    (tmp_path / "T.txt").write_text("0 -1 0 0.06 0 0 -1 -0.08 1 0 0 -0.27")
    words = arguments(demo[0], tmp_path / "out", masks=tmp_path / "a.txt", calib=tmp_path / "camera.json")
    at = words.index("--image")
    outcome = command(*words[:at], *words[at + 2 :], "--extrinsic", tmp_path / "T.txt", "--formats", "npz")
    assert outcome.exit_code == 0, outcome.output
    assert "1 of 1 objects found" in outcome.output
    at = words.index("--calib") + 1
    words[at] = demo[0] / "input/calib.txt"
    at = words.index("--image")
    outcome = command(*words[:at], *words[at + 2 :])
    assert "a.txt: says nothing of the image's size; give its --image" in outcome.stderr


def test_errors_of_the_system_are_said_without_their_number(tmp_path):
    outcome = command("masks", "make", tmp_path / "a.png", tmp_path / "b.json", "--segmenter", "boxes:no.txt")
    assert outcome.exit_code == 2  # the image does not exist
    Image.new("RGB", (40, 30)).save(tmp_path / "a.png")
    outcome = command("masks", "make", tmp_path / "a.png", tmp_path / "b.json", "--segmenter", "boxes:no.txt")
    assert outcome.stderr == "error: no.txt: No such file or directory\n"
