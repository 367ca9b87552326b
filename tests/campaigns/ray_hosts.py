"""A run on a Ray cluster of three hosts, of which one joins late and one is cut off: `make ray-hosts`.

The hosts are network namespaces of this machine, each with processes and a /tmp/ray of its own, joined by a bridge in a
fourth one; nothing outside them is reached. They share the folder of source and results, as hosts of a cluster do. The
host that is cut off goes on with what it has in hand, for it still sees the folder: what it does then must neither be
lost nor done again. Its cable is put back before the end, so that it comes back from the dead, too.

Needs root, iproute2, util-linux and Ray.
"""

import argparse
import contextlib
import os
import secrets
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from batch import runs
from command import process
from datasets import layouts

PYTHON = Path(sys.executable)
LOCAL_TMP = Path("/tmp/ray")
PORT = 6379
ADDRESS = "10.213.77."
CORES = {"head": 1, "first": 2, "late": 2}
HEALTH = {
    "RAY_health_check_initial_delay_ms": "1000",
    "RAY_health_check_period_ms": "500",
    "RAY_health_check_timeout_ms": "500",
    "RAY_health_check_failure_threshold": "3",
}
"""A host that says nothing for two seconds is dead."""
WORKER = """
import os, socket, sys, time

if any("default_worker.py" in word for word in sys.orig_argv):
    from ldls.batch.frame_work import FrameWork

    def log(*words):
        line = " ".join([*words, socket.gethostname(), str(os.getpid())]) + "\\n"
        handle = os.open(os.environ["SIDE_LOG"], os.O_WRONLY | os.O_APPEND | os.O_CREAT)
        os.write(handle, line.encode())
        os.close(handle)

    read, write = FrameWork.read, FrameWork.write

    def logged_read(self, window):
        log("begun", window.works[0].name)
        time.sleep(float(os.environ["FRAME_S"]))
        read(self, window)

    def logged_write(self, window):
        write(self, window)
        log("done", window.works[0].name)

    FrameWork.read, FrameWork.write = logged_read, logged_write
"""
"""What workers do besides: they tell what they begin and write, and take their time."""


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=600)
    parser.add_argument("--frame-s", type=float, default=0.1, help="Seconds that a worker waits in each frame.")
    parser.add_argument("--limit-s", type=float, default=600, help="Seconds after which the run counts as hung.")
    options = parser.parse_args()
    reason = cannot_run()
    if reason is not None:
        print(f"skipped: {reason}")
        return
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    with tempfile.TemporaryDirectory() as folder:
        sys.exit(not Campaign(Path(folder), options).holds())


def cannot_run():
    """Why there can be no hosts here; None where there can."""
    missing = [tool for tool in ("ip", "unshare", "nsenter", "mount") if shutil.which(tool) is None]
    if sys.platform != "linux" or missing:
        return f"needs Linux with {' and '.join(missing) or 'namespaces'}"
    if os.geteuid() != 0:
        return "only root may make network namespaces"
    if not (PYTHON.parent / "ray").exists():
        return "Ray is not installed"
    probe = f"ldls-probe-{os.getpid()}"
    if subprocess.run(["ip", "netns", "add", probe], capture_output=True, check=False).returncode != 0:
        return "network namespaces cannot be made here"
    subprocess.run(["ip", "netns", "delete", probe], check=True)
    return None


class Campaign:
    def __init__(self, folder, options):
        self.folder, self.options = folder, options
        self.source = layouts.many_frames(folder / "source", options.frames)
        self.out, self.side_log = folder / "out", folder / "side.log"
        (folder / "sitecustomize.py").write_text(WORKER)

    def holds(self):
        words = runs.arguments(self.source, self.folder / "local")
        assert process(*words).returncode == 0
        with Hosts(self.folder, self.environment()) as hosts:
            for host in ("head", "first"):
                hosts.start(host)
                hosts.wait_for(host)
            returncode, moments = self.run(hosts)
        return self.report(returncode, moments)

    def environment(self):
        return {
            **{name: value for name, value in os.environ.items() if not name.lower().endswith("_proxy")},
            **HEALTH,
            "PYTHONPATH": os.pathsep.join([str(self.folder), os.environ.get("PYTHONPATH", "")]),
            "SIDE_LOG": str(self.side_log),
            "FRAME_S": str(self.options.frame_s),
            "RAY_USAGE_STATS_ENABLED": "0",
            # these hosts let nobody else in
            "RAY_AUTH_MODE": "token",
            "RAY_AUTH_TOKEN": secrets.token_hex(32),
        }

    def run(self, hosts):
        """Run on the hosts; the exit status, and how many frames were done when something happened."""
        n_frames, moments = self.options.frames, {}
        steps = [
            (n_frames // 6, "the third host joins", lambda: hosts.start("late")),
            (n_frames // 2, "the second host is cut off", lambda: hosts.cut("first")),
            (n_frames * 5 // 6, "its cable is put back", lambda: hosts.join("first")),
        ]
        words = runs.arguments(self.source, self.out, "--engine", "ray", "--ray-address", f"{ADDRESS}1:{PORT}")
        patience = time.monotonic() + self.options.limit_s
        with hosts.process("head", [PYTHON, "-m", "ldls", *words]) as driver:
            for least, what, step in steps:
                while driver.poll() is None and self.n_done() < least and time.monotonic() < patience:
                    time.sleep(0.02)
                moments[what] = self.n_done()
                step()
                print(f"{moments[what]} of {n_frames} frames done: {what}", flush=True)
            with contextlib.suppress(subprocess.TimeoutExpired):
                driver.wait(max(patience - time.monotonic(), 1))
            driver.kill() if driver.poll() is None else None
            return driver.wait(), moments

    def side_lines(self, kind):
        lines = self.side_log.read_text().splitlines() if self.side_log.exists() else []
        return [line.split() for line in lines if line.startswith(f"{kind} ")]

    def n_done(self):
        return len({frame for _, frame, *_ in self.side_lines("done")})

    def report(self, returncode, moments):
        expected, found = runs.contents(self.folder / "local"), runs.contents(self.out)
        labels = [name for name in expected if name != "journal.jsonl"]
        written = Counter(frame for _, frame, *_ in self.side_lines("done"))
        begun = Counter(frame for _, frame, *_ in self.side_lines("begun"))
        hosts = Counter(host for *_, host, _ in self.side_lines("done"))
        lines = Counter(found.get("journal.jsonl", b"").split(b"\n"))
        figures = {
            "lost": sum(name not in found for name in labels),
            "done twice, by the workers": sum(count > 1 for count in written.values()),
            "done twice, by the journal": sum(count > 1 for count in lines.values()),
            "of other bytes": sum(found.get(name) != expected[name] for name in labels if name in found),
            "other files": len(found.keys() ^ expected.keys()),
        }
        print(f"exit status {returncode}; frames written by host: {dict(hosts)}")
        print(f"frames begun again elsewhere: {sum(n > 1 for n in begun.values())}")
        print(", ".join(f"{count} {what}" for what, count in figures.items()))
        same = found == expected
        print(f"the folder {'equals' if same else 'differs from'} that of a local run, journal included")
        return returncode == 0 and same and not any(figures.values()) and set(hosts) == set(CORES)


class Hosts:
    """Hosts with an address each on a bridge; gone when the block ends."""

    def __init__(self, folder, environment):
        self.folder, self.environment = folder, environment
        self.names = {host: f"ldls-{os.getpid()}-{host}" for host in ("switch", *CORES)}
        self.addresses = {host: f"{ADDRESS}{number}" for number, host in enumerate(CORES, start=1)}
        self.running = {}

    def __enter__(self):
        self.made_tmp = not LOCAL_TMP.exists()
        LOCAL_TMP.mkdir(exist_ok=True)
        try:
            for name in self.names.values():
                ip("netns", "add", name)
            self.within("switch", "link", "add", "bridge", "type", "bridge")
            self.within("switch", "link", "set", "bridge", "up")
            for host, address in self.addresses.items():
                peer = ("peer", "name", "eth", "netns", self.names[host])
                self.within("switch", "link", "add", host, "type", "veth", *peer)
                self.within("switch", "link", "set", host, "master", "bridge", "up")
                self.within(host, "address", "add", f"{address}/24", "dev", "eth")
                self.within(host, "link", "set", "eth", "up")
                self.within(host, "link", "set", "lo", "up")
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        for each in self.running.values():
            each.kill()
            each.wait()
        for name in self.names.values():
            # with it go its addresses and cables
            subprocess.run(["ip", "netns", "delete", name], capture_output=True, check=False)
        if self.made_tmp:
            with contextlib.suppress(OSError):
                LOCAL_TMP.rmdir()

    def start(self, host):
        """Start Ray on a host."""
        own = self.folder / f"{host}-tmp"
        own.mkdir()
        leads = ["--head", f"--port={PORT}", "--include-dashboard=false"]
        role = leads if host == "head" else [f"--address={self.addresses['head']}:{PORT}"]
        options = [f"--node-ip-address={self.addresses[host]}", f"--num-cpus={CORES[host]}", "--block"]
        limits = ["--object-store-memory=100000000", "--disable-usage-stats"]
        ray = [PYTHON.parent / "ray", "start", *role, *options, *limits]
        script = 'hostname "$1" && mount --bind "$2" "$3" && shift 3 && exec "$@"'
        apart = ["unshare", "--mount", "--uts", "--pid", "--fork", "--kill-child", "--mount-proc"]
        command = [*apart, "sh", "-c", script, "sh", host, own, LOCAL_TMP, *ray]
        log = (self.folder / f"{host}.log").open("wb")
        self.running[host] = subprocess.Popen(
            ["ip", "netns", "exec", self.names[host], *map(str, command)],
            env=self.environment, stdout=log, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
        )  # fmt: skip

    def wait_for(self, host):
        """Wait until a host is part of the cluster."""
        log = self.folder / f"{host}.log"
        runs.wait_for(lambda: self.running[host].poll() is not None or b"Ray runtime started" in log.read_bytes())
        assert self.running[host].poll() is None, log.read_text(errors="replace")[-3000:]

    def process(self, host, command):
        """A process on a host."""
        (first,) = children(self.running[host].pid)
        spaces = ["--mount", "--uts", "--pid", "--net"]
        return subprocess.Popen(
            ["nsenter", "--target", first, *spaces, *map(str, command)], env=self.environment, stdin=subprocess.DEVNULL
        )

    def cut(self, host):
        self.within("switch", "link", "set", host, "down")

    def join(self, host):
        self.within("switch", "link", "set", host, "up")

    def within(self, host, *words):
        ip("-netns", self.names[host], *words)


def children(pid):
    return Path(f"/proc/{pid}/task/{pid}/children").read_text().split()


def ip(*words):
    subprocess.run(["ip", *words], check=True)


if __name__ == "__main__":
    main()
