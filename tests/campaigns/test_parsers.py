"""The driver tells what happened to each input: read, refused, a wrong error, a crash, a hang or too much memory."""

import os
import signal
import sys
import time
from argparse import Namespace

import numpy as np
import pytest

pytest.importorskip("resource", reason="the driver limits memory as POSIX does")
pytest.importorskip("laspy")
pytest.importorskip("lzf")
pytest.importorskip("onnx")
pytest.importorskip("rosbags")

from campaigns import parsers
from campaigns.file_parsers import PARSERS, Inputs, Parser
from ldls.errors import CorruptFileError

DEEDS = {
    b"read": lambda: None,
    b"refuse": lambda: (_ for _ in ()).throw(CorruptFileError("a.txt: refused")),
    b"refuse without a name": lambda: (_ for _ in ()).throw(CorruptFileError("refused")),
    b"lose its way": lambda: {}["key"],
    b"crash": lambda: os.kill(os.getpid(), signal.SIGSEGV),
    b"hang": lambda: time.sleep(1000),
    b"take its time": lambda: time.sleep(1),
    b"swell": lambda: np.ones(300 << 20, np.uint8).sum(),
    b"ask for the moon": lambda: np.empty(1 << 50, np.uint8),
}


class Deeds:
    """Inputs that are read as they say."""

    parser = Parser(("a.txt",), lambda _: [], lambda path: DEEDS[path.read_bytes()]())

    def __init__(self, name, seed):
        self.name, self.seed = name, seed

    def __getitem__(self, number):
        return list(DEEDS)[number]


@pytest.mark.parametrize("name", PARSERS)
def test_files_that_nobody_changed_are_read(name, tmp_path):
    inputs = Inputs(name, 0)
    for seed in inputs.seeds:
        assert inputs.parser.outcome(tmp_path, inputs.parser.join(seed)) == "accepted"


@pytest.mark.skipif(sys.platform != "linux", reason="the driver reads /proc")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_each_kind_of_fault_is_told_from_the_others(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(parsers, "Inputs", Deeds)
    monkeypatch.setattr(parsers, "SLOW_S", 0.5)
    monkeypatch.setattr(parsers, "HANGS_S", 8)
    options = Namespace(inputs=len(DEEDS), seconds=1000, seed=3, jobs=1, out=tmp_path / "faults")
    assert parsers.campaign("deeds", options) == len(DEEDS) - 2
    row, *faults = capsys.readouterr().out.splitlines()
    assert row.split()[:8] == ["deeds", "9", "11.1%", "1", "2", "1", "2", "2"]
    told = {line.partition(" x ")[2].partition(":")[0] for line in faults}
    assert told == {
        "CorruptFileError at outside of ldls without the name of the file",
        "KeyError at outside of ldls",
        "crash, exit code -11",
        "slow, over 8 s",
        "slow",
        "fat",
    }
    assert any(line.endswith("--parser deeds --seed 3 --only 4") for line in faults)
    assert (tmp_path / "faults/deeds-3-4").read_bytes() == b"crash"
