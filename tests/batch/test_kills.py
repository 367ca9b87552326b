"""A run that was killed goes on, and its folder equals that of a run that was not, byte for byte."""

import random
import re
import signal

import pytest

from batch import killed_at, runs
from command import command, process
from ldls.batch.frame_work import FrameWork
from ldls.batch.run_tracks import RunTracks

AT_STEPS = [
    pytest.param(step, n, id=f"{step}, {n}")
    for step, times in {
        "file written, not synced": (1, 2, 3, 34),
        "file synced, not renamed": (1, 30),
        "file renamed": (1, 30),
        "folder not synced": (1, 2),
        "line half written": (1, 2),
        "line written": (1, 2),
        "journal not put in order": (1,),
        "journal in order, not renamed": (1,),
        "journal renamed, lock not let go": (1,),
    }.items()
    for n in times
]


def test_every_step_of_a_write_is_killed_once():
    assert {case.values[0] for case in AT_STEPS} == set(killed_at.STEPS)


@pytest.mark.parametrize(("step", "n"), AT_STEPS)
def test_killed_at_a_step(source, undisturbed, tmp_path, step, n):
    words = runs.arguments(source, tmp_path)
    killed = runs.killed(step, n, words)
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    outcome = command(*words)
    assert outcome.exit_code == 0, outcome.output
    assert runs.contents(tmp_path) == undisturbed


@pytest.mark.parametrize("seed", range(3))
def test_killed_twice_at_random_moments(source, undisturbed, tmp_path, seed):
    words = runs.arguments(source, tmp_path)
    moments = random.Random(seed)
    # sixty frames are half a second's work for a slow core
    killed = [runs.killed(killed_at.WORK, moments.uniform(0, 0.03), words) for _ in "ab"]
    assert -signal.SIGPROF in {run.returncode for run in killed}, killed
    outcome = command(*words)
    assert outcome.exit_code == 0, outcome.output
    assert runs.contents(tmp_path) == undisturbed


def test_interrupted_by_ctrl_c(source, undisturbed, tmp_path):
    words = runs.arguments(source, tmp_path)
    with runs.started([*words, "--cores", "1"], program=("-c", runs.SLOWLY)) as running:
        assert runs.has_done_some(running, tmp_path)
        running.send_signal(signal.SIGINT)
        _, complaint = running.communicate()
    assert running.returncode == 130, complaint
    assert "Traceback" not in complaint
    said = r"^stopped: (\d+) of 60 frames are done; give the same command again to go on$"
    (count,) = re.findall(said, complaint, re.M)
    left = runs.contents(tmp_path)
    assert all(not name.startswith(".") for name in left)
    assert 0 < len(left) < 61
    # some may have been written after the count
    assert 0 < int(count) <= len(left) - 1
    assert "by earlier runs" in process(*words).stdout
    assert runs.contents(tmp_path) == undisturbed


def interrupt(*_):
    raise KeyboardInterrupt


def test_ctrl_c_counts_the_frames_of_earlier_runs(few, tmp_path, monkeypatch):
    words = runs.arguments(few, tmp_path / "out")
    assert command(*words, "--frames", "0:5").exit_code == 0
    monkeypatch.setattr(FrameWork, "read", interrupt)
    outcome = command(*words)
    assert outcome.exit_code == 130
    assert outcome.stderr == "stopped: 5 of 12 frames are done; give the same command again to go on\n"
    assert "labelling" not in outcome.stdout, "a speed of frames of earlier runs"


def test_ctrl_c_before_the_frames_of_earlier_runs_are_counted_says_no_number(few, tmp_path, monkeypatch):
    words = runs.arguments(few, tmp_path / "out")
    assert command(*words).exit_code == 0
    monkeypatch.setattr(FrameWork, "judge_earlier", interrupt)
    outcome = command(*words)
    assert outcome.exit_code == 130
    said = "stopped: before it was known which frames are done; give the same command again to go on\n"
    assert outcome.stderr == said


def test_ctrl_c_while_tracks_are_made_says_that_the_frames_are_done(drive, tmp_path, monkeypatch):
    monkeypatch.setattr(RunTracks, "write", interrupt)
    outcome = command(*runs.arguments(drive, tmp_path / "out"), "--track", "--map", tmp_path / "map.ply")
    assert outcome.exit_code == 130
    said = "stopped: 8 of 8 frames are done, but not all that is made of them together (tracks, map); give the same"
    assert outcome.stderr.startswith(said)
