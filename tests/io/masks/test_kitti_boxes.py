import numpy as np
import pytest

import ldls

REST = "1.67 1.87 3.69 -16.53 2.39 58.49 1.57"
LINES = f"""Car 0.00 0 1.85 2.2 1.0 5.9 3.0 {REST}
Person_sitting 0.00 0 1.85 -9 -9 1 1 {REST} 0.25
DontCare -1 -1 -10 0 0 9 9 -1 -1 -1 -1000 -1000 -1000 -10
Van 0.00 0 1.85 0 0 900 900 {REST}
"""


def boxes(tmp_path, text=LINES, **options):
    (tmp_path / "000007.txt").write_text(text)
    return ldls.read_masks(tmp_path / "000007.txt", **options)


def test_boxes_become_rectangles(tmp_path):
    masks = boxes(tmp_path, image_size=(6, 10))
    assert [(mask.category, mask.name, mask.score) for mask in masks] == [
        (3, "car", 1.0),
        (1, "person", 0.25),
        (101, "Van", 1.0),
    ]
    expected = np.zeros((3, 6, 10), bool)
    expected[0, 1:4, 3:6] = True
    expected[1, :2, :2] = True
    expected[2] = True
    np.testing.assert_array_equal(masks.to_array(), expected)


@pytest.mark.parametrize(
    ("kitti", "category", "name"),
    [
        ("Car", 3, "car"),
        ("Pedestrian", 1, "person"),
        ("Person_sitting", 1, "person"),
        ("Truck", 8, "truck"),
        ("Tram", 7, "train"),
        ("Van", 101, "Van"),
        ("Cyclist", 102, "Cyclist"),
        ("Misc", 103, "Misc"),
        ("PERSON_SITTING", 1, "person"),
        ("cyclist", 102, "Cyclist"),
        ("Traffic_Light", 10, "traffic light"),
    ],
)
def test_classes_of_kitti_have_categories(tmp_path, kitti, category, name):
    (mask,) = boxes(tmp_path, f"{kitti} 0 0 0 0 0 5 5 {REST}\n", image_size=(6, 10))
    assert (mask.category, mask.name) == (category, name)


def test_an_empty_file_has_no_masks(tmp_path):
    assert len(boxes(tmp_path, "", image_size=(6, 10))) == 0


@pytest.mark.parametrize(
    ("text", "options", "error", "message"),
    [
        pytest.param(LINES, {}, ldls.MaskError, "give its image_size=", id="no size"),
        pytest.param(
            f"Crane 0 0 0 0 0 5 5 {REST}",
            {"image_size": (6, 10)},
            ldls.MaskError,
            "box 0: class 'Crane' is none of Pedestrian, .*names={104: 'Crane'}",
            id="unknown class",
        ),
        pytest.param(
            f"Car 0 0 0 5 0 0 5 {REST}", {"image_size": (6, 10)}, ldls.MaskError, "box 0: .*left <= right", id="turned"
        ),
        pytest.param(
            f"Car 0 0 0 0 0 5 5 {REST} 7", {"image_size": (6, 10)}, ldls.MaskError, "box 0: score is 7", id="score 7"
        ),
        pytest.param("Car 0 0", {"image_size": (6, 10)}, ldls.TruncatedFileError, "line 1: exp", id="short line"),
    ],
)
def test_faults_of_boxes_are_named(tmp_path, text, options, error, message):
    with pytest.raises(error, match=message) as caught:
        boxes(tmp_path, text, **options)
    assert str(caught.value).count("000007.txt") == 1


def test_classes_of_ones_own_get_ids(tmp_path):
    masks = boxes(tmp_path, f"Crane 0 0 0 0 0 5 5 {REST}", image_size=(6, 10), names={104: "Crane"})
    assert (masks[0].category, masks[0].name) == (104, "Crane")
    masks = boxes(tmp_path, f"crane 0 0 0 0 0 5 5 {REST}", image_size=(6, 10), names={104: "Crane"})
    assert (masks[0].category, masks[0].name) == (104, "Crane")


def test_classes_of_kitti_keep_off_the_ids_of_ones_own(tmp_path):
    lines = "".join(f"{name} 0 0 0 0 0 5 5 {REST}\n" for name in ("Van", "Car", "Cyclist"))
    masks = boxes(tmp_path, lines, image_size=(6, 10), names={101: "Crane", 3: "Lorry", 7: "Cyclist"})
    assert [(mask.category, mask.name) for mask in masks] == [(103, "Van"), (100, "car"), (7, "Cyclist")]
    assert masks.names[101] == "Crane" and masks.names[3] == "Lorry"


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        pytest.param({1: "Car", 2: "Pedestrian"}, [(1, "Car"), (2, "Pedestrian")], id="both"),
        pytest.param({2: "Pedestrian", 1: "Car"}, [(1, "Car"), (2, "Pedestrian")], id="in another order"),
        pytest.param({5: "CAR", 7: "person"}, [(5, "CAR"), (7, "person")], id="COCO's"),
        pytest.param({0: "Car", 1: "Pedestrian"}, [(3, "car"), (1, "Pedestrian")], id="0 is passed over"),
    ],
)
def test_names_of_ones_own_are_those_of_classes_of_kitti(tmp_path, names, expected):
    lines = "".join(f"{name} 0 0 0 0 0 5 5 {REST}\n" for name in ("Car", "Pedestrian"))
    masks = boxes(tmp_path, lines, image_size=(6, 10), names=names)
    assert [(mask.category, mask.name) for mask in masks] == expected
