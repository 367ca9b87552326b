import shutil

import pytest

import ldls
from command import command
from ldls.io.labels.annotations import read_annotations

FRAMES = ("000000", "000001", "000002", "000003")


def test_real_frames(data_folder, tmp_path):
    training = data_folder / "kitti/training"
    outcome = command("annotate", training, tmp_path / "new/out")
    assert outcome.exit_code == 0, outcome.output
    for text in ("annotated", "Pedestrian", "points of ground under objects left them", "wrote 4 files"):
        assert text in outcome.output
    assert sorted(path.name for path in (tmp_path / "new/out").iterdir()) == [f"{name}.txt" for name in FRAMES]
    for name in FRAMES:
        found = read_annotations(tmp_path / f"new/out/{name}.txt")
        assert len(found) == len(ldls.read_points(training / f"velodyne/{name}.bin"))
    assert {"Car", "DontCare"} <= {*found.names}


def test_without_images_their_size_is_said_once(data_folder, tmp_path):
    training = tmp_path / "training"
    shutil.copytree(data_folder / "kitti/training", training, ignore=shutil.ignore_patterns("image_2"))
    outcome = command("annotate", training, tmp_path / "out")
    assert outcome.exit_code == 0, outcome.output
    (warning,) = outcome.stderr.strip().splitlines()
    assert "375 x 1242 (height x width) is assumed" in warning
    assert warning.endswith(f"put them into {training / 'image_2'}")
    of_frames = ["--points", training / "velodyne", "--calib", training / "calib"]
    outcome = command("evaluate", tmp_path / "out", training / "label_2", *of_frames)
    assert outcome.exit_code == 0, outcome.output
    (warning,) = outcome.stderr.strip().splitlines()
    assert warning.endswith("name their folder (--image)")


def test_files_that_are_there_are_kept(data_folder, tmp_path):
    words = ["annotate", data_folder / "kitti/training", tmp_path / "out"]
    assert "kept" not in command(*words).output
    made = (tmp_path / "out/000001.txt").read_bytes()
    (tmp_path / "out/000002.txt").write_text("edited\n")
    (tmp_path / "out/000001.txt").unlink()
    outcome = command(*words)
    assert outcome.exit_code == 0, outcome.output
    assert "wrote 1 files" in outcome.output
    assert "kept 3 that were there; delete them to make them anew" in outcome.output
    assert (tmp_path / "out/000001.txt").read_bytes() == made
    assert (tmp_path / "out/000002.txt").read_text() == "edited\n"
    outcome = command(*words)
    assert outcome.exit_code == 0, outcome.output
    assert "kept 4" in outcome.output
    assert "annotated" not in outcome.output


def test_annotations_are_truth_for_evaluate_and_score_full_against_their_boxes(data_folder, tmp_path):
    training = data_folder / "kitti/training"
    outcome = command("annotate", training, tmp_path / "out", "--no-clean")
    assert outcome.exit_code == 0, outcome.output
    assert "points of ground" not in outcome.output
    inputs = ["--points", training / "velodyne", "--calib", training / "calib", "--image", training / "image_2"]
    outcome = command("evaluate", tmp_path / "out", training / "label_2", *inputs, "--out", tmp_path / "tables")
    assert outcome.exit_code == 0, outcome.output
    rows = (tmp_path / "tables/semantic.csv").read_text().splitlines()
    assert [row.split(",")[3:] for row in rows[1:3]] == [["100.0"] * 3] * 2


@pytest.fixture
def broken(data_folder, tmp_path):
    training = data_folder / "kitti/training"
    for folder, ending in (("label_2", "txt"), ("velodyne", "bin"), ("calib", "txt")):
        (tmp_path / "training" / folder).mkdir(parents=True)
        shutil.copy(training / f"{folder}/000003.{ending}", tmp_path / "training" / folder)
    return tmp_path / "training"


def test_faults_are_one_line(broken, tmp_path):
    (broken / "label_2/000003.txt").write_text("Car 1 2 3\n")
    outcome = command("annotate", broken, tmp_path / "out")
    assert outcome.exit_code == 1
    assert "000003.txt, line 1: expected 15 fields" in outcome.stderr
    assert not any((tmp_path / "out").iterdir())
    outcome = command("annotate", tmp_path, tmp_path / "none")
    assert outcome.exit_code == 1
    assert "has no label_2/*.txt" in outcome.stderr
    assert not (tmp_path / "none").exists()


def test_without_images_the_usual_size_is_taken(broken, tmp_path):
    outcome = command("annotate", broken, tmp_path / "out")
    assert outcome.exit_code == 0, outcome.output
    (broken / "image_2").mkdir()
    (broken / "image_2/000003.png").write_bytes(b"PNG")
    outcome = command("annotate", broken, tmp_path / "other")
    assert outcome.exit_code == 1
    assert "000003.png: not a whole image" in outcome.stderr
