"""Frames of which nothing is labelled: a warning with the likely cause, counted by runs."""

import json
import warnings

import numpy as np
import pytest

import ldls
from batch import runs
from command import process
from datasets import layouts
from ldls import batch
from ldls.doubts import nothing_in_view
from ldls.errors import LdlsWarning, NothingInView, NoUsablePoints

CAMERA = ldls.Camera(projection=[[50, 0, 40], [0, 50, 30], [0, 0, 1]])
AHEAD = np.random.default_rng(0).uniform([-1, -1, 8], [1, 1, 12], (100, 3)).astype(np.float32)


def mask(rows=slice(None), columns=slice(None), n=1):
    pixels = np.zeros((n, 60, 80), bool)
    pixels[:, rows, columns] = True
    return ldls.InstanceMasks.from_array(pixels, categories=[3] * n)


def swapped(points):
    """x forward, as lidars have it, for a camera that looks along z."""
    return points[:, [2, 0, 1]]


@pytest.mark.parametrize(
    ("points", "masks", "cause"),
    [
        pytest.param(-AHEAD, mask(), "behind the camera.* is T_camera_lidar that of this lidar", id="turned round"),
        pytest.param(swapped(AHEAD) + np.float32([50, 0, 2]), mask(), "the image.* x, y, z in order", id="swapped"),
        pytest.param(AHEAD + np.float32([100, 0, 0]), mask(), "inside the image.* image size", id="beside"),
        pytest.param(AHEAD, mask(slice(20)), "on a mask.* masks those of this frame", id="other masks"),
    ],
)
def test_the_likely_cause_is_warned_of(points, masks, cause):
    with pytest.warns(NothingInView, match=f"^points: .*{cause}") as caught:
        result = ldls.segment(points, masks, CAMERA)
    assert not (result.labels > 0).any()
    assert caught[0].filename == __file__


@pytest.mark.parametrize(
    ("points", "masks"),
    [
        pytest.param(AHEAD, mask(), id="labels"),
        pytest.param(AHEAD, mask(slice(5), slice(5)), id="a mask so small that no point need be on it"),
        pytest.param(AHEAD, mask(n=0), id="no masks"),
        pytest.param(AHEAD, mask(slice(0)), id="masks without a pixel"),
        pytest.param(np.zeros((0, 3), np.float32), mask(), id="no points"),
        pytest.param(np.zeros((5, 3), np.float32), mask(), id="no returns"),
    ],
)
def test_what_is_as_it_should_be_is_not_warned_of(points, masks):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ldls.segment(points, masks, CAMERA)


def test_points_that_are_all_nan_have_their_own_warning_alone():
    with pytest.warns(NoUsablePoints) as caught:
        ldls.segment(np.full((5, 3), np.nan), mask(), CAMERA)
    assert len(caught) == 1


NAN, ORIGIN = np.full((7, 3), np.nan, np.float32), np.zeros((5, 3), np.float32)
EMPTY = np.zeros((0, 3), np.float32)


def causes(*clouds, keep_origin=False):
    """Why nothing is labelled of each of some sweeps from one place, which are labelled together."""
    views = [ldls.View(mask(slice(20)), CAMERA)]
    sweeps = [ldls.Sweep(cloud, views, np.eye(4), 0.1 * at) for at, cloud in enumerate(clouds)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LdlsWarning)
        return [nothing_in_view(result) for result in ldls.segment_sweeps(sweeps, keep_origin=keep_origin)]


@pytest.mark.parametrize(
    ("other", "keep_origin"),
    [
        pytest.param(EMPTY, False, id="no points"),
        pytest.param(np.concatenate([-AHEAD, NAN, ORIGIN]), False, id="no returns"),
        pytest.param(np.concatenate([-AHEAD, NAN, ORIGIN]), True, id="the origin"),
        pytest.param(AHEAD + np.float32([100, 0, 0]), False, id="points beside the image"),
    ],
)
def test_the_cause_of_a_sweep_is_that_of_its_own_points(other, keep_origin):
    behind, _ = causes(-AHEAD, other, keep_origin=keep_origin)
    assert "every point lies behind" in behind
    beside, _ = causes(AHEAD + np.float32([100, 0, 0]), other, keep_origin=keep_origin)
    assert "no point falls inside the image" in beside


@pytest.mark.parametrize(
    "nothing",
    [pytest.param(EMPTY, id="no points"), pytest.param(ORIGIN, id="no returns")],
)
def test_a_sweep_without_a_usable_point_among_others_has_no_cause(nothing):
    for other in (AHEAD, -AHEAD, np.concatenate([-AHEAD, NAN, ORIGIN]), EMPTY):
        assert causes(nothing, other)[0] is None


def test_the_cause_of_a_sweep_of_nan_among_others_is_that():
    for other in (AHEAD, -AHEAD, NAN, EMPTY):
        assert causes(NAN, other)[0].startswith("points: no row is finite; nothing is labelled")


@pytest.mark.parametrize("sweeps", [0, 1])
def test_a_run_names_the_frames_of_nan_whether_sweeps_are_joined_or_not(drive, tmp_path, sweeps):
    for number in (2, 4):
        layouts.write_points(drive / f"velodyne/{number:06d}.bin", np.full((200, 4), np.nan, "<f4"))
    settings = runs.stored(drive, sweeps=sweeps)
    for _ in "ab":
        with pytest.warns(NothingInView) as caught:
            summary = batch.run(drive, tmp_path / "out", settings)
        (warning,) = caught
        assert str(warning.message).startswith("2 of 8 frames (000002, 000004): points: no row is finite")
        assert summary.n_nothing_in_view == 2


@pytest.fixture
def astray(few):
    """Twelve frames: three without a point in view, one with masks that no point is on."""
    for number in (1, 4, 9):
        points = np.fromfile(few / f"velodyne/{number:06d}.bin", "<f4").reshape(-1, 4)
        layouts.write_points(few / f"velodyne/{number:06d}.bin", points * np.float32([-1, 1, 1, 1]))
    coco = layouts.coco(20)
    for annotation in coco["annotations"]:
        annotation["segmentation"] = [[0, 0, 80, 0, 80, 15, 0, 15]]
    (few / "masks/000006.json").write_text(json.dumps(coco))
    return few


def test_segment_exits_well_and_prints_the_warning(astray, tmp_path):
    files = {"points": "velodyne/000004.bin", "calib": "calib/000004.txt", "masks": "masks/000004.json"}
    words = [word for name, file in files.items() for word in (f"--{name}", astray / file)]
    outcome = process("segment", *words, "--out", tmp_path / "out")
    assert outcome.returncode == 0
    assert outcome.stderr.startswith("warning: --points: every point lies behind the camera; nothing is labelled; is ")
    assert outcome.stderr.count("\n") == 1


def test_a_run_counts_such_frames_and_warns_once_of_each_cause(astray, tmp_path):
    words = runs.arguments(astray, tmp_path / "out")
    for _ in "ab":
        outcome = process(*words)
        assert outcome.returncode == 0
        assert "12 of 12 frames done" in outcome.stdout
        assert ", 4 with nothing in view" in outcome.stdout
        behind, beside = sorted(outcome.stderr.splitlines(), reverse=True)
        assert behind.startswith("warning: 3 of 12 frames (000001, 000004, 000009): points: every point lies behind")
        assert beside.startswith("warning: 1 of 12 frames (000006): points: no point in view falls on a mask")


def test_the_journal_has_the_cause(astray, tmp_path):
    with pytest.warns(NothingInView):
        summary = batch.run(astray, tmp_path / "out", runs.stored(astray))
    assert summary.n_nothing_in_view == 4
    causes = {frame: record["nothing_in_view"] for frame, record in runs.records(tmp_path / "out").items()}
    assert [frame for frame, cause in causes.items() if cause] == ["000001", "000004", "000006", "000009"]
