import pytest

from ldls.errors import InputError, ParameterError, UnsupportedFormatError
from ldls.io.labels.label_formats import LabelFile, label_files, pair_files


def touch(folder, *names):
    folder.mkdir(exist_ok=True)
    for name in names:
        (folder / name).write_bytes(b"")
    return folder


def test_frames_are_paired_by_name(tmp_path):
    ours = touch(tmp_path / "ours", "2.npz", "1.npz", "1.label", "1.ply", "1.png", ".3.npz.part")
    theirs = touch(tmp_path / "theirs", "1.txt", "2.txt")
    frames, lacking = pair_files(ours, theirs, truth_format="annotations")
    assert [(f.name, f.prediction.path.name, f.truth.path.name) for f in frames] == [
        ("1", "1.npz", "1.txt"),
        ("2", "2.npz", "2.txt"),
    ]
    assert lacking == ()
    (frame,), _ = pair_files(ours, theirs, prediction_format="label", truth_format="annotations", missing="skip")
    assert frame.prediction == LabelFile(ours / "1.label", "label")


def test_frames_are_in_the_order_of_their_numbers(tmp_path):
    names = [str(number) for number in range(12)]
    ours = touch(tmp_path / "ours", *(f"{name}.npz" for name in names))
    theirs = touch(tmp_path / "theirs", *(f"{name}.label" for name in names if name not in ("2", "10")))
    frames, lacking = pair_files(ours, theirs, missing="skip")
    assert [frame.name for frame in frames] == [name for name in names if name not in ("2", "10")]
    assert lacking == ("2", "10")


def test_nuscenes_endings_belong_to_the_format(tmp_path):
    ours = touch(tmp_path / "ours", "token_panoptic.npz")
    theirs = touch(tmp_path / "theirs", "token_lidarseg.bin")
    (frame,), _ = pair_files(ours, theirs)
    assert frame.name == "token"


def test_of_a_frame_in_several_formats_the_one_that_knows_most_is_read(tmp_path):
    names = ["a.npz", "a_panoptic.npz", "a.label", "a_lidarseg.bin"]
    for at, best in enumerate(["npz", "panoptic", "label", "lidarseg"]):
        folder = touch(tmp_path / best, *names[at:])
        assert label_files(folder) == {"a": LabelFile(folder / names[at], best)}


def test_endings_may_be_capitals(tmp_path):
    ours = touch(tmp_path / "ours", "Σ.NPZ", "B_PANOPTIC.npz")
    theirs = touch(tmp_path / "theirs", "Σ.LABEL", "B_Lidarseg.bin")
    frames, _ = pair_files(ours, theirs)
    assert [(frame.name, frame.prediction.format, frame.truth.format) for frame in frames] == [
        ("B", "panoptic", "lidarseg"),
        ("Σ", "npz", "label"),
    ]
    assert label_files(ours / "Σ.NPZ") == {"Σ": LabelFile(ours / "Σ.NPZ", "npz")}


def test_frames_without_their_pair_are_listed(tmp_path):
    ours = touch(tmp_path / "ours", "1.npz", "2.npz")
    theirs = touch(tmp_path / "theirs", "2.label", *(f"{n}.label" for n in range(3, 15)))
    with pytest.raises(InputError, match="1 of .*ours have no truth; 3, 4, 5, 6, 7, 8, .* and 2 more of .*theirs"):
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
    assert (frame.name, frame.truth.path.name, lacking) == ("mine", "yours.label", ())
    assert label_files(folder / "odd.data", "npz") == {"odd": LabelFile(folder / "odd.data", "npz")}


def test_folders_without_labels_and_wrong_options(tmp_path):
    empty = touch(tmp_path / "empty", "a.png")
    with pytest.raises(InputError, match="empty: holds no labels, expected files that end in .label"):
        label_files(empty, "label")
    touch(empty / "annotations", "a.txt")
    with pytest.raises(InputError, match=r"holds no labels, .*; perhaps .*empty/annotations\?$"):
        label_files(empty)
    with pytest.raises(FileNotFoundError):
        label_files(tmp_path / "none")
    with pytest.raises(ParameterError, match="missing: got 'x'"):
        pair_files(empty, empty, missing="x")
    with pytest.raises(ParameterError, match="format: got 'x'"):
        label_files(empty, "x")


BOX = "Car -1 3 0 1 2 3 4 1.5 1.6 4 1 1.5 20 0 0.9\n"


@pytest.mark.parametrize(
    ("contents", "format"),
    [
        pytest.param(["0 background\n3 Car\n"], "annotations", id="annotations"),
        pytest.param(["-1 potted plant\n"], "annotations", id="no instance, two words"),
        pytest.param([BOX], "kitti-boxes", id="16 fields"),
        pytest.param([BOX.rsplit(" ", 1)[0]], "kitti-boxes", id="15 fields"),
        pytest.param([BOX.replace("Car", "1")], "kitti-boxes", id="a class that is a number"),
        pytest.param(["", "\n", BOX], "kitti-boxes", id="frames without objects first"),
    ],
)
def test_first_lines_tell_which_format_a_folder_of_text_has(tmp_path, contents, format):
    for number, content in enumerate(contents):
        (tmp_path / f"{number}.txt").write_text(content)
    files = label_files(tmp_path)
    assert files == {f"{number}": LabelFile(tmp_path / f"{number}.txt", format) for number in range(len(contents))}


def test_notes_beside_labels_are_no_labels(tmp_path):
    folder = touch(tmp_path / "a", "1.npz", "2.label")
    (folder / "README.txt").write_text("how these were made")
    assert {name: file.format for name, file in label_files(folder).items()} == {"1": "npz", "2": "label"}
    (folder / "1.npz").unlink()
    (folder / "2.label").unlink()
    with pytest.raises(UnsupportedFormatError, match=r"README\.txt: may be kitti-boxes or annotations; say which"):
        label_files(folder)
