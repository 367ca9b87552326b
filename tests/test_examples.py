"""Every example runs as it stands, in a folder of its own, and says what it says it does."""

import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"
WRITTEN = {
    "one_frame": {"frame.npz", "frame.label", "frame.png", "frame-birds-eye.png", "frame-comparison.png"},
    "own_camera_and_lidar": {"ldls.toml", "check.png", "seen-0000.png", "seen-0001-comparison.png"},
    "drive": {"labels", "raw"},
    "tuning_a_parameter": {"tuning.md"},
    "scoring_your_own_labels": {"semantic.md", "instances.md"},
}


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """The text that an example prints, and the folder it wrote to; each is run once, two at a time."""
    with ThreadPoolExecutor(2) as runs:
        ended = {name: runs.submit(run, name, tmp_path_factory.mktemp(name)) for name in WRITTEN}
        yield lambda name: ended[name].result()


def run(name, out):
    command = [sys.executable, "-W", "error", str(EXAMPLES / f"{name}.py"), str(out)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=out, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout, out


def test_every_example_is_listed():
    assert {path.stem for path in EXAMPLES.glob("*.py")} == set(WRITTEN)


@pytest.mark.parametrize("name", WRITTEN)
def test_it_writes_its_files(told, name):
    _, out = told(name)
    assert {path.name for path in out.iterdir()} >= WRITTEN[name]


def test_one_frame_finds_its_objects(told):
    text, _ = told("one_frame")
    assert len(re.findall(r"points at", text)) > 8


def test_a_wrong_calibration_costs_points(told):
    text, _ = told("own_camera_and_lidar")
    right, *wrong = (float(share) for share in re.findall(r"degrees: ([\d.]+) %", text))
    assert right > 90 and right > wrong[-1]


def test_a_second_run_over_a_drive_has_nothing_to_do(told):
    text, out = told("drive")
    assert re.findall(r"5 frames done, (\d) of them by earlier runs", text) == ["0", "5"]
    assert len(list((out / "labels").glob("*.npz"))) == 5


def test_tuning_ends_with_scores_on_other_frames(told):
    text, _ = told("tuning_a_parameter")
    (scores,) = re.findall(r"on other frames: ([\d.]+) with these, ([\d.]+) with the defaults", text)
    assert all(30 < float(score) < 100 for score in scores)


def test_ldls_is_better_than_direct_projection(told):
    text, _ = told("scoring_your_own_labels")
    means = {name: float(iou) for name, iou in re.findall(r"\| (.*?) \| mean \|.*\| ([\d.]+) \|", text)}
    assert means["ldls"] > means["direct projection"]
