"""An output is never an input: what would write over one is refused before anything is done."""

import shutil

import pytest

from batch import runs
from command import command
from datasets import layouts


@pytest.fixture
def folder(demo, tmp_path, monkeypatch):
    """The files of a frame, some with the names of results, a result, and a link to the image; none may change."""
    shutil.copytree(demo[0] / "input", tmp_path, dirs_exist_ok=True)
    shutil.copy(demo[0] / "demo.ply", tmp_path / "points.ply")
    shutil.copy(demo[0] / "demo.npz", tmp_path / "result.npz")
    shutil.copy(tmp_path / "image.png", tmp_path / "points.png")
    (tmp_path / "out").mkdir()
    (tmp_path / "link.png").symlink_to("image.png")
    monkeypatch.chdir(tmp_path)
    before = runs.contents(tmp_path)
    yield tmp_path
    assert runs.contents(tmp_path) == before


SEGMENT = "segment --points points.bin --calib calib.txt --masks masks.npz"


@pytest.mark.parametrize(
    ("words", "option", "output"),
    [
        pytest.param(f"{SEGMENT} --image points.png --out .", "--out", "points.png", id="the image"),
        pytest.param(
            "segment --points points.ply --calib calib.txt --masks masks.npz --out out/..", "--out", "points.ply",
            id="the sweep",
        ),
        pytest.param(f"{SEGMENT} --image image.png --picture image.png --out out", "--picture", "image.png", id="drew"),
        pytest.param(f"{SEGMENT} --image image.png --picture link.png --out out", "--picture", "link.png", id="to it"),
        pytest.param(f"{SEGMENT} --image link.png --picture image.png --out out", "--picture", "image.png", id="link"),
        pytest.param(f"{SEGMENT} --save-masks masks.npz --out out", "--save-masks", "masks.npz", id="masks saved"),
        pytest.param("masks make image.png image.png --segmenter boxes:none.txt", "OUT", "image.png", id="masks made"),
        pytest.param("masks convert masks.npz ./masks.npz", "OUT", "masks.npz", id="masks converted"),
        pytest.param("masks show masks.npz --image image.png --picture image.png", "--picture", "image.png", id="show"),
        pytest.param("view result.npz --image image.png --picture image.png", "--picture", "image.png", id="result"),
    ],
)  # fmt: skip
def test_a_command_writes_over_no_input(folder, words, option, output):
    outcome = command(*words.split(), COLUMNS="500")
    assert outcome.exit_code == 1
    expected = rf"error: {option}: would write over {output}, which is an input ("
    assert outcome.stderr.replace("out/../", "").startswith(expected), outcome.stderr
    assert outcome.stderr.endswith("; give another\n")


def test_the_image_of_the_sweep_s_name_is_kept_where_it_is_no_input(folder):
    outcome = command(*f"{SEGMENT} --out .".split(), COLUMNS="500")
    assert outcome.exit_code == 1
    expected = "error: --out: would write over points.png, which seems to be the camera's image; give another\n"
    assert outcome.stderr == expected


@pytest.mark.parametrize(
    ("words", "made"),
    [
        pytest.param(f"{SEGMENT} --out new --picture {{}}/a.png", "new", id="picture"),
        pytest.param(f"{SEGMENT} --out new --objects {{}}/a.json", "new", id="objects"),
        pytest.param(f"{SEGMENT} --out new --save-masks {{}}/a.npz", "new", id="masks saved"),
        pytest.param(f"{SEGMENT} --out new --rerun {{}}/a.rrd", "new", id="recording"),
        pytest.param("masks convert masks.npz {}/a.json", None, id="masks converted"),
        pytest.param("masks make image.png {}/a.json --segmenter boxes:none.txt", None, id="masks made"),
        pytest.param("masks show masks.npz --picture {}/a.png", None, id="show"),
        pytest.param("view result.npz --picture {}/a.png", None, id="result"),
        pytest.param("view result.npz --rerun {}/a.rrd", None, id="recorded"),
    ],
)
def test_a_folder_to_write_to_must_be_there_before_any_work(folder, monkeypatch, words, made):
    for name in ("ldls.io.read_points", "ldls.io.read_masks", "ldls.io.read_image", "ldls.viewing.save_pictures"):
        monkeypatch.setattr(name, lambda *_, **__: pytest.fail("work was done"))
    outcome = command(*words.format("nowhere").split(), COLUMNS="500")
    assert outcome.exit_code == 1
    assert outcome.stderr == "error: nowhere: no such folder to write to; make it first\n"
    monkeypatch.undo()
    if made is not None:
        monkeypatch.chdir(folder)
        assert command(*words.format(made).split(), COLUMNS="500").exit_code == 0
        assert list((folder / made).glob("a.*"))
        shutil.rmtree(folder / made)


def test_a_run_makes_its_folder_and_no_other(tmp_path):
    source = layouts.many_frames(tmp_path / "source", 2)
    words = runs.arguments(source, tmp_path / "out")
    outcome = command(*words, "--objects", tmp_path / "nowhere/a.csv", COLUMNS="500")
    assert outcome.exit_code == 1 and "nowhere: no such folder to write to" in outcome.stderr
    assert not (tmp_path / "out").exists()
    assert command(*words, "--objects", tmp_path / "out/a.csv").exit_code == 0
    assert (tmp_path / "out/a.csv").is_file()


@pytest.mark.parametrize(
    ("option", "output"),
    [
        pytest.param("--save-masks", "out/points.npz", id="masks"),
        pytest.param("--objects", "out/../out/points.csv", id="objects"),
    ],
)
def test_two_options_do_not_write_one_file(folder, option, output):
    words = f"{SEGMENT} --out out --formats npz,csv {option} {output}"
    outcome = command(*words.split(), COLUMNS="500")
    assert outcome.exit_code == 1
    assert outcome.stderr == f"error: {option}: {output} is what --out writes, too; give another\n"


@pytest.mark.parametrize("name", ["view", "info"])
def test_pictures_of_a_source_are_none_of_its_files(tmp_path, name):
    source = layouts.many_frames(tmp_path / "source", 2)
    picture = source / "image_2/000000.png"
    if name == "view":
        for part, ending in (("image_2", "png"), ("velodyne", "bin"), ("calib", "txt")):
            (source / f"{part}/000001.{ending}").rename(source / f"{part}/a-0.{ending}")
            (source / f"{part}/000000.{ending}").rename(source / f"{part}/0.{ending}")
        picture = source / "image_2/a.png"
    before = runs.contents(source)
    outcome = command(name, source, "--picture", picture, COLUMNS="500")
    assert outcome.exit_code == 1
    assert "error: --picture: would write over" in outcome.stderr
    assert runs.contents(source) == before


def test_annotations_are_written_over_no_boxes(tmp_path):
    source = layouts.many_frames(tmp_path / "source", 2)
    layouts.write_text(source / "label_2/000000.txt", "Car 0 0 0 1 1 2 2 1 1 1 0 0 5 0\n")
    outcome = command("annotate", source, source / "label_2", COLUMNS="500")
    assert outcome.exit_code == 1
    assert "error: OUT: would write over" in outcome.stderr
