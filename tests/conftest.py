import os
import re
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

import ldls
from command import command
from ldls.simulation import sample_frame

# the same examples in every run, and no clock: a loaded machine is no fault of the code
settings.register_profile("tests", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
# other examples in every run, and many
settings.register_profile("fuzz", settings.get_profile("tests"), derandomize=False, max_examples=5_000)
settings.load_profile("tests")

# pipes, signals, limits and mounts, which other systems lack or have in other ways
NEEDS_LINUX = re.compile(r"\bimport resource\b|os\.(mkfifo|geteuid|fork)|SIGKILL|SIGPROF|/proc/|/dev/|setrlimit")

KITTI_FRAMES = ("000000", "000001", "000002", "000003", "000571")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config):
    """A process for each core, four at most, for the whole suite; a file alone is sooner done in this one."""
    if config.args == config.getini("testpaths") and (cores := os.cpu_count() or 1) > 1:
        return min(cores, 4)
    config.option.dist = "no"
    return 0


def pytest_ignore_collect(collection_path):
    """Leave out, on other systems than Linux, the files of tests that need it."""
    if sys.platform != "linux" and collection_path.suffix == ".py":
        return bool(NEEDS_LINUX.search(collection_path.read_text(encoding="utf-8"))) or None
    return None


@dataclass(frozen=True)
class Frame:
    """One real KITTI frame and what the method makes of it."""

    points_path: Path
    calib_path: Path
    masks_path: Path
    image_path: Path
    points: np.ndarray
    masks: ldls.InstanceMasks
    camera: ldls.Camera
    expected: dict


@pytest.fixture(scope="session")
def data_folder():
    folder = os.environ.get("LDLS_TEST_DATA")
    if not folder:  # unset, or empty as an unset variable of a CI is
        pytest.skip("LDLS_TEST_DATA is not set: it names the folder of real frames")
    return Path(folder)


def load_frame(folder: Path, name: str) -> Frame:
    training = folder / "kitti/training"
    points = training / f"velodyne/{name}.bin"
    calib = training / f"calib/{name}.txt"
    masks = training / f"masks/{name}.json"
    with np.load(training / f"expected/{name}.npz") as expected:
        return Frame(
            points_path=points,
            calib_path=calib,
            masks_path=masks,
            image_path=training / f"image_2/{name}.png",
            points=ldls.read_points(points),
            masks=ldls.read_masks(masks),
            camera=ldls.read_camera(calib),
            expected=dict(expected),
        )


@pytest.fixture(scope="session", params=KITTI_FRAMES)
def kitti_frame(request, data_folder):
    return load_frame(data_folder, request.param)


@pytest.fixture(scope="session")
def frame_571(data_folder):
    return load_frame(data_folder, "000571")


@pytest.fixture(scope="session")
def sample():
    """The frame that comes with the package; nobody changes it."""
    return sample_frame()


@pytest.fixture(scope="session")
def demo(tmp_path_factory):
    """The folder that `ldls demo` fills, and how that ended; nobody changes it."""
    folder = tmp_path_factory.mktemp("demo")
    return folder, command("demo", "--out", folder)


@pytest.fixture
def own_demo(demo, tmp_path):
    """A copy of it, to be changed, in ldls-demo below the test's folder."""
    return shutil.copytree(demo[0], tmp_path / "ldls-demo")


@pytest.fixture
def no_display(monkeypatch):
    """A server of Linux, where no viewer can open."""
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")


@pytest.fixture
def small_scene():
    """Two objects before a wall, and a mask that bleeds a little over each: (points, masks, camera)."""
    generator = np.random.default_rng(7)
    left = generator.uniform([-2.2, -0.6, 9.8], [-1.2, 0.6, 10.2], (120, 3))
    right = generator.uniform([1.2, -0.6, 9.8], [2.2, 0.6, 10.2], (120, 3))
    wall = generator.uniform([-5, -4, 14], [5, 4, 14.2], (260, 3))
    points = generator.permutation(np.vstack([left, right, wall])).astype(np.float32)
    pixels = np.zeros((2, 60, 80), bool)
    pixels[0, 23:38, 17:29] = True
    pixels[1, 23:38, 51:63] = True
    masks = ldls.InstanceMasks.from_array(pixels, categories=[1, 3], scores=[0.9, 0.8])
    return points, masks, pinhole()


@pytest.fixture
def result(small_scene):
    """The segmentation of the small scene."""
    return ldls.segment(*small_scene)


def pinhole(focal_px=100.0, center=(40.0, 30.0), **options):
    u, v = center
    matrix = [[focal_px, 0, u, 0], [0, focal_px, v, 0], [0, 0, 1, 0]]
    return ldls.Camera(projection=matrix, **options)


def moved(x, y=0.0, z=0.0, yaw=0.0):
    """A pose there, turned by `yaw` about z."""
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    pose[:3, 3] = x, y, z
    return pose
