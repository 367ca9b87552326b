"""Files of poses: what they say, and what is said of broken ones."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import ldls
from datasets import layouts

STAMPS = np.array([10.0, 10.1, 10.2, 10.3])
T_CAMERA_LIDAR = layouts.T.copy()
T_CAMERA_LIDAR[:3, 3] = [0.1, -0.2, 0.3]


def transform(rotation, place):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation.as_matrix(), place
    return matrix


WAY = np.array(
    [transform(Rotation.from_euler("zyx", [4 * k, k, -k], degrees=True), [k, 0.1 * k * k, 0.05 * k]) for k in range(4)]
)
"""True T_world_lidar."""


def tum_text(poses=WAY, stamps=STAMPS):
    rows = [
        [stamp, *pose[:3, 3], *Rotation.from_matrix(pose[:3, :3]).as_quat()]
        for stamp, pose in zip(stamps, poses, strict=True)
    ]
    return "# stamp tx ty tz qx qy qz qw\n" + "".join(" ".join(f"{x:.9f}" for x in row) + "\n" for row in rows)


def kitti_text(poses):
    return "".join(layouts.row(pose[:3]) + "\n" for pose in poses)


def written(folder, text):
    path = folder / "poses.txt"
    path.write_text(text)
    return path


def test_tum_has_stamps_and_poses(tmp_path):
    trajectory = ldls.read_poses(written(tmp_path, tum_text()))
    np.testing.assert_allclose(trajectory.stamps, STAMPS)
    np.testing.assert_allclose(trajectory.poses, WAY, atol=1e-8)


def test_comments_may_stand_behind_poses(tmp_path):
    text = tum_text().replace("\n", " # 8 numbers\r\n").removesuffix("\r\n")
    trajectory = ldls.read_poses(written(tmp_path, text))
    np.testing.assert_allclose(trajectory.stamps, STAMPS)
    np.testing.assert_allclose(trajectory.poses, WAY, atol=1e-8)
    with pytest.raises(ldls.CorruptFileError, match="line 5: expected a number"):
        ldls.read_poses(written(tmp_path, text.replace("10.300000000", "east")))


def test_tum_of_a_camera_leads_to_the_lidar(tmp_path):
    path = written(tmp_path, tum_text(WAY @ np.linalg.inv(T_CAMERA_LIDAR)))
    np.testing.assert_allclose(ldls.read_poses(path, T_camera_lidar=T_CAMERA_LIDAR).poses, WAY, atol=1e-8)


def test_poses_of_kittis_camera_become_those_of_the_lidar(tmp_path):
    """The lidar sees one point from every pose; the first pose is the world's."""
    of_camera = T_CAMERA_LIDAR @ WAY @ np.linalg.inv(T_CAMERA_LIDAR)
    path = written(tmp_path, kitti_text(of_camera))
    trajectory = ldls.read_poses(path, stamps=STAMPS.tolist(), T_camera_lidar=T_CAMERA_LIDAR)
    np.testing.assert_allclose(trajectory.poses, WAY, atol=1e-8)
    assert np.array_equal(trajectory.stamps, STAMPS)
    np.savetxt(tmp_path / "T.txt", T_CAMERA_LIDAR)
    again = ldls.read_poses(path, format="kitti", stamps=STAMPS, T_camera_lidar=tmp_path / "T.txt")
    np.testing.assert_allclose(again.poses, trajectory.poses)


def test_what_kittis_poses_lack_is_asked_for(tmp_path):
    path = written(tmp_path, kitti_text(WAY))
    with pytest.raises(ldls.PoseError, match=r"poses.txt: .* without times; pass stamps=.* T_camera_lidar=.*no such"):
        ldls.read_poses(path)
    with pytest.raises(ldls.PoseError, match="got no stamps"):
        ldls.read_poses(path, T_camera_lidar=np.eye(4))
    with pytest.raises(ldls.PoseError, match="got no T_camera_lidar"):
        ldls.read_poses(path, stamps=STAMPS)
    with pytest.raises(ldls.PoseError, match="poses.txt: has 4 poses for 3 stamps"):
        ldls.read_poses(path, stamps=STAMPS[:3], T_camera_lidar=np.eye(4))
    with pytest.raises(ldls.DtypeError, match="stamps: "):
        ldls.read_poses(path, stamps="times.txt", T_camera_lidar=np.eye(4))
    with pytest.raises(ldls.CalibrationError, match="T_camera_lidar: R\\^T R deviates"):
        ldls.read_poses(path, stamps=STAMPS, T_camera_lidar=2 * np.eye(4))


LINE = "1.0 0 0 0 0 0 0 1\n"
KITTI_LINE = "1 0 0 0 0 1 0 0 0 0 1 0\n"


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        pytest.param("", ldls.TruncatedFileError, "no pose, expected 12", id="empty"),
        pytest.param("# stamp\n\n", ldls.TruncatedFileError, "no pose", id="comments alone"),
        pytest.param("1 2 3\n", ldls.UnsupportedFormatError, "line 1: 3 numbers, expected 12", id="another format"),
        pytest.param(KITTI_LINE[:-1] + " 0 0 0 1\n", ldls.UnsupportedFormatError,
                     "line 1: 16 numbers, expected 12 .*; leave out the last four of each line", id="16 numbers"),
        pytest.param("1,0,0,0,0,0,0,1\n", ldls.UnsupportedFormatError, "separated by blanks", id="commas"),
        pytest.param(LINE + "1.1 0 0 0 0 0 0\n" + LINE, ldls.CorruptFileError,
                     "line 2: expected at least 8 cells, got 7",
                     id="too few"),
        pytest.param(LINE + "1.1 0 0 0 0 0 0 1 5\n", ldls.CorruptFileError, "line 2: expected 8 cells, got 9",
                     id="too many"),
        pytest.param(LINE + "1.1 0 0 0 0 0", ldls.TruncatedFileError, "line 2: expected at least 8", id="cut line"),
        pytest.param(LINE + "1.1 0 0 0 0 0 0 1", ldls.TruncatedFileError, "digits may be missing", id="cut number"),
        pytest.param(LINE + "1.1 0 east 0 0 0 0 1\n", ldls.CorruptFileError, "line 2: expected a number .* 'east'",
                     id="word"),
        pytest.param("# a\n" + LINE + "1.1 0 nan 0 0 0 0 1\n", ldls.CorruptFileError, "line 3: expected finite",
                     id="nan"),
        pytest.param(LINE + "inf 0 0 0 0 0 0 1\n", ldls.CorruptFileError, "line 2: expected finite", id="inf"),
        pytest.param(LINE + "1.1 0 0 0 0 0 0.1 1\n", ldls.CorruptFileError, "line 2: quaternion .* length 1.00499",
                     id="no unit quaternion"),
        pytest.param(LINE + "1.1 0 0 0 0 0 0 0\n", ldls.CorruptFileError, "line 2: quaternion .* length 0", id="zeros"),
        pytest.param(LINE + "\n" + LINE, ldls.CorruptFileError, "line 3: stamp 1.000000 s after 1.000000 s in line 1",
                     id="twice"),
        pytest.param(LINE + "0.9 0 0 0 0 0 0 1\n", ldls.CorruptFileError, "line 2: stamp 0.9.* ascending",
                     id="backwards"),
        pytest.param(LINE + "1.1 0 30 0 0 0 0 1\n", ldls.PoseError, "from 1.000000 to 1.100000 s the lidar moves 30 m",
                     id="jump"),
        pytest.param("17e11" + LINE[3:] + "18e11" + LINE[3:], ldls.PoseError, "stamps: pose 1: got 18.*not milli",
                     id="milliseconds"),
        pytest.param(KITTI_LINE + "2" + KITTI_LINE[1:], ldls.CorruptFileError, r"line 2: R\^T R deviates by 3",
                     id="no rotation"),
        pytest.param(KITTI_LINE + "-1" + KITTI_LINE[1:], ldls.CorruptFileError, "line 2: the determinant", id="mirror"),
        pytest.param(KITTI_LINE + KITTI_LINE[:-3] + "\n", ldls.TruncatedFileError, "line 2: expected at least 12",
                     id="too few of KITTI"),
    ],
)  # fmt: skip
def test_broken_files_are_named_with_their_line(tmp_path, text, error, message):
    path = written(tmp_path, text)
    options = {"stamps": [0, 1], "T_camera_lidar": np.eye(4)} if KITTI_LINE in text else {}
    with pytest.raises(error, match=f"^{re.escape(str(path))}: .*{message}"):
        ldls.read_poses(path, **options)


def test_options_are_those_of_the_format(tmp_path):
    path = written(tmp_path, tum_text())
    with pytest.raises(ldls.ParameterError, match="stamps: no option of tum poses"):
        ldls.read_poses(path, stamps=STAMPS)
    with pytest.raises(ldls.ParameterError, match="format: got 'g2o', expected one of kitti, tum, kitti-raw"):
        ldls.read_poses(path, format="g2o")
    with pytest.raises(FileNotFoundError):
        ldls.read_poses(tmp_path / "nothing.txt")


# KITTI raw

T_LIDAR_IMU = transform(Rotation.from_euler("zyx", [1, -0.5, 0.2], degrees=True), [-0.8, 0.3, -0.8])


def oxts(folder):
    drive = folder / "day/drive"
    return layouts.oxts(drive, WAY, T_LIDAR_IMU, [f"2011-09-26 13:02:10.{k}00000000\n" for k in range(len(WAY))])


def test_oxts_lead_over_the_imu_to_the_lidar(tmp_path):
    trajectory = ldls.read_poses(oxts(tmp_path))
    assert trajectory.stamps - 1317042130 == pytest.approx([0, 0.1, 0.2, 0.3], abs=1e-6)
    np.testing.assert_allclose(np.linalg.inv(trajectory.poses[0]) @ trajectory.poses, WAY, atol=1e-4)
    np.testing.assert_allclose(trajectory.poses[0] @ T_LIDAR_IMU @ [0, 0, 0, 1], [0, 0, 0, 1], atol=1e-6)
    np.testing.assert_allclose(trajectory.poses[:, :3, :3], WAY[:, :3, :3], atol=1e-6)


def test_oxts_are_in_the_order_of_their_numbers(tmp_path):
    folder = oxts(tmp_path)
    lines = (folder / "timestamps.txt").read_text()
    (folder / "timestamps.txt").write_text("\n" * 8 + lines)
    expected = ldls.read_poses(oxts(tmp_path / "padded"))
    for number, file in enumerate(sorted((folder / "data").iterdir()), start=8):
        file.rename(folder / f"data/{number}.txt")
    np.testing.assert_array_equal(ldls.read_poses(folder).poses, expected.poses)


def test_oxts_without_a_stamp_are_left_out(tmp_path):
    folder = oxts(tmp_path)
    lines = (folder / "timestamps.txt").read_text().splitlines()
    lines[1] = ""
    (folder / "timestamps.txt").write_text("\n".join(lines))
    trajectory = ldls.read_poses(folder)
    np.testing.assert_allclose(trajectory.poses[1:, :3, :3], WAY[2:, :3, :3], atol=1e-6)


@pytest.mark.parametrize(
    ("file", "text", "error", "message"),
    [
        pytest.param("data/0000000001.txt", "1 2 3\n", ldls.TruncatedFileError,
                     "0000000001.txt: line 1: expected at least 30",
                     id="few numbers"),
        pytest.param("data/0000000001.txt", "", ldls.TruncatedFileError, "0000000001.txt: no pose", id="empty"),
        pytest.param("data/0000000001.txt", "49 8.4 x" + " 0" * 27, ldls.CorruptFileError, "0001.txt: line 1: .*'x'",
                     id="word"),
        pytest.param("data/0000000001.txt", "49 8.4 inf" + " 0" * 27 + "\n", ldls.CorruptFileError,
                     "line 1: expected fini",
                     id="inf"),
        pytest.param("data/0000000001.txt", "49 8.4 0 0.01 0 90" + " 0" * 24 + "\n", ldls.CorruptFileError,
                     "0000000001.txt: line 1: roll 0.01, pitch 0, yaw 90, expected radians", id="angles in degrees"),
        pytest.param("data/0000000001.txt", "90 8.4 0" + " 0" * 27 + "\n", ldls.CorruptFileError, "latitude 90",
                     id="pole"),
        pytest.param("data/0000000001.txt", ("49 8.4 0" + " 0" * 27 + "\n") * 2, ldls.CorruptFileError, "2 lines",
                     id="two lines"),
        pytest.param("data/0000000001.txt", "49.1 8.4 0" + " 0" * 27 + "\n", ldls.PoseError,
                     "oxts: poses: from .* moves 11",
                     id="jump"),
        pytest.param("timestamps.txt", "2011-09-26 13:02:10.0\n" * 4, ldls.CorruptFileError,
                     "timestamps.txt: line 2: stamp .* in line 1", id="stamps that stand still"),
        pytest.param("timestamps.txt", "2011-09-26 13:02:10.0\n", ldls.SourceError, "has 1 stamps", id="few stamps"),
        pytest.param("timestamps.txt", "\n\n\n\nx", ldls.CorruptFileError, "no stamp", id="blank stamps"),
        pytest.param("timestamps.txt", "noon\n" * 4, ldls.CorruptFileError, "line 1: expected a time", id="no times"),
        pytest.param("timestamps.txt", None, FileNotFoundError, "timestamps.txt", id="no stamps"),
        pytest.param("../../calib_imu_to_velo.txt", "R: 1 0 0 0 1 0 0 0 1\n", ldls.CalibrationError, "'T' missing",
                     id="half a calibration"),
        pytest.param("../../calib_imu_to_velo.txt", "R: 2 0 0 0 1 0 0 0 1\nT: 0 0 0\n", ldls.CalibrationError,
                     r"calib_imu_to_velo.txt: R\^T R", id="calibration that scales"),
        pytest.param("../../calib_imu_to_velo.txt", None, FileNotFoundError, "calib_imu_to_velo.txt",
                     id="no calibration"),
    ],
)  # fmt: skip
def test_broken_oxts_are_named(tmp_path, file, text, error, message):
    folder = oxts(tmp_path)
    (folder / file).unlink() if text is None else (folder / file).write_text(text)
    with pytest.raises(error, match=message):
        ldls.read_poses(folder)


def test_a_folder_without_oxts_is_refused(tmp_path):
    with pytest.raises(ldls.UnsupportedFormatError, match="expected KITTI's oxts with data"):
        ldls.read_poses(tmp_path)
