"""Long calls can be stopped, and a lack of memory is an error that the process survives."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import ldls
from command import python
from ldls import stages

CLOUD = """
import signal
import sys
import numpy as np
import ldls

# what shells start in the background ignores Ctrl-C
signal.signal(signal.SIGINT, signal.default_int_handler)
rng = np.random.default_rng(0)
n = int(sys.argv[1])
points = np.column_stack([rng.uniform(4, 40, n), rng.uniform(-4, 4, n), rng.uniform(-1.7, 2, n)]).astype(np.float32)
pixels = np.zeros((2, 375, 1242), bool)
pixels[0, 150:300, 300:500] = pixels[1, 100:350, 700:900] = True
masks = ldls.InstanceMasks.from_array(pixels, categories=[3, 1])
T = [[0, -1, 0, 0], [0, 0, -1, -0.1], [1, 0, 0, -0.3], [0, 0, 0, 1]]
camera = ldls.Camera(projection=[[720, 0, 620], [0, 720, 180], [0, 0, 1]], T_camera_lidar=T)
few = points[:2000].copy()
before = ldls.segment(few, masks, camera).labels
"""

STOPPED = (
    CLOUD
    + """
print("ready", flush=True)
try:
    while True:
        ldls.segment(points, masks, camera)
except KeyboardInterrupt:
    after = ldls.segment(few, masks, camera).labels
    print("stopped", bool((after == before).all()), flush=True)
"""
)

IN_LITTLE_MEMORY = (
    CLOUD
    + """
import resource
from pathlib import Path

used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
limit = used + int(sys.argv[2]) * 2**20
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
try:
    ldls.segment(points, masks, camera)
    print("done")
except MemoryError as error:
    print("not enough memory" in str(error) or "allocate" in str(error))
after = ldls.segment(few, masks, camera).labels
print(bool((after == before).all()))
"""
)


@pytest.mark.skipif(sys.platform == "win32", reason="no signal reaches one process alone")
@pytest.mark.parametrize("after_s", [0.05, 0.4, 0.9])
def test_ctrl_c_ends_a_call_and_the_next_one_works(after_s):
    with subprocess.Popen([sys.executable, "-c", STOPPED, "1000000"], stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout.readline() == "ready\n"
        time.sleep(after_s)
        child.send_signal(signal.SIGINT)
        # some tens of milliseconds on a quiet machine; a call of this size takes seconds on a busy one
        out, _ = child.communicate(timeout=60)
    assert out == "stopped True\n"


def test_a_signal_handler_that_raises_stops_a_call():
    def raise_(*_):
        raise TimeoutError("enough")

    points = np.random.default_rng(0).uniform(-50, 50, (3_000_000, 3))
    before = signal.signal(signal.SIGALRM, raise_)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.2)
        with pytest.raises(TimeoutError, match="enough"):
            for _ in range(100):
                stages.neighbors(points, k=20)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="tells the memory in use by /proc")  # noqa: PTH110
@pytest.mark.parametrize("megabytes", [70, 150, 300, 450, 600])
def test_a_lack_of_memory_is_an_error_and_the_next_call_works(megabytes):
    run = python("-c", IN_LITTLE_MEMORY, 2_000_000, megabytes)
    assert run.returncode == 0, run.stderr
    assert run.stdout in ("True\nTrue\n", "done\nTrue\n")


@pytest.mark.parametrize(
    "points",
    [
        pytest.param(np.ones((120_000, 3)), id="all in one place"),
        pytest.param(np.random.default_rng(0).uniform(-40, 40, (120_000, 3)).round(), id="rounded to a metre"),
    ],
)
def test_crowded_clouds_take_no_longer_than_others(points):
    start = time.perf_counter()
    indices = stages.neighbors(points, k=10)[0]
    # seconds where each point meets all others at its place; a hundredth of one is usual
    assert time.perf_counter() - start < 5
    assert (indices != np.arange(len(points))[:, None]).all()
    assert ldls.stages.neighbors(points[:1], k=10)[0].shape == (1, 0)
