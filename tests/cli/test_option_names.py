"""Messages say what to do in words of the command line, not in arguments of Python."""

import numpy as np
import pytest
import typer

import ldls
from command import command
from datasets import layouts
from ldls.cli import app
from ldls.cli.option_names import OF_SOURCES, WORDS, by_options
from ldls.datasets.registry import SOURCES

SEGMENT = {"threads": "--threads", "cores": "--cores", "extrinsic": "--extrinsic", "depth_gap": "--depth-gap"}
INFO = {"dataset": "--dataset", "option": "--option"}


@pytest.mark.parametrize(
    ("message", "options", "expected"),
    [
        pytest.param("depth_gap: got -1, expected 0", SEGMENT, "--depth-gap: got -1, expected 0", id="parameter"),
        pytest.param("workers: got 0, expected 1", SEGMENT, "--cores: got 0, expected 1", id="another name"),
        pytest.param("kind: got 'foo'; did you mean folder?", INFO, "--dataset: got 'foo'; did you mean folder?",
                     id="argument of a source"),
        pytest.param("truth: got 3", INFO, "--option truth: got 3", id="option of a source"),
        pytest.param("poses: got 'maybe'", INFO | {"poses": "--poses"}, "--option poses: got 'maybe'",
                     id="option of a source that is named as one of the command"),
        pytest.param("foo: no option of folder; they have none", INFO,
                     "--option foo: no option of folder; they have none", id="no option of a source"),
        pytest.param("names: got ()", {"categories": "--categories", "truth": "--truth"}, "--categories: got ()",
                     id="categories of reproduce"),
        pytest.param("threads, cores: give one", SEGMENT, "--cores, --cores: give one", id="two arguments"),
        pytest.param("a, threads: give one", SEGMENT, "a, threads: give one", id="one of two arguments"),
        pytest.param("kind: got 'foo'", SEGMENT, "kind: got 'foo'", id="no option of the command"),
        pytest.param("a.bin: cut; pass recover=True to read it", INFO,
                     "a.bin: cut; pass --option recover=true to read it", id="mend"),
        pytest.param("a: two; say which by scene=", INFO, "a: two; say which by --option scene=...", id="value"),
        pytest.param("a: cut; pass recover=True to read it", SEGMENT, "a: cut; in Python, pass recover=True to read it",
                     id="mend without an option"),
        pytest.param("a: cut; pass columns=5 (or columns=4 to insist)", INFO,
                     "a: cut; in Python or ldls.toml, pass columns=5 (or columns=4 to insist)", id="key of ldls.toml"),
        pytest.param("a: cut; pass columns=5 (or columns=4 to insist)", SEGMENT | {"columns": "--columns"},
                     "a: cut; pass --columns 5 (or --columns 4 to insist)", id="numbers"),
        pytest.param("a: two; pass instance_axis=0 or instance_axis=-1", {"instance_axis": "--instance-axis"},
                     "a: two; pass --instance-axis first or --instance-axis last", id="numbers that are words"),
        pytest.param("a: cut; pass columns= or recover=True", INFO, "a: cut; in Python, pass columns= or recover=True",
                     id="one of two without an option"),
        pytest.param("a: no lidar; give it as T_camera_lidar=", SEGMENT, "a: no lidar; give it as --extrinsic",
                     id="extrinsic"),
        pytest.param("a: b; perhaps masks=c/masks_02?", {"masks": "--masks"}, "a: b; perhaps --masks c/masks_02?",
                     id="path of a mend"),
        pytest.param("a: b; as by --option scene=NAME, or NAME=PATH", INFO,
                     "a: b; as by --option scene=NAME, or NAME=PATH", id="words of the command line"),
        pytest.param("kind=x/threads=2.bin: no file", SEGMENT, "kind=x/threads=2.bin: no file", id="path"),
    ],
)  # fmt: skip
def test_arguments_become_options(message, options, expected):
    assert by_options(message, options) == expected


def test_the_options_of_the_table_are_there():
    def options_of(command):
        for each in getattr(command, "commands", {}).values():
            yield from options_of(each)
        yield from (word for param in command.params for word in param.opts)

    assert {option for words in WORDS.values() for option in words} <= set(options_of(typer.main.get_command(app)))
    arguments = {name for source in SOURCES.values() for name in source.__init__.__annotations__}
    assert set(OF_SOURCES) <= arguments


@pytest.fixture
def files(tmp_path, small_scene, monkeypatch):
    points, masks, _ = small_scene
    np.save(tmp_path / "points.npy", points)
    (tmp_path / "cut.bin").write_bytes(bytes(108))
    overlapping = ldls.InstanceMasks.from_array(np.ones((2, 60, 80), bool), categories=[1, 3])
    ldls.save(masks, tmp_path / "masks.npz")
    ldls.save(overlapping, tmp_path / "overlapping.npz")
    ldls.save(masks.resolve_overlaps(), tmp_path / "numbers.png")
    layouts.write_text(tmp_path / "lidar.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n")
    layouts.write_text(tmp_path / "camera.yml", "camera_matrix: [100, 0, 40, 0, 100, 30, 0, 0, 1]\nD: []\n")
    (tmp_path / "labels").mkdir()
    np.full(9, 10, np.uint32).tofile(tmp_path / "labels/0.label")
    layouts.kitti_object(tmp_path / "kitti")
    for place in ("label_2", "masks"):
        (tmp_path / "kitti" / place).mkdir()
    (tmp_path / "kitti/velodyne/000001.bin").write_bytes(bytes(108))
    monkeypatch.chdir(tmp_path)


FRAME = "segment --points points.npy --calib camera.yml --masks masks.npz --out out"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        pytest.param(FRAME, "does not say where the lidar is; pass its matrix, or a file of it, as --extrinsic",
                     id="lidar of segment"),
        pytest.param(f"{FRAME} --extrinsic lidar.txt --cores 100000", "--cores: got 100000", id="cores of segment"),
        pytest.param(f"{FRAME} --part-gap -1", "--part-gap: got -1", id="parameter of segment"),
        pytest.param(
            f"{FRAME} --points cut.bin --columns 5 --extrinsic lidar.txt",
            "; pass another --columns if rows are of another length; else copy it again",
            id="columns of segment",
        ),
        pytest.param("run kitti --masks masks --out out --cores 100000", "--cores: got 100000", id="cores of run"),
        pytest.param("view kitti --dataset foo", "--dataset: got 'foo'", id="kind of view"),
        pytest.param("masks convert overlapping.npz a.png", "; .json and .npz hold masks that overlap; --resolve score "
                     "leaves it to one", id="overlaps"),
        pytest.param("masks convert overlapping.npz a.png", "masks of labels 1 and 2 share pixel (0, 0)", id="labels"),
        pytest.param("reproduce kitti --out out", "no folder annotations, but label_2; take it by --truth kitti-boxes",
                     id="truth"),
        pytest.param("simulate out --layout kitti-raw --rig ring", "--rig: got 'ring', expected kitti or robot",
                     id="rig"),
        pytest.param("masks convert masks.npz a.npy", "or pass --variant pixels", id="pixels only"),
        pytest.param(f"{FRAME} --extrinsic lidar.txt --iterations 0", "--iterations: got 0, expected 1 to 100000, or "
                     "--converge until nothing changes", id="iterations"),
        pytest.param(f"{FRAME} --extrinsic lidar.txt --categories ,", "--categories: expected at least one, as car",
                     id="categories of segment"),
        pytest.param("run kitti --masks kitti --out out --categories ,", "--categories: expected at least one, as car",
                     id="categories of run"),
        pytest.param("run kitti --out out", "--masks, --segmenter: give one of them, got neither", id="no masks"),
        pytest.param("run kitti --masks kitti --out out --map a.ply", "--map: a.ply is without what moves", id="map"),
        pytest.param("run kitti --masks kitti --out out --gpus 1", "--ray-address, --gpus: are for engine 'ray'",
                     id="options of an engine"),
        pytest.param("info kitti --option foo=3", "--option foo: no option of kitti-object", id="option of no kind"),
        pytest.param("masks convert numbers.png a.npz --class-divisor 9", "leave out --class-divisor", id="divisor"),
        pytest.param("evaluate labels labels --categories Car,Car", "--categories: 'Car' and 'Car' are one class",
                     id="categories of evaluate"),
        pytest.param("evaluate labels labels --categories ,", "--categories: got (), expected one or more",
                     id="no categories of evaluate"),
        pytest.param("evaluate labels labels --background car", "--background: ['car'] are scored too",
                     id="background"),
        pytest.param("evaluate labels labels --max-range -1", "--max-range: got -1", id="range"),
        pytest.param("evaluate labels labels --max-range 9", "frame 0 has no ranges of its points; give its --points",
                     id="ranges"),
    ],
)  # fmt: skip
def test_errors_name_options(files, words, message):
    done = command(*words.split())
    assert done.exit_code == 1 and message in " ".join(done.stderr.split()), done.output


@pytest.mark.parametrize(
    ("words", "option", "given"),
    [
        pytest.param(f"{FRAME} --neighbors abc", "--neighbors", "abc", id="no number"),
        pytest.param("run kitti --out out --cores 0", "--cores", "0", id="too few cores"),
        pytest.param("run kitti --out out --sweeps -1", "--sweeps", "-1", id="below zero"),
        pytest.param("masks convert masks.npz a.png --resolve size", "--resolve", "size", id="no such choice"),
    ],
)
def test_errors_of_values_say_what_was_given(files, words, option, given):
    done = command(*words.split(), COLUMNS="200")
    _, found, said = done.stderr.partition(f"Invalid value for '{option}':")
    assert done.exit_code == 2 and found and given in said and "Value error" not in said, done.output


def test_findings_and_frames_that_fail_name_no_arguments_as_if_they_were_options(files):
    expected = "in Python or ldls.toml, pass columns= if rows are of another length; else copy it again, or have "
    expected += "ldls.read_points recover the whole points"
    found = command("info", "kitti", "--all")
    assert found.exit_code == 1 and expected in " ".join(found.output.replace("│", " ").split()), found.output
    shown = command("view", "kitti", "--rerun", "a.rrd")
    assert shown.exit_code == 2 and expected in shown.output, shown.output
