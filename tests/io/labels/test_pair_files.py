import pytest

from ldls.errors import InputError, ParameterError
from ldls.io.labels.label_formats import label_files, pair_files


def touch(folder, *names):
    folder.mkdir(exist_ok=True)
    for name in names:
        (folder / name).write_bytes(b"")
    return folder


def test_frames_are_paired_by_name(tmp_path):
    ours = touch(tmp_path / "ours", "2.npz", "1.npz", "1.label", "1.ply", "1.png", ".3.npz.part")
    theirs = touch(tmp_path / "theirs", "1.txt", "2.txt")
    frames, lacking = pair_files(ours, theirs, truth_format="annotations")
    assert [(f.name, f.prediction.name, f.truth.name) for f in frames] == [
        ("1", "1.npz", "1.txt"),
        ("2", "2.npz", "2.txt"),
    ]
    assert lacking == ()
    (frame,), _ = pair_files(ours, theirs, prediction_format="semantic-kitti", missing="skip")
    assert frame.prediction.name == "1.label"


def test_nuscenes_endings_belong_to_the_format(tmp_path):
    ours = touch(tmp_path / "ours", "token_panoptic.npz")
    theirs = touch(tmp_path / "theirs", "token_lidarseg.bin")
    (frame,), _ = pair_files(ours, theirs)
    assert frame.name == "token"


def test_frames_without_their_pair_are_listed(tmp_path):
    ours = touch(tmp_path / "ours", "1.npz", "2.npz")
    theirs = touch(tmp_path / "theirs", "2.label", *(f"{n}.label" for n in range(3, 15)))
    with pytest.raises(InputError, match="1 of .*ours have no truth; 10, 11, 12, 13, 14, 3, .* and 2 more of .*theirs"):
        pair_files(ours, theirs)
    frames, lacking = pair_files(ours, theirs, missing="skip")
    assert [frame.name for frame in frames] == ["2"]
    assert len(lacking) == 13


def test_nothing_in_common_is_an_error_even_when_skipping(tmp_path):
    ours, theirs = touch(tmp_path / "ours", "1.npz"), touch(tmp_path / "theirs", "2.label")
    with pytest.raises(InputError, match="frames without their pair"):
        pair_files(ours, theirs, missing="skip")


def test_two_files_are_one_frame(tmp_path):
    folder = touch(tmp_path / "a", "mine.npz", "yours.label", "odd.data")
    (frame,), lacking = pair_files(folder / "mine.npz", folder / "yours.label")
    assert (frame.name, frame.truth.name, lacking) == ("mine", "yours.label", ())
    assert label_files(folder / "odd.data", "ldls") == {"odd": folder / "odd.data"}


def test_folders_without_labels_and_wrong_options(tmp_path):
    empty = touch(tmp_path / "empty", "a.png")
    with pytest.raises(InputError, match="empty: holds no labels, expected files that end in .label"):
        label_files(empty, "semantic-kitti")
    with pytest.raises(FileNotFoundError):
        label_files(tmp_path / "none")
    with pytest.raises(ParameterError, match="missing: got 'x'"):
        pair_files(empty, empty, missing="x")
    with pytest.raises(ParameterError, match="format: got 'x'"):
        label_files(empty, "x")
