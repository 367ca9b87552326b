"""The guides: their commands run one after the other in an empty folder, and leave what the page says."""

import csv
import json
import os
import stat
import subprocess
import sys

import numpy as np
import pages
import pytest

import ldls
from datasets import layouts
from ldls.datasets import RosBag, open_source
from ldls.io.images import read_image_size


@pytest.fixture
def follow(tmp_path):
    """Runs all commands of a page; fails with what they print if one fails."""
    program = tmp_path / "bin/ldls"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m ldls "$@"\n')
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    paths = os.pathsep.join([str(program.parent), os.environ["PATH"]])

    def commands_of(page):
        text = (pages.ROOT / "docs" / page).read_text()
        script = "\n".join(["set -eu", *pages.blocks(text, "sh")])
        done = subprocess.run(
            ["bash", "-c", script],
            cwd=tmp_path,
            env=os.environ | {"PATH": paths},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done

    return commands_of


def test_from_yolo_to_3d_labels(follow, tmp_path):
    done = follow("yolo.md")
    assert "missing" not in done.stdout
    with (tmp_path / "labels3d/objects.csv").open() as file:
        names = [row["name"] for row in csv.DictReader(file)]
    assert names == ["car", "car", "person"]
    assert "is person (label 3): " in done.stdout
    assert read_image_size(tmp_path / "labels3d/000000.png") == (543, 1800)
    whole = ldls.read_result(tmp_path / "labels3d/000000.npz")
    np.testing.assert_array_equal(ldls.read_result(tmp_path / "one/000000.npz").labels, whole.labels)


def test_own_camera_own_lidar(follow, tmp_path, monkeypatch):
    follow("own-sensors.md")
    right, turned = (open_source(tmp_path / name)[0].images[0].camera for name in ("mine", "turned"))
    np.testing.assert_allclose(right.T_camera_lidar[:3], [[0, -1, 0, 0.06], [0, 0, -1, -0.08], [1, 0, 0, -0.27]])
    cosine = (np.trace(right.T_camera_lidar[:3, :3].T @ turned.T_camera_lidar[:3, :3]) - 1) / 2
    assert np.degrees(np.arccos(cosine)) == pytest.approx(2)
    assert (tmp_path / "labels/000000.png").exists()
    monkeypatch.chdir(tmp_path)
    names = {}
    for block in pages.blocks((pages.ROOT / "docs/own-sensors.md").read_text(), "python"):
        exec(block, names)
    assert sum(found.n_points > 0 for found in names["result"].objects) == 15
    # the page's transform is that of the rig, put together from a pose and a turn
    np.testing.assert_allclose(names["T_camera_lidar"], right.T_camera_lidar, atol=1e-12)
    assert names["camera"].image_size == (375, 1242)
    assert len((tmp_path / "labels/objects.csv").read_text().splitlines()) == 1 + 15


def test_a_ros_bag(follow, tmp_path):
    pytest.importorskip("rosbags")
    pytest.importorskip("embreex")
    done = follow("ros.md")
    assert "/velodyne_points" in done.stdout
    assert "20 of 20 frames done" in done.stdout
    with RosBag(tmp_path / "robot/labels/labelled", points_topic="/points_labelled") as labelled:
        assert len(labelled) == 20
        names = labelled.names
        classes = labelled.cloud(0).fields["class_id"]
    np.testing.assert_array_equal(classes, ldls.read_result(tmp_path / f"robot/labels/{names[0]}.npz").categories)
    assert len(list((tmp_path / "robot/labels").glob("*.png"))) == 20
    with (tmp_path / "robot/labels/objects.csv").open() as file:
        assert {row["frame"] for row in csv.DictReader(file)} == {*names}


def test_nuscenes_like_data(follow, tmp_path):
    layouts.nuscenes(tmp_path / "nuscenes")
    source = open_source(tmp_path / "nuscenes", scene="scene-0001")
    for frame in source:
        for image in frame.images:
            path = tmp_path / f"masks/{image.name}/{frame.name}.npz"
            path.parent.mkdir(parents=True, exist_ok=True)
            pixels = np.zeros((1, *image.camera.image_size), bool)
            pixels[:, 20:40, 30:50] = True
            ldls.save(ldls.InstanceMasks.from_array(pixels, categories=[3]), path)
    done = follow("nuscenes.md")
    assert "scene-0001_000 to scene-0001_001" in done.stdout
    for name in source.names:
        for ending in (".npz", "_lidarseg.bin", "_panoptic.npz", ".png"):
            assert (tmp_path / f"labels/{name}{ending}").exists()
    images = json.loads((tmp_path / "objects.json").read_text())["images"]
    assert len(images) == 2 * len(source.camera_names)
    assert "Point 20 is " in done.stdout
