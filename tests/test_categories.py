import pytest

from ldls.categories import COCO_NAMES, CONTIGUOUS_IDS, category_ids, class_id
from ldls.errors import ParameterError


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        pytest.param({}, {}, id="no classes"),
        pytest.param({0: "person", 2: "car"}, {0: 1, 2: 3}, id="names of COCO"),
        pytest.param({0: "Car", 1: " Potted Plant"}, {0: 3, 1: 64}, id="capitals and spaces"),
        pytest.param({0: "traffic_light", 1: "traffic  light"}, {0: 10, 1: 10}, id="_ and blanks"),
        pytest.param({0: "cone", 1: "dog", 7: "drone"}, {0: 100, 1: 18, 7: 107}, id="names of its own"),
        pytest.param(
            dict(enumerate(COCO_NAMES.values())), dict(enumerate(CONTIGUOUS_IDS)), id="COCO's 80 classes without gaps"
        ),
    ],
)
def test_category_ids_of_classes(names, expected):
    ids, kept = category_ids(names)
    assert ids == expected
    assert kept == {ids[index]: COCO_NAMES.get(ids[index], name) for index, name in names.items()}


def test_own_ids_never_meet_those_of_coco():
    assert not set(category_ids({i: f"thing {i}" for i in range(200)})[0].values()) & set(COCO_NAMES)


@pytest.mark.parametrize(
    ("classes", "expected"),
    [
        pytest.param([(3, "car"), (1, "person"), (3, "car")], [3, 1, 3], id="one numbering"),
        pytest.param([(1, "car"), (2, "Car ")], [1, 1], id="one name of two numbers"),
        pytest.param([(100, "road sign"), (101, "road_sign")], [100, 100], id="one name with _ and a blank"),
        pytest.param([(100, "cone"), (100, "sign"), (101, "cone")], [100, 101, 100], id="two names of one number"),
        pytest.param([(100, "cone"), (100, "sign"), (101, "drum")], [100, 101, 102], id="a number that was given"),
        pytest.param([(2**31 - 1, "cone"), (2**31 - 1, "sign")], [2**31 - 1, 100], id="the greatest number"),
    ],
)
def test_a_class_has_one_id_whatever_each_table_calls_it(classes, expected):
    known = {}
    assert [class_id(category, name, known) for category, name in classes] == expected
    assert set(known) == set(expected)
    assert [class_id(category, name, known) for category, name in classes] == expected


def test_negative_class():
    with pytest.raises(ParameterError, match="class -1 is negative"):
        category_ids({-1: "cone"})
