"""Runs on a Ray cluster of this machine: what the local engine writes, whatever dies on the way."""

import os
import signal
import sys
from pathlib import Path

import pytest

import ldls
from batch import runs
from command import process
from ldls import batch
from ldls.batch import ray_engine
from ldls.batch.engines import open_engine
from ldls.batch.frame_work import FrameWork
from ldls.batch.lock import HOLDER_NAME
from ldls.batch.ray_worker import RayWorker
from ldls.datasets import open_source
from ldls.errors import BatchError, ParameterError

WORKERS = ("--engine", "ray", "--cores", 2)


@pytest.fixture(scope="module")
def ray():
    return pytest.importorskip("ray")


def worker_pids(ancestor):
    """Processes of workers below a process."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if b"ray::RayWorker" in (folder / "cmdline").read_bytes() and ancestor in ancestors(int(folder.name)):
                found.append(int(folder.name))
        except OSError:  # ended meanwhile
            continue
    return found


def ancestors(pid):
    while pid > 1:
        pid = int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
        yield pid


def test_a_worker_killed_on_the_way_costs_nothing(ray, source, undisturbed, tmp_path):
    killed = []

    def kill_one(finished, _failed, _total):
        if finished == 5:
            runs.wait_for(lambda: len(worker_pids(os.getpid())) == 2)
        if finished in (15, 35):
            pid = next(pid for pid in worker_pids(os.getpid()) if pid not in killed)
            os.kill(pid, signal.SIGKILL)
            killed.append(pid)

    summary = batch.run(source, tmp_path, runs.stored(source), engine="ray", workers=2, on_progress=kill_one)
    assert len(killed) == 2
    assert (summary.n_done, summary.failures) == (60, ())
    assert runs.contents(tmp_path) == undisturbed
    assert not ray.is_initialized()


def test_a_killed_run_goes_on_on_either_engine(ray, source, undisturbed, tmp_path):
    words = runs.arguments(source, tmp_path)
    for more in ((), WORKERS):
        killed = runs.killed("line written", 2, [*words, *more])
        assert killed.returncode == -signal.SIGKILL, killed.stderr
    outcome = process(*words, *WORKERS)
    assert outcome.returncode == 0, outcome.stderr
    assert "by earlier runs" in outcome.stdout
    assert runs.contents(tmp_path) == undisturbed


def test_a_full_disk(ray, source, small_disk):
    outcome = process(*runs.arguments(source, small_disk, *WORKERS))
    assert outcome.returncode == 1
    assert "No space left on device while" in outcome.stderr
    assert "ing frame 000" in outcome.stderr


@pytest.mark.parametrize("address", ["127.0.0.1:1", "ray://127.0.0.1:1", "127.0.0.1:port"])
def test_an_address_where_no_cluster_is(ray, few, tmp_path, address):
    with pytest.raises(BatchError, match=f"cannot join '{address}'"):
        batch.run(few, tmp_path / "out", runs.stored(few), engine="ray", ray_address=address)


@pytest.fixture(scope="module")
def cluster(ray):
    """One that was there before the run; what follows uses it."""
    ray.init(address="local", num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="error")
    yield ray
    ray.shutdown()


class Deadly:
    """A source of which one frame kills whoever reads it."""

    def __init__(self, source, number):
        self.source, self.number = source, number
        self.kind, self.path, self.names = source.kind, source.path, source.names
        self.camera_names = source.camera_names

    def __len__(self):
        return len(self.source)

    def __getitem__(self, index):
        if index == self.number:
            os.kill(os.getpid(), signal.SIGKILL)
        return self.source[index]

    def files(self, index):
        return self.source.files(index)


def test_bad_frames_and_frames_that_kill_their_workers_are_passed_over(cluster, few, tmp_path):
    from ray import cloudpickle

    sound = (few / "velodyne/000002.bin").read_bytes()
    (few / "velodyne/000002.bin").write_bytes(b"x" * 17)
    # workers do not have the tests on their path
    cloudpickle.register_pickle_by_value(sys.modules[__name__])
    try:
        deadly = Deadly(open_source(few), 4)
        summary = batch.run(deadly, tmp_path / "out", runs.stored(few), engine="ray", workers=2)
    finally:
        cloudpickle.unregister_pickle_by_value(sys.modules[__name__])
    assert [(failure.frame, failure.stage, failure.code) for failure in summary.failures] == [
        ("000002", "read", "truncated_file"),
        ("000004", "worker", "worker_died"),
    ]
    assert summary.n_done == 10
    assert cluster.is_initialized()
    (few / "velodyne/000002.bin").write_bytes(sound)
    assert batch.run(few, tmp_path / "out", runs.stored(few)).n_done == 12


def test_gpus_that_are_not_there(cluster, few, tmp_path):
    with pytest.raises(BatchError, match="the cluster has 0, a worker wants 64"):
        batch.run(few, tmp_path / "out", runs.stored(few), engine="ray", gpus=64)


def test_without_ray_the_extra_is_named(few, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ImportError, match=r"pip install 'ldls\[ray\]'"):
        batch.run(few, tmp_path / "out", runs.stored(few), engine="ray")


@pytest.mark.parametrize(
    ("seen", "version", "named"),
    [
        pytest.param(None, ldls.__version__, "does not see the folder", id="no such folder"),
        pytest.param("another run", ldls.__version__, "does not see the folder", id="another folder of that name"),
        pytest.param("this run", "0.0.1", "the run is of 0.0.1", id="another version"),
    ],
)
def test_a_worker_that_cannot_take_part_says_so(few, tmp_path, seen, version, named):
    if seen is not None:
        (tmp_path / HOLDER_NAME).write_text(seen)
    work = FrameWork(open_source(few), runs.stored(few), tmp_path)
    with pytest.raises(BatchError, match=named):
        RayWorker().open(work, version, "this run", "notes", wait_s=0)


@pytest.fixture
def worker(few, tmp_path):
    """A worker that is ready, and its file of notes."""
    (tmp_path / HOLDER_NAME).write_text("this run")
    notes = tmp_path / ".worker-0"
    notes.touch()
    worker = RayWorker()
    worker.open(FrameWork(open_source(few), runs.stored(few), tmp_path), ldls.__version__, "this run", notes.name)
    return worker, notes


def test_a_worker_does_frames(worker, tmp_path):
    outcome = worker[0].do(((3, "000003"),))
    assert [record["frame"] for record in outcome.records] == ["000003"]
    assert (tmp_path / "000003.label").exists()


def test_a_worker_notes_what_it_did_for_whoever_loses_it(worker):
    worker, notes = worker
    outcomes = {name: worker.do(((number, name),)) for number, name in enumerate(["000000", "000001", "000002"])}
    # the machine went down in the middle of a line
    notes.write_bytes(notes.read_bytes() + b'{"records":[{"fr')
    wanted = {"000001", "000002", "000003"}
    assert ray_engine._noted(notes, wanted) == {name: outcomes[name] for name in ("000001", "000002")}
    assert ray_engine._noted(notes, wanted) == {}


def test_a_worker_that_was_given_up_writes_nothing(worker, tmp_path):
    worker, notes = worker
    notes.unlink()
    with pytest.raises(BatchError, match="no longer wanted"):
        worker.do(((3, "000003"),))
    assert not (tmp_path / "000003.label").exists()


@pytest.mark.parametrize("gpus", [-1.0, 1.5, float("nan")])
def test_gpus_out_of_range(gpus):
    with pytest.raises(ParameterError, match="gpus"):
        open_engine("ray", gpus=gpus)


def test_options_of_ray_are_refused_on_the_local_engine(few, tmp_path):
    with pytest.raises(ParameterError, match="are for engine 'ray'"):
        batch.run(few, tmp_path / "out", runs.stored(few), ray_address="auto")
