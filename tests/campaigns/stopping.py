"""Stops calls by Ctrl-C (`make ctrl-c`) and by limits of memory (`make memory`), and looks how they end."""

import argparse
import collections
import signal
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from test_stopping import CLOUD

LONGEST_S = 0.2
TIMED = (
    CLOUD
    + """
import time

for _ in range(2):
    start = time.monotonic()
    ldls.segment(points, masks, camera)
# the first call also fetches memory
print(time.monotonic() - start, flush=True)
while sys.stdin.readline():
    try:
        print("begin", flush=True)
        ldls.segment(points, masks, camera)
        time.sleep(60)
    except KeyboardInterrupt:
        print(time.monotonic(), flush=True)
print(bool((ldls.segment(few, masks, camera).labels == before).all()), flush=True)
"""
)
LIMITED = (
    CLOUD
    + """
import resource

limit = int(sys.argv[2])
del points
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
try:
    points = np.column_stack([rng.uniform(4, 40, n), rng.uniform(-4, 4, n), rng.uniform(-1.7, 2, n)]).astype(np.float32)
    ldls.segment(points, masks, camera, params=ldls.Params.paper() if sys.argv[3] == "paper" else None)
    print("labels")
except MemoryError:
    print("MemoryError")
points = None
print(bool((ldls.segment(few, masks, camera).labels == before).all()))
"""
)


def ctrl_c(points, tries):
    """Print how long a call takes to return after each of some signals; True if none took too long."""
    took = []
    words = [sys.executable, "-c", TIMED, str(points)]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as child:
        whole_s = float(child.stdout.readline())
        print(f"{points:,} points take {whole_s:.2f} s")
        for i in range(tries):
            child.stdin.write("\n")
            child.stdin.flush()
            assert child.stdout.readline() == "begin\n"
            after_s = whole_s * (i + 0.5) / tries
            time.sleep(after_s)
            sent = time.monotonic()
            child.send_signal(signal.SIGINT)
            took.append(float(child.stdout.readline()) - sent)
            print(f"Ctrl-C after {after_s:6.2f} s: returned after {1e3 * took[-1]:4.0f} ms", flush=True)
        child.stdin.close()
        right = child.stdout.read() == "True\n"
    print(f"longest {1e3 * max(took):.0f} ms of {tries}; the next call {'works' if right else 'has other labels'}")
    return right and max(took) <= LONGEST_S


def memory(points, steps):
    """Print how calls under limits of memory ended; True if all ended with labels or a MemoryError."""
    endings = collections.Counter()
    for i in range(steps):
        limit = int(0.5e9 + 3.5e9 * i / max(steps - 1, 1))
        words = [sys.executable, "-c", LIMITED, str(points), str(limit), "paper" if i % 2 else "best"]
        run = subprocess.run(words, capture_output=True, text=True, check=False)
        ending, _, again = run.stdout.partition("\n")
        well = run.returncode == 0 and again == "True\n"
        endings[ending if well else f"status {run.returncode}"] += 1
        print(f"{limit / 1e9:.2f} GB: {ending if well else run.stderr[-300:]}", flush=True)
    print(", ".join(f"{count} {ending}" for ending, count in endings.items()))
    return endings.keys() <= {"labels", "MemoryError"}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["ctrl-c", "memory"])
    parser.add_argument("--points", type=int)
    parser.add_argument("--tries", type=int)
    options = parser.parse_args()
    if options.what == "ctrl-c":
        well = ctrl_c(options.points or 10_000_000, options.tries or 20)
    else:
        well = memory(options.points or 6_000_000, options.tries or 50)
    sys.exit(not well)


if __name__ == "__main__":
    main()
