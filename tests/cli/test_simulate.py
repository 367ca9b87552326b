"""`ldls simulate` from the outside."""

import pytest

import ldls
from command import command

SMALL = ["--lidar", "vlp-16", "--rig", "robot", "--cores", "1"]


def test_frames_are_written_and_counted(tmp_path):
    words = ["simulate", tmp_path / "out", "--seed", 4, *SMALL]
    result = command(*words, "--count", 2, "--scene", "campus")
    assert result.exit_code == 0, result.output
    assert "person" in result.output and "Cyclist" in result.output and "2 frames" in result.output
    training = tmp_path / "out/training"
    assert sorted(p.name for p in (training / "velodyne").iterdir()) == ["000000.bin", "000001.bin"]
    assert ldls.read_masks(training / "masks/000001.json").image_size == (480, 640)
    assert "kept 2" in command(*words, "--count", 2, "--scene", "campus").output
    other = command(*words, "--count", 3, "--scene", "street")
    assert other.exit_code == 1
    assert "holds frames that are made of something else" in " ".join(other.output.split())
    assert len(list((training / "velodyne").iterdir())) == 2


def test_no_errors_means_perfect_masks_and_calibration(tmp_path):
    assert command("simulate", tmp_path, "--count", 1, "--no-errors", *SMALL).exit_code == 0
    masks = ldls.read_masks(tmp_path / "training/masks/000000.json")
    assert (masks.scores == 1).all()
    rotation = ldls.read_camera(tmp_path / "training/calib/000000.txt").T_camera_lidar[:3, :3]
    assert abs(rotation).max(axis=1) == pytest.approx(1)


@pytest.mark.parametrize(
    "arguments",
    [
        pytest.param(["--lidar", "hdl-65"], id="no such lidar"),
        pytest.param(["--count", "0"], id="no frames"),
        pytest.param(["--suite", "tuning", "--no-errors"], id="a suite without its errors"),
        pytest.param(["--suite", "tuning", "--layout", "kitti-raw"], id="a suite as a drive"),
        pytest.param(["--rig", "ring", "--layout", "kitti-raw"], id="a drive with a ring"),
        pytest.param(["--suite", "tuning", "--layout", "mcap"], id="a suite as a bag"),
        pytest.param(["--spinning"], id="single scenes that take their time"),
    ],
)
def test_what_cannot_be_made_is_refused(tmp_path, arguments):
    assert command("simulate", tmp_path / "out", *arguments).exit_code != 0
    assert not (tmp_path / "out").exists()


def test_a_drive_is_written_in_the_raw_layout(tmp_path):
    result = command("simulate", tmp_path, "--count", 2, "--layout", "kitti-raw", "--seed", 5, *SMALL)
    assert result.exit_code == 0, result.output
    (drive,) = tmp_path.glob("2026_01_06/2026_01_06_drive_0005_sync")
    assert len(list((drive / "velodyne_points/data").iterdir())) == 2
    assert len((drive / "image_02/timestamps.txt").read_text().splitlines()) == 2
    assert "kept 2" in command("simulate", tmp_path, "--count", 2, "--layout", "kitti-raw", "--seed", 5, *SMALL).output


def test_a_lidar_spins_in_drives_alone(tmp_path):
    options = ["--count", 1, "--layout", "kitti-raw", "--seed", 5, *SMALL]
    result = command("simulate", tmp_path, *options, "--spinning")
    assert result.exit_code == 0, result.output
    (begin,) = tmp_path.glob("*/*/velodyne_points/timestamps_start.txt")
    assert begin.read_text().strip() == "2026-01-06 11:59:59.980000000"
    assert command("simulate", tmp_path, *options).exit_code != 0, "what is there is of the other kind"


@pytest.mark.parametrize(("layout", "name"), [("rosbag1", "drive.bag"), ("mcap", "drive/drive.mcap")])
def test_a_drive_is_a_bag_with_masks_beside_it(tmp_path, layout, name):
    pytest.importorskip("rosbags")
    result = command("simulate", tmp_path / "out", "--count", 1, "--layout", layout)
    assert result.exit_code == 0, result.output
    assert "wrote 1 sweeps" in result.output
    assert (tmp_path / "out" / name).is_file()
    assert [p.name for p in (tmp_path / "out/masks").iterdir()] == ["1700000000000000000.json"]
    assert command("simulate", tmp_path / "out", "--count", 1, "--layout", layout).exit_code != 0
    kept = {path: path.read_bytes() for path in (tmp_path / "out").rglob("*") if path.is_file()}
    other = {"rosbag1": "mcap", "mcap": "rosbag1"}[layout]
    refused = command("simulate", tmp_path / "out", "--count", 1, "--layout", other, "--seed", 1)
    assert refused.exit_code == 1 and "exists already, with masks and annotations" in " ".join(refused.output.split())
    assert kept == {path: path.read_bytes() for path in (tmp_path / "out").rglob("*") if path.is_file()}
