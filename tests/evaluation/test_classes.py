import numpy as np
import pytest

from ldls.errors import ParameterError
from ldls.evaluation import ClassSet
from ldls.io.labels.nuscenes_labels import NUSCENES
from ldls.io.labels.semantic_kitti import SEMANTIC_KITTI
from ldls.labeling import Labeling


@pytest.mark.parametrize(
    ("name", "index"),
    [
        pytest.param("Car", 1, id="KITTI car"),
        pytest.param("car", 1, id="COCO and SemanticKITTI car"),
        pytest.param("moving-car", 1, id="moving car"),
        pytest.param("vehicle.car", 1, id="nuScenes car"),
        pytest.param("person", 2, id="COCO person"),
        pytest.param("pedestrian", 2, id="SqueezeSeg pedestrian"),
        pytest.param("human.pedestrian.wheelchair", 2, id="nuScenes pedestrian"),
        pytest.param("Person_sitting", 2, id="sitting"),
        pytest.param("CAR", 1, id="capitals"),
        pytest.param(" Person", 2, id="a capital and a blank"),
        pytest.param("MOVING-CAR", 1, id="capitals of a synonym"),
        pytest.param("truck", 0, id="another class"),
        pytest.param("Van", 0, id="left out"),
        pytest.param("gnome", 0, id="unknown"),
    ],
)
def test_names_of_all_vocabularies_find_their_class(name, index):
    assert ClassSet.kitti().index(name) == index


@pytest.mark.parametrize("moving", [name for name in SEMANTIC_KITTI.values() if name.startswith("moving-")])
def test_what_moves_is_of_the_class_of_what_stands(moving):
    standing = moving.removeprefix("moving-")
    assert standing in SEMANTIC_KITTI.values()
    assert ClassSet.kitti((standing,)).index(moving) == ClassSet.kitti((moving,)).index(standing) == 1


def test_who_sits_can_stand_apart():
    apart = ClassSet.kitti(merge_sitting=False)
    assert apart.index("Person_sitting") == 0
    assert "Person_sitting" in apart.left_out
    scored = ClassSet.kitti(("Person_sitting", "Pedestrian"), merge_sitting=False)
    assert scored.index("Person_sitting") == 1
    assert scored.left_out.count("Person_sitting") == 0


def test_what_is_left_out_is_an_option_and_scored_classes_are_not_left_out():
    assert {"Van", "Cyclist", "bicyclist", "DontCare", "unlabeled"} <= {*ClassSet.kitti().left_out}
    kept = ClassSet.kitti(leave_out=())
    assert "Van" in kept.background
    assert "unlabeled" in kept.left_out
    scored = ClassSet.kitti(("Car", "Cyclist"))
    assert scored.index("cyclist") == 2
    assert "Cyclist" not in scored.left_out
    assert "traffic light" in scored.background


def test_own_classes_take_part():
    assert not ClassSet.kitti().knows("gnome")
    assert ClassSet.kitti(background=("gnome",)).knows("gnome")
    found = ClassSet.kitti(("gnome", "bicycle"))
    assert found.index("gnome") == 1
    assert found.index("vehicle.bicycle") == 2


def test_capitals_do_not_count():
    scored = ClassSet.kitti(("CAR", "person"), leave_out=("van",), background=("Gnome",))
    assert scored.names == ("CAR", "person")
    assert [scored.index(name) for name in ("car", "Car", "vehicle.Car", "Pedestrian")] == [1, 1, 1, 2]
    assert scored.knows("gnome") and scored.knows("Background") and "Van" not in scored.background
    truth = Labeling.from_instance_labels(np.array([0, 1, 2, 3, 4]), ["Van", "car", "Traffic Light", "NOISE"])
    mapped = scored.map(truth, truth=True)
    assert mapped.ignored.tolist() == [False, True, False, False, True]
    assert mapped.classes.tolist() == [0, 0, 1, 0, 0]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        pytest.param(lambda: ClassSet(names=()), "expected one or more", id="none"),
        pytest.param(lambda: ClassSet(names=("Car", "Car")), "different classes", id="twice"),
        pytest.param(lambda: ClassSet(names=("Car", "car")), "different classes", id="twice but for a capital"),
        pytest.param(lambda: ClassSet(names=("background",)), "without background", id="background"),
        pytest.param(lambda: ClassSet(names=("Background",)), "without background", id="background in capitals"),
        pytest.param(lambda: ClassSet(names=("Car",), aliases={"a": "Bus"}), "'a' stands for 'Bus'", id="alias"),
        pytest.param(lambda: ClassSet(names=("Car",), left_out=("Car",)), "scored too", id="scored and left out"),
        pytest.param(lambda: ClassSet.kitti(leave_out=("Car",)), "scored too", id="leave out what is scored"),
        pytest.param(lambda: ClassSet.kitti(leave_out=("car",)), "scored too", id="leave out what has a capital"),
        pytest.param(
            lambda: ClassSet.kitti(leave_out=("vehicle.car",)), r"\['vehicle.car'\] are sc", id="leave a synonym out"
        ),
        pytest.param(
            lambda: ClassSet.kitti(background=("car", "gnome")),
            r"background: \['car'\] are scored too; .* or have it as background",
            id="background of what is scored",
        ),
        pytest.param(lambda: ClassSet.kitti(leave_out=("Person_sitting",)), "scored too", id="leave out who is merged"),
        pytest.param(
            lambda: ClassSet.kitti(("Truck", "Car", "vehicle.car")),
            "'Car' and 'vehicle.car' are one class",
            id="synonyms",
        ),
        pytest.param(lambda: ClassSet.kitti(leave_out=("Vann",)), "no data set has \\['Vann'\\]", id="typing error"),
    ],
)
def test_contradictions_are_refused(make, message):
    with pytest.raises(ParameterError, match=message):
        make()


OF_CHALLENGE = (0, 0, 7, 7, 7, 0, 7, 0, 0, 1, 0, 0, 8, 0, 2, 3, 3, 4, 5, 0, 0, 6, 9, 10, 11, 12, 13, 14, 15, 0, 16, 0)
"""Class of nuScenes' lidarseg challenge of each of the 32 general ones; 0 does not count."""


def test_the_classes_of_nuscenes_are_those_of_its_challenge():
    truth = Labeling.from_codes(np.arange(32), NUSCENES)
    mapped = ClassSet.nuscenes().map(truth, truth=True)
    assert mapped.classes.tolist() == list(OF_CHALLENGE)
    assert mapped.ignored.tolist() == [number == 0 for number in OF_CHALLENGE]
    assert mapped.names[:3] == ("background", "barrier", "bicycle") and len(mapped.names) == 17


@pytest.mark.parametrize(
    ("name", "index"),
    [
        pytest.param("person", 7, id="COCO person"),
        pytest.param("Car", 4, id="KITTI car"),
        pytest.param("pedestrian", 7, id="as in the challenge"),
        pytest.param("human.pedestrian.stroller", 0, id="not as in KITTI"),
        pytest.param("train", 0, id="another class"),
    ],
)
def test_predictions_of_nuscenes_may_have_names_of_others(name, index):
    assert ClassSet.nuscenes().index(name) == index
