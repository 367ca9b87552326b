import numpy as np
import pytest
from PIL import Image

from ldls.cli.label_pairs import Counting, FrameFolders, read_pairs
from ldls.errors import InputError, LdlsWarning, ShapeError
from ldls.io.labels.label_formats import LabelFile, LabelFiles, pair_files

CALIB = """P0: 1 0 0 0 0 1 0 0 0 0 1 0
P2: 100 0 50 0 0 100 40 0 0 0 1 0
R0_rect: 1 0 0 0 1 0 0 0 1
Tr_velo_to_cam: 1 0 0 0 0 1 0 0 0 0 1 0
"""
POINTS = np.array([[1.5, 1.0, 20.0, 0.5], [5.0, 0.0, 20.0, 0.1], [30.0, 0.0, 20.0, 0.1]], np.float32)


@pytest.fixture
def boxes(tmp_path):
    for folder in ("mine", "label_2", "velodyne", "calib", "image_2"):
        (tmp_path / folder).mkdir()
    (tmp_path / "label_2/7.txt").write_text("Car 0 0 0 0 0 9 9 1.5 1.6 4.0 1.0 1.5 20.0 0\n")
    (tmp_path / "calib/7.txt").write_text(CALIB)
    (tmp_path / "velodyne/7.bin").write_bytes(POINTS.tobytes())
    (tmp_path / "mine/7.txt").write_text("1 Car\n0 background\n0 background\n")
    Image.new("RGB", (100, 80)).save(tmp_path / "image_2/7.png")
    return tmp_path


def read(folder, **inputs):
    frames, _ = pair_files(folder / "mine", folder / "label_2")
    (pair,) = read_pairs(frames, counting(FrameFolders(**{k: folder / v for k, v in inputs.items()})))
    return pair


def counting(folders):
    """All points count but those that the truth leaves out."""
    return Counting({}, folders)


def test_boxes_take_points_calibration_and_the_size_of_the_image(boxes):
    pair = read(boxes, points="velodyne", calib="calib", image="image_2")
    assert pair.truth.names[pair.truth.classes[0]] == "Car"
    np.testing.assert_allclose(pair.ranges_m, np.linalg.norm(POINTS[:, :3], axis=1), rtol=1e-6)
    assert pair.truth.ignored.tolist() == [False, False, True]
    # KITTI's usual image is wide enough for the third point
    with pytest.warns(LdlsWarning, match=r"375 x 1242 \(height x width\) is assumed.*; name their folder \(--image\)"):
        assert not read(boxes, points="velodyne", calib="calib").truth.ignored.any()


@pytest.mark.parametrize("ending", [".csv", ".txt", ".xyz", ".pcd.bin", ".NPY"])
def test_points_may_be_of_any_format_that_is_read(boxes, ending):
    (boxes / "velodyne/7.bin").unlink()
    path = boxes / f"velodyne/7{ending}"
    if ending == ".NPY":
        with path.open("wb") as file:
            np.save(file, POINTS)
    elif ending == ".pcd.bin":
        np.hstack([POINTS, np.zeros((3, 1), np.float32)]).tofile(path)
    else:
        np.savetxt(path, POINTS, delimiter="," if ending == ".csv" else " ")
    pair = read(boxes, points="velodyne", calib="calib", image="image_2")
    np.testing.assert_allclose(pair.ranges_m, np.linalg.norm(POINTS[:, :3], axis=1), rtol=1e-6)
    assert FrameFolders(points=boxes / "velodyne").files("7") == [path]


@pytest.mark.parametrize("suffix", [".jpg", ".jpeg", ".PNG"])
def test_images_may_be_jpeg(boxes, suffix):
    (boxes / "image_2/7.png").unlink()
    Image.new("RGB", (100, 80)).save(boxes / f"image_2/7{suffix}")
    pair = read(boxes, points="velodyne", calib="calib", image="image_2")
    assert pair.truth.ignored.tolist() == [False, False, True]


def test_a_frame_without_an_image_in_the_folder_of_images_is_named(boxes):
    (boxes / "image_2/7.png").rename(boxes / "image_2/8.png")
    with pytest.raises(InputError, match=r"frame 7: has no image in .*image_2, expected 7 with \.png, \.jpg, \.jpeg"):
        read(boxes, points="velodyne", calib="calib", image="image_2")


def test_what_boxes_need_is_named(boxes):
    with pytest.raises(InputError, match="frame 7: needs its points; .*--points"):
        read(boxes)
    with pytest.raises(InputError, match="frame 7: needs its calibration; .*--calib"):
        read(boxes, points="velodyne")
    with pytest.raises(FileNotFoundError, match=r"image_2.7\.bin"):
        read(boxes, points="image_2", calib="calib")
    (boxes / "mine/7.txt").write_text("1 Car\n")
    with pytest.raises(ShapeError, match="frame 7: prediction has 1 points, truth 3"):
        read(boxes, points="velodyne", calib="calib", image="image_2")


def test_squeezeseg_brings_its_ranges(tmp_path):
    image = np.zeros((64, 512, 6))
    image[0, 0, 4:] = 12.5, 1
    np.save(tmp_path / "truth.npy", image)
    np.save(tmp_path / "mine.npy", image[:, :, 5].astype(np.uint8))
    mine, truth = (LabelFile(tmp_path / f"{side}.npy", "squeezeseg") for side in ("mine", "truth"))
    (pair,) = read_pairs([LabelFiles("a", mine, truth)], counting(FrameFolders()))
    assert pair.ranges_m[:2].tolist() == [12.5, 0]
    (pair,) = read_pairs([LabelFiles("a", mine, mine)], counting(FrameFolders()))
    assert pair.ranges_m is None
