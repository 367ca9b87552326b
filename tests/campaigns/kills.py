"""Kills runs over 300 frames, lets them go on, and holds their folders against an undisturbed one: `make kills`.

Half of the kills are of frames one by one, half of a drive whose sweeps are labelled together and tracked.
"""

import argparse
import random
import signal
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from batch import drives, killed_at, runs
from command import process
from datasets import layouts

N_FRAMES = 300
KINDS = {
    "frames one by one": (layouts.many_frames, ()),
    "a drive": (drives.small_drive, ("--sweeps", 2, "--track")),
}
"""What makes the source of each kind, and the options that its command has besides."""


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    kills = -(-options.kills // len(KINDS))
    sys.exit(not all([holds(kind, kills, options.seed) for kind in KINDS]))


def holds(kind, kills, seed):
    """Kill runs of a kind so many times; whether all their folders equal the undisturbed one."""
    with tempfile.TemporaryDirectory() as folder:
        campaign = Campaign(Path(folder), random.Random(seed), *KINDS[kind])
        while campaign.n_kills < kills:
            campaign.disturb(kills - campaign.n_kills)
            print(f"\r{campaign.n_kills} kills", end="", file=sys.stderr, flush=True)
    print(
        f"\n{kind}: {campaign.n_kills} kills ({campaign.n_at_steps} at a step of a write) of {campaign.n_runs} runs "
        f"over {N_FRAMES} frames; "
        f"{campaign.n_equal} of {campaign.n_runs} folders equal the undisturbed one byte for byte"
    )
    return campaign.n_equal == campaign.n_runs


class Campaign:
    """Runs that are killed one to four times each, at random moments and at steps of a write in turn."""

    def __init__(self, folder, random_, make_source, options):
        self.folder, self.random, self.options = folder, random_, options
        self.n_kills = self.n_at_steps = self.n_runs = self.n_equal = 0
        self.source = make_source(folder / "source", N_FRAMES)
        out = folder / "undisturbed"
        start = time.monotonic()
        self.finish(out)
        self.longest_s = time.monotonic() - start
        self.expected = runs.contents(out)

    def disturb(self, most):
        out = self.folder / f"out {self.n_runs}"
        for _ in range(min(self.random.randint(1, 4), most)):
            self.n_kills += self.kill_at_step(out) if self.random.random() < 0.4 else self.kill_at_random(out)
        self.finish(out)
        self.n_runs += 1
        self.n_equal += runs.contents(out) == self.expected

    def finish(self, out):
        done = process(*self.arguments(out))
        assert done.returncode == 0, done.stderr

    def arguments(self, out):
        return runs.arguments(self.source, out, *self.options)

    def kill_at_random(self, out):
        return runs.killed_after(self.arguments(out), out, self.random.uniform(0, self.longest_s / 2))

    def kill_at_step(self, out):
        step = self.random.choice(list(killed_at.STEPS))
        n = 1 if step.startswith("journal") else self.random.choice((1, 2, 3, 30, 100, 200))
        killed = runs.killed(step, n, self.arguments(out)).returncode == -signal.SIGKILL
        self.n_at_steps += killed
        return killed


if __name__ == "__main__":
    main()
