import os
import subprocess
import sys

import pytest

from batch import drives, runs
from command import process
from datasets import layouts
from ldls.simulation import Drive, drive_folder, write_drive


@pytest.fixture(scope="session")
def source(tmp_path_factory):
    """60 frames with stored masks; nobody changes them."""
    return layouts.many_frames(tmp_path_factory.mktemp("source"), 60)


@pytest.fixture(scope="session")
def undisturbed(source, tmp_path_factory):
    """The files that an undisturbed run of these frames leaves."""
    out = tmp_path_factory.mktemp("undisturbed")
    outcome = process(*runs.arguments(source, out))
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


@pytest.fixture(scope="session")
def simulated(tmp_path_factory):
    """A simulated drive of five frames with masks and poses; nobody changes it."""
    folder, drive = tmp_path_factory.mktemp("simulated"), Drive(n_frames=5, seed=2, lidar="vlp-16", camera="robot")
    for _ in write_drive(folder, drive):
        pass
    return drive_folder(folder, drive)


@pytest.fixture
def drive(tmp_path):
    """A small drive of eight frames that a test may change."""
    return drives.small_drive(tmp_path / "drive")
