"""A run that was killed goes on, and its folder equals that of a run that was not, byte for byte."""

import random
import re
import signal

import pytest

from batch import killed_at, runs
from command import command, process

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
