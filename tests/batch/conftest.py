import os
import subprocess
import sys

import pytest

from batch import runs
from datasets import layouts


@pytest.fixture(scope="session")
def source(tmp_path_factory):
    """60 frames with stored masks; nobody changes them."""
    return layouts.many_frames(tmp_path_factory.mktemp("source"), 60)


@pytest.fixture(scope="session")
def undisturbed(source, tmp_path_factory):
    """The files that an undisturbed run of these frames leaves."""
    out = tmp_path_factory.mktemp("undisturbed")
    outcome = runs.finished(runs.arguments(source, out))
    assert outcome.returncode == 0, outcome.stderr
    return runs.contents(out)


@pytest.fixture
def few(tmp_path):
    """A source of twelve frames that a test may change."""
    return layouts.many_frames(tmp_path / "source", 12)


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 120 KiB, mounted."""
    place = tmp_path / "small"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=120k", "none", str(place)]
    if sys.platform != "linux" or os.geteuid() != 0 or subprocess.run(mount, check=False).returncode != 0:
        pytest.skip("only root may mount a small file system")
    yield place
    subprocess.run(["umount", str(place)], check=True)
