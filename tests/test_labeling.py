import numpy as np
import pytest

from evaluation.samples import NAMES, labeling
from ldls.errors import DtypeError, InputError, ShapeError
from ldls.evaluation import ClassSet, Labeling


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        pytest.param({"classes": [0, 3]}, InputError, "classes: got 0 to 3, expected 0 to 2", id="class too high"),
        pytest.param({"classes": [0, -1]}, InputError, "classes: got -1 to 0", id="class below 0"),
        pytest.param({"instances": [0, -1]}, InputError, "instances: got -1 to 0", id="instance below 0"),
        pytest.param({"instances": [0, 2**31]}, InputError, "expected 0 to 2147483647", id="instance too high"),
        pytest.param({"classes": [0.0, 1.0]}, DtypeError, "classes: expected whole numbers", id="float classes"),
        pytest.param({"ignored": [0, 1]}, DtypeError, "ignored: expected bool, got int64", id="ignored numbers"),
        pytest.param({"instances": [0]}, ShapeError, r"instances: expected shape \(2,\), got \(1,\)", id="length"),
        pytest.param(
            {"classes": [[0], [1]]}, ShapeError, r"classes: expected shape \(2,\), got \(2, 1\)", id="two axes"
        ),
        pytest.param({"names": ("Car", "background", "x")}, InputError, "'background' first", id="no background"),
        pytest.param({"names": ("background", "Car", "Car")}, InputError, "every name once", id="double name"),
    ],
)
def test_contradictions_are_refused(change, error, message):
    fields = {"classes": [0, 1], "instances": [0, 1], "ignored": [False, True], "names": NAMES} | change
    fields = {key: value if key == "names" else np.array(value) for key, value in fields.items()}
    with pytest.raises(error, match=message):
        Labeling(**fields)


def test_it_holds_int32_and_counts_what_is_not_ignored():
    found = labeling([0, 1, 1, 2], [0, 1, 1, 1], ignored=[2])
    assert found.classes.dtype == found.instances.dtype == np.int32
    assert found.counts() == {"background": 1, "Car": 1, "Pedestrian": 1}
    assert repr(found) == "Labeling(4 points, 1 ignored, classes ['Car', 'Pedestrian'])"


def test_restricted_ignores_the_others_too():
    found = labeling([0, 1, 1], ignored=[0]).restricted(np.array([True, True, False]))
    assert found.ignored.tolist() == [True, False, True]
    with pytest.raises(ShapeError, match=r"keep: expected shape \(3,\)"):
        found.restricted(np.array([True]))
    with pytest.raises(DtypeError, match="keep: expected bool"):
        found.restricted(np.array([0, 1, 1]))


def test_mapping_truth_ignores_left_out_names_and_predictions_make_them_background():
    names = ("background", "Car", "Van", "Person_sitting", "Truck")
    source = labeling([0, 1, 2, 3, 4], [0, 1, 2, 3, 4], names=names)
    truth, prediction = ClassSet.kitti().map(source, truth=True), ClassSet.kitti().map(source)
    for mapped in (truth, prediction):
        assert mapped.names == NAMES
        assert mapped.classes.tolist() == [0, 1, 0, 2, 0]
        assert mapped.instances.tolist() == [0, 1, 0, 3, 0]
    assert truth.ignored.tolist() == [False, False, True, False, False]
    assert not prediction.ignored.any()


def test_instances_of_merged_classes_stay_apart():
    names = ("background", "Pedestrian", "Person_sitting")
    mapped = ClassSet.kitti().map(labeling([1, 1, 2, 2, 1], [1, 1, 1, 2, 0], names=names))
    assert mapped.classes.tolist() == [2] * 5
    walking, also_walking, sitting, other, none = mapped.instances.tolist()
    assert walking == also_walking
    assert len({walking, sitting, other, none}) == 4
    assert none == 0


def test_unknown_names_are_an_error_in_truth_and_background_in_predictions():
    source = labeling([0, 1], names=("background", "gnome"))
    with pytest.raises(InputError, match="points of \\['gnome'\\].*aliases, left_out or background"):
        ClassSet.kitti().map(source, truth=True)
    assert ClassSet.kitti().map(source).classes.tolist() == [0, 0]
    unseen = labeling([0, 0], names=("background", "gnome"))
    assert ClassSet.kitti().map(unseen, truth=True).classes.tolist() == [0, 0]
    known = ClassSet(names=("Car",), background=("gnome",))
    assert known.map(source, truth=True).classes.tolist() == [0, 0]


def test_a_mapped_labeling_maps_onto_itself():
    source = labeling([0, 1, 2, 1], [0, 4, 4, 2], ignored=[3])
    again = ClassSet.kitti().map(ClassSet.kitti().map(source, truth=True), truth=True)
    for name in ("classes", "instances", "ignored"):
        np.testing.assert_array_equal(getattr(again, name), getattr(source, name))


def test_codes_without_a_name_are_named_by_point():
    assert Labeling.from_codes(np.array([10, 0]), {0: "unlabeled", 10: "car"}).names[1:] == ("unlabeled", "car")
    for wrong in (9, 11, 65535, -1, 0.5, np.nan):
        with pytest.raises(InputError, match=f"point 1 has class {wrong}, expected one of 0, 10"):
            Labeling.from_codes(np.array([10, wrong]), {0: "unlabeled", 10: "car"})
