"""Changes small files at random and reads them, a million for each parser: `make fuzz-files`.

Each parser is read in a process of its own with a limit of memory and a watch: a crash, a hang and a fat input are told
apart, and what was found is kept with the command that shows it again. Nothing but errors of ldls may leave a reader.
"""

import argparse
import multiprocessing
import os
import resource
import shlex
import signal
import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from campaigns.file_parsers import PARSERS, Inputs
from memory import address_space, resident_bytes

SLOW_S = 5.0
HANGS_S = 30.0
"""After so long a worker is killed."""
FAT_BYTES = 256 << 20
SPARE_BYTES = 1 << 30
"""Address space of a worker beyond what it has at first: who asks for more gets a MemoryError."""
AGAIN = 77
"""Exit code of a worker that another one follows."""
LEAST_ACCEPTED = 0.1
"""Share of the files that a parser must still read, for its deeper parts to be reached."""
KEPT = 3
"""Inputs kept of each fault."""
processes = multiprocessing.get_context("fork")
FOLDER = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None


def main():
    options = parsed()
    if options.only is not None:
        return show(options.parser[0], options.seed, options.only)
    print(f"{'parser':27} {'inputs':>9} accepted {'refused':>9} wrong crash slow  fat inputs/s")
    n_faults = 0
    for name in options.parser or PARSERS:
        n_faults += campaign(name, options)
    print(f"{n_faults} faults" + (f", kept in {options.out}" if n_faults else ""))
    return n_faults > 0


def parsed():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--parser", action="append", choices=list(PARSERS), help="one of them; all by default")
    parser.add_argument("--inputs", type=int, default=1_000_000, help="for each parser")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="for each parser, at most")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--out", type=Path, default=Path("fuzz-faults"), help="folder for inputs that are faults")
    parser.add_argument("--only", type=int, help="number of one input, which is read here, with its traceback")
    options = parser.parse_args()
    if options.only is not None and len(options.parser or ()) != 1:
        parser.error("--only: expected one --parser with it")
    return options


def show(name, seed, number):
    """Read one input in this process; whatever is wrong with it is seen."""
    content = Inputs(name, seed)[number]
    be_strict()
    with tempfile.TemporaryDirectory() as folder:
        path = PARSERS[name].place(Path(folder), content)
        print(f"{path}: {len(content)} bytes: {content[:2000]!r}")
        print(PARSERS[name].read(path))


class Worker:
    """A process that reads some of the inputs, and another after it if it dies."""

    def __init__(self, inputs, numbers):
        self.inputs, self.numbers = inputs, numbers
        self.at = processes.RawValue("q", 0)
        self.since = processes.RawValue("d", 0)
        self.read = {kind: processes.RawValue("q", 0) for kind in ("accepted", "refused")}
        self.faults, self.sender = processes.Pipe(duplex=False)
        self.found = []
        self.kept = tempfile.TemporaryDirectory(dir=FOLDER)
        self.folder = Path(self.kept.name)
        self.begin()

    def begin(self):
        self.since.value = time.monotonic()
        self.process = processes.Process(target=self.work, daemon=True)
        self.process.start()

    def work(self):
        """Read the inputs from the one that is next, in the process of its own."""
        be_strict()
        with Path(os.devnull).open("wb") as nowhere:
            os.dup2(nowhere.fileno(), 2)  # where panics of libraries print
        resource.setrlimit(resource.RLIMIT_AS, (address_space() + SPARE_BYTES, resource.RLIM_INFINITY))
        for at in range(self.at.value, len(self.numbers)):
            # what it takes to make an input is not the parser's
            made = self.inputs[self.numbers[at]]
            before, peak_before = resident_bytes(), peak_bytes()
            self.at.value, self.since.value = at, time.monotonic()
            kind = self.inputs.parser.outcome(self.folder, made)
            if time.monotonic() - self.since.value > SLOW_S:
                kind = "slow"
            if peak_bytes() > max(peak_before, before + FAT_BYTES):
                kind = "fat"
            if kind in self.read:
                self.read[kind].value += 1
            else:
                self.sender.send((self.numbers[at], kind))
            if kind == "fat":  # a new process begins with little memory again
                self.at.value += 1
                os._exit(AGAIN)

    def watch(self):
        """Take in what was found, and begin again after a crash or a hang; False when all is read."""
        self.take_in()
        if self.process.is_alive():
            if time.monotonic() - self.since.value < HANGS_S:
                return True
            self.process.kill()
        self.process.join()
        if self.process.exitcode == 0:
            return False
        if self.process.exitcode == 1:
            sys.exit(f"the driver itself failed: --only {self.numbers[self.at.value]} shows how")
        if self.process.exitcode != AGAIN:
            hangs = self.process.exitcode == -signal.SIGKILL
            fault = f"slow, over {HANGS_S:.0f} s" if hangs else f"crash, exit code {self.process.exitcode}"
            self.found.append((self.numbers[self.at.value], fault))
            self.at.value += 1
        self.begin()
        return True

    def take_in(self):
        while self.faults.poll():
            self.found.append(self.faults.recv())

    def stop(self):
        """End the process before all is read."""
        self.numbers = self.numbers[: self.at.value]
        self.process.terminate()
        self.process.join()
        self.take_in()
        self.kept.cleanup()


def be_strict():
    """Warnings of NumPy, of numbers that nobody has looked at, are errors; no other warning is shown."""
    warnings.simplefilter("ignore")
    warnings.simplefilter("error", RuntimeWarning)


def peak_bytes():
    """The most memory that this process ever had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def campaign(name, options):
    """Read the inputs of one parser and print its row; the number of faults."""
    start, jobs = time.monotonic(), options.jobs
    inputs = Inputs(name, options.seed)
    workers = [Worker(inputs, range(k, options.inputs, jobs)) for k in range(jobs)]
    while any([worker.watch() for worker in workers]) and time.monotonic() - start < options.seconds:
        time.sleep(0.02)
    for worker in workers:
        worker.stop()
    elapsed = time.monotonic() - start
    accepted, refused = (sum(worker.read[kind].value for worker in workers) for kind in ("accepted", "refused"))
    found = sorted(fault for worker in workers for fault in worker.found)
    kinds = Counter(fault.split(",")[0] for _, fault in found)
    wrong = len(found) - sum(kinds[kind] for kind in ("crash", "slow", "fat"))
    n = accepted + refused + len(found)
    print(
        f"{name:27} {n:9,} {accepted / max(n, 1):8.1%} {refused:9,} {wrong:5} {kinds['crash']:5} {kinds['slow']:4} "
        f"{kinds['fat']:4} {n / elapsed / jobs:8,.0f}",
        flush=True,
    )
    keep(inputs, found, options.out)
    if accepted < LEAST_ACCEPTED * n:
        print(f"    accepts less than {LEAST_ACCEPTED:.0%}: change its files more gently")
    return len(found) + (accepted < LEAST_ACCEPTED * n)


def keep(inputs, found, folder):
    """Keep the first inputs of each fault, and print the command that reads the first one again."""
    for fault, n in Counter(fault for _, fault in found).most_common():
        numbers = [number for number, own in found if own == fault][:KEPT]
        folder.mkdir(exist_ok=True)
        for number in numbers:
            (folder / f"{inputs.name} {inputs.seed} {number}".replace(" ", "-")).write_bytes(inputs[number])
        words = ["--parser", inputs.name, "--seed", inputs.seed, "--only", numbers[0]]
        print(f"    {n} x {fault}: python tests/campaigns/parsers.py {shlex.join(map(str, words))}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
