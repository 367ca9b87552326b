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
from datasets import layouts

N_FRAMES = 300
KINDS = {
    "frames one by one": (layouts.many_frames, ()),
    "a drive": (drives.small_drive, ("--sweeps", 2, "--track")),
}
"""What makes the source, and what the command says besides."""


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    done = [campaign(kind, options.kills // len(KINDS), options.seed) for kind in KINDS]
    sys.exit(not all(done))


def campaign(kind, kills, seed):
    """Whether all folders of so many kills equal the undisturbed one."""
    with tempfile.TemporaryDirectory() as folder:
        of_kind = Campaign(Path(folder), random.Random(seed), *KINDS[kind])
        while of_kind.n_kills < kills:
            of_kind.disturb(kills - of_kind.n_kills)
            print(f"\r{of_kind.n_kills} kills", end="", file=sys.stderr, flush=True)
    print(
        f"\n{kind}: {of_kind.n_kills} kills ({of_kind.n_at_steps} at a step of a write) of {of_kind.n_runs} runs over "
        f"{N_FRAMES} frames; {of_kind.n_equal} of {of_kind.n_runs} folders equal the undisturbed one byte for byte"
    )
    return of_kind.n_equal == of_kind.n_runs


class Campaign:
    """Runs that are killed one to four times each, at random moments and at steps of a write in turn."""

    def __init__(self, folder, random_, made, said):
        self.folder, self.random, self.said = folder, random_, said
        self.n_kills = self.n_at_steps = self.n_runs = self.n_equal = 0
        self.source = made(folder / "source", N_FRAMES)
        out = folder / "undisturbed"
        start = time.monotonic()
        assert self.finish(out) == 0
        self.longest_s = time.monotonic() - start
        self.expected = runs.contents(out)

    def disturb(self, most):
        out = self.folder / f"out {self.n_runs}"
        for _ in range(min(self.random.randint(1, 4), most)):
            self.n_kills += self.kill_at_step(out) if self.random.random() < 0.4 else self.kill_at_random(out)
        assert self.finish(out) == 0
        self.n_runs += 1
        self.n_equal += runs.contents(out) == self.expected

    def finish(self, out):
        return runs.finished(self.arguments(out)).returncode

    def arguments(self, out):
        return runs.arguments(self.source, out, *self.said)

    def kill_at_random(self, out):
        return runs.killed_after(self.arguments(out), out, self.random.uniform(0, self.longest_s / 2))

    def kill_at_step(self, out):
        step = self.random.choice(list(killed_at.STEPS))
        n = 1 if step.startswith("journal") else self.random.choice((1, 2, 3, 30, 100, 200))
        words = [step, str(n), *self.arguments(out)]
        killed = runs.finished(words, program=[str(runs.KILLED_AT)]).returncode == -signal.SIGKILL
        self.n_at_steps += killed
        return killed


if __name__ == "__main__":
    main()
