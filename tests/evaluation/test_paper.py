"""The paper's experiments, on frames of a folder in KITTI's layout."""

import json
import shutil

import numpy as np
import pytest
from rich.console import Console

import ldls
from batch import runs
from command import command
from ldls.datasets import KittiObjectSource
from ldls.errors import LeftOutWarning
from ldls.evaluation import ClassSet, paper
from ldls.evaluation.methods import BOUND, CLUSTERING, DIFFUSION, DIRECT_PROJECTION, FULL, PAPER
from ldls.io.labels import write_annotations
from ldls.labeling import Labeling

pytest.importorskip("sklearn")

CALIBRATION = """P0: {0}
P1: {0}
P2: {0}
P3: {0}
R0_rect: 1 0 0 0 1 0 0 0 1
Tr_velo_to_cam: 1 0 0 0 0 1 0 0 0 0 1 0
Tr_imu_to_velo: 1 0 0 0 0 1 0 0 0 0 1 0
""".format("100 0 40 0 0 100 30 0 0 0 1 0")


@pytest.fixture
def folder(tmp_path, small_scene):
    """Two frames of the small scene, whose truth are the two boxes of points before the wall."""
    points, masks, _ = small_scene
    for part in ("velodyne", "calib", "masks", "annotations"):
        (tmp_path / part).mkdir()
    for name in ("000000", "000007"):
        np.hstack([points, np.ones((len(points), 1), np.float32)]).tofile(tmp_path / f"velodyne/{name}.bin")
        (tmp_path / f"calib/{name}.txt").write_text(CALIBRATION)
        write_masks(tmp_path / f"masks/{name}.json", masks)
        write_annotations(tmp_path / f"annotations/{name}.txt", truth_of(points))
    return tmp_path


def write_masks(path, masks):
    results = [
        {
            "image_id": 0,
            "category_id": mask.category,
            "score": mask.score,
            "segmentation": {"size": list(masks.image_size), "counts": runs_of(mask.to_array())},
        }
        for mask in masks
    ]
    path.write_text(json.dumps(results))


def runs_of(pixels):
    flat = np.concatenate([[0], pixels.ravel(order="F").astype(int), [1 - pixels[-1, -1]]])
    changes = np.flatnonzero(np.diff(flat[:-1]))
    return np.diff(np.concatenate([[0], changes, [pixels.size]])).tolist()


def frames_of(folder, truth="annotations"):
    return KittiObjectSource(folder, masks="masks", truth=truth)


def truth_of(points):
    near = points[:, 2] < 12
    instances = np.where(near, np.where(points[:, 0] < 0, 1, 2), 0).astype(np.int32)
    names = ("background", "Pedestrian", "Car")
    return Labeling(instances, instances, np.zeros(len(points), bool), names)


def test_a_folder_yields_its_whole_frames(folder, small_scene):
    points, masks, _ = small_scene
    (folder / "velodyne/000009.bin").write_bytes(b"")
    with pytest.warns(LeftOutWarning, match="1 of 3 sweeps are left out: 1 no calib and no masks and no annotations"):
        frames = frames_of(folder)
    assert (len(frames), frames.names) == (2, ("000000", "000007"))
    frame = frames[1]
    np.testing.assert_array_equal(frame.points[:, :3], points)
    np.testing.assert_array_equal(frame.images[0].masks.to_array(), masks.to_array())
    assert frame.truth.counts() == {"background": 260, "Pedestrian": 120, "Car": 120}


def test_a_folder_without_a_part_is_refused(folder):
    with pytest.raises(ldls.InputError, match="no folder label_2"):
        frames_of(folder, "kitti-boxes")
    shutil.rmtree(folder / "masks")
    with pytest.raises(ldls.InputError, match="no folder masks; found annotations, calib, velodyne"):
        frames_of(folder)
    (folder / "masks").mkdir()
    with pytest.raises(ldls.InputError, match="no frame has a file in each"):
        frames_of(folder)


def test_a_frame_without_masks_or_truth_is_refused(folder):
    with pytest.raises(ldls.InputError, match="frame 000000: has no truth; both are needed"):
        next(paper.label(frames_of(folder, False), classes=ClassSet.kitti()))


def test_scores_are_those_of_the_labels(folder):
    frames = frames_of(folder)
    labelled = list(paper.label(frames, classes=ClassSet.kitti(), iterations=(1, 20)))
    found = paper.score(labelled, classes=ClassSet.kitti(), ranges_m=(5, 20))
    for method, evaluation in found.methods.items():
        labels = labelled[0].methods[method].prediction.classes
        truth = labelled[0].methods[method].truth.classes
        names = labelled[0].methods[method].prediction.names
        car = labels == names.index("car")
        counts = evaluation.semantic["Car"]
        # two frames that are the same
        assert counts.tp == 2 * int((car & (truth == 2)).sum())
        assert counts.fp == 2 * int((car & (truth != 2)).sum())
    assert found.by_iterations[20].semantic.mean_iou == found.methods[FULL].semantic.mean_iou
    # confidence is told by the methods that diffuse to the end
    told = [method for method, evaluation in found.methods.items() if evaluation.reliability]
    assert told == [PAPER, FULL]
    assert found.by_range[5].semantic["Car"].tp == 0
    assert [score.name for score in found.objects] == ["Car", "Pedestrian"] * 2
    with pytest.raises(ldls.InputError, match="got no frame"):
        paper.score([], classes=ClassSet.kitti())


def test_on_real_frames_each_step_of_the_method_gains(data_folder):
    with pytest.warns(LeftOutWarning, match="1 of 5 sweeps are left out: 1 no label_2"):
        frames = frames_of(data_folder / "kitti/training", "kitti-boxes")
    found = paper.score(list(paper.label(frames, classes=ClassSet.kitti(), iterations=())), classes=ClassSet.kitti())
    for name in ("Car", "Pedestrian"):
        iou = {method: evaluation.semantic[name].iou for method, evaluation in found.methods.items()}
        assert iou[DIRECT_PROJECTION] < iou[DIFFUSION] < iou[PAPER] < iou[FULL] < iou[BOUND]
        assert iou[CLUSTERING] < iou[PAPER]


def test_the_command_writes_and_prints_tables_and_figures(folder, tmp_path, monkeypatch):
    out, show, there = tmp_path / "out", Console.print, []

    def look_and_show(*args, **options):
        there.append({path.name for path in out.iterdir()})
        show(*args, **options)

    monkeypatch.setattr(Console, "print", look_and_show)
    ran = command("reproduce", folder, "--out", out)
    assert ran.exit_code == 0, ran.output
    for title in (
        "Points by class",
        "Instances",
        "Panoptic",
        "Ablation",
        "Reliability",
        "maximum range",
        "number of iterations",
    ):
        assert title in ran.output
    written = {path.name for path in out.iterdir()}
    stems = ("comparison", "instances", "panoptic", "ablation", "reliability", "coverage", "range", "iterations")
    # whoever looks at the first line alone ends the command
    assert (
        there[0]
        == written
        == {f"{stem}{suffix}" for stem in stems for suffix in (".md", ".csv", ".json")}
        | {f"{stem}.png" for stem in ("range", "objects", "iterations", "reliability", "coverage")}
    )
    assert "nan" not in ran.output.lower()


def test_a_scored_name_that_occurs_nowhere_is_warned_of(folder, tmp_path):
    words = ["reproduce", folder, "--out", tmp_path / "out", "--categories"]
    ran = command(*words, "persn")
    assert ran.exit_code == 1
    assert ran.stderr.endswith("error: --categories: 'persn' is unknown; did you mean 'person'?\n")
    assert not (tmp_path / "out").exists()
    ran = command(*words, "car,persn")
    assert ran.exit_code == 0, ran.output
    assert ran.stderr.endswith("warning: --categories: 'persn' is unknown; did you mean 'person'?\n")
    assert (tmp_path / "out/comparison.md").is_file()


def test_tables_are_written_over_no_input(folder, tmp_path):
    mine = tmp_path / "frames"
    shutil.copytree(folder, mine)
    for path in mine.rglob("000000.*"):
        path.rename(path.with_stem("range"))
    before = runs.contents(mine)
    ran = command("reproduce", mine, "--out", mine / "masks", COLUMNS="500")
    assert ran.exit_code == 1
    assert ran.stderr.startswith("error: --out: would write over "), ran.stderr
    assert runs.contents(mine) == before


@pytest.mark.parametrize("arguments", [[], ["FOLDER", "--suite", "tuning"]], ids=["neither", "both"])
def test_the_command_wants_a_folder_or_a_suite(folder, tmp_path, arguments):
    arguments = [folder if argument == "FOLDER" else argument for argument in arguments]
    ran = command("reproduce", *arguments, "--out", tmp_path / "out")
    assert ran.exit_code != 0
    assert "expected a folder of frames or --suite" in ran.output
