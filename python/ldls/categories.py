"""COCO's categories, by the ids of its 91-entry list, and what other data sets call the same classes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import count

from ldls.checks import did_you_mean
from ldls.errors import ParameterError

COCO_NAMES: dict[int, str] = {
    1: "person", 2: "bicycle", 3: "car", 4: "motorcycle", 5: "airplane", 6: "bus", 7: "train",
    8: "truck", 9: "boat", 10: "traffic light", 11: "fire hydrant", 13: "stop sign",
    14: "parking meter", 15: "bench", 16: "bird", 17: "cat", 18: "dog", 19: "horse", 20: "sheep",
    21: "cow", 22: "elephant", 23: "bear", 24: "zebra", 25: "giraffe", 27: "backpack",
    28: "umbrella", 31: "handbag", 32: "tie", 33: "suitcase", 34: "frisbee", 35: "skis",
    36: "snowboard", 37: "sports ball", 38: "kite", 39: "baseball bat", 40: "baseball glove",
    41: "skateboard", 42: "surfboard", 43: "tennis racket", 44: "bottle", 46: "wine glass",
    47: "cup", 48: "fork", 49: "knife", 50: "spoon", 51: "bowl", 52: "banana", 53: "apple",
    54: "sandwich", 55: "orange", 56: "broccoli", 57: "carrot", 58: "hot dog", 59: "pizza",
    60: "donut", 61: "cake", 62: "chair", 63: "couch", 64: "potted plant", 65: "bed",
    67: "dining table", 70: "toilet", 72: "tv", 73: "laptop", 74: "mouse", 75: "remote",
    76: "keyboard", 77: "cell phone", 78: "microwave", 79: "oven", 80: "toaster", 81: "sink",
    82: "refrigerator", 84: "book", 85: "clock", 86: "vase", 87: "scissors", 88: "teddy bear",
    89: "hair drier", 90: "toothbrush",
}  # fmt: skip

CONTIGUOUS_IDS: tuple[int, ...] = tuple(COCO_NAMES)
"""COCO id of the class at each position: networks number the 80 classes without gaps, Matterport's from 1."""

FIRST_OTHER_ID = 100
"""Category id of class 0 of another program where COCO has no class of its name."""
_COCO_IDS = {name: category for category, name in COCO_NAMES.items()}

SYNONYMS: tuple[tuple[str, ...], ...] = (
    ("Car", "moving-car", "vehicle.car"),
    ("Pedestrian", "person", "moving-person", "human.pedestrian.adult", "human.pedestrian.child",
     "human.pedestrian.construction_worker", "human.pedestrian.personal_mobility", "human.pedestrian.police_officer",
     "human.pedestrian.stroller", "human.pedestrian.wheelchair"),
    ("Cyclist", "bicyclist", "moving-bicyclist"),
    ("Truck", "moving-truck", "vehicle.truck"),
    ("Tram", "train", "on-rails", "moving-on-rails"),
    ("bicycle", "vehicle.bicycle"),
    ("motorcycle", "vehicle.motorcycle"),
    ("motorcyclist", "moving-motorcyclist"),
    ("bus", "moving-bus", "vehicle.bus.rigid", "vehicle.bus.bendy"),
    ("other-vehicle", "moving-other-vehicle"),
)  # fmt: skip
"""Names of one class in KITTI, COCO, SqueezeSeg, SemanticKITTI and nuScenes; the usual one of several first."""


def folded(name: str) -> str:
    """What names of classes are compared by: `name` without capitals and outer blanks, and with a blank for `_`."""
    # KITTI's files, whose fields blanks separate, hold traffic_light
    return " ".join(name.lower().replace("_", " ").split())


NO_OBJECTS = frozenset(map(folded, ("background", "_background_", "__background__", "__ignore__")))
"""What results, labelme and networks call what is no object, folded."""

_GROUPS = {folded(name): group for group in SYNONYMS for name in group}


def category_ids(names: Mapping[int, str]) -> tuple[dict[int, int], dict[int, str]]:
    """Category id of each class index of another program, and the name of each such id.

    A class with the name of one of COCO's, whatever its capitals, gets COCO's id and name; any other gets 100 + its
    index. COCO's ids end at 90, so the two never meet.

    Args:
        names: Name of each class by its index, from 0.

    Raises:
        ParameterError: A negative index.
    """
    wrong = [index for index in names if index < 0]
    if wrong:
        raise ParameterError(f"names: class {wrong[0]} is negative, expected 0 or more")
    ids = {index: _COCO_IDS.get(folded(name), FIRST_OTHER_ID + index) for index, name in names.items()}
    return ids, {ids[index]: COCO_NAMES.get(ids[index], name) for index, name in names.items()}


def is_object(name: str) -> bool:
    """True for a class of objects; False for `NO_OBJECTS`."""
    return folded(name) not in NO_OBJECTS


def class_id(category: int, name: str, known: dict[int, str]) -> int:
    """Id of a class among those of several tables of names, which may each number in its own way.

    A class goes by its name, folded. It has the id that it has in `known`, or its own, or, where another class has
    that, the first from 100 that is free; `known`, to which it is added, then holds every class once.

    Args:
        category: Its own id.
        name: Its name.
        known: Name of each id so far.
    """
    own = folded(name)
    if category in known and folded(known[category]) == own:
        return category
    found = next((each for each, held in known.items() if folded(held) == own), category)
    if folded(known.setdefault(found, name)) == own:
        return found
    free = next(each for each in count(FIRST_OTHER_ID) if each not in known)
    known[free] = name
    return free


def synonyms(name: str) -> tuple[str, ...]:
    """All names that mean the class `name`, itself first."""
    return (name, *_GROUPS.get(folded(name), ()))


def own_name(name: str, own: Iterable[str], wider: Mapping[str, str]) -> str | None:
    """What a data set with the classes `own` calls the class `name`; None where it has no such class.

    `wider` says which of its classes holds one that it has no name for.
    """
    names = {folded(held): holds for held, holds in wider.items()} | {folded(each): each for each in own}
    return next((names[each] for each in map(folded, synonyms(name)) if each in names), None)


def find_categories(wanted: Iterable[int | str], names: Mapping[int, str]) -> list[int]:
    """Ids of the categories `wanted`, each an id or a name, whatever its capitals, among `names`.

    Raises:
        ParameterError: There is no such category; the message has the nearest name.
    """
    return [category for one in wanted for category in _ids(one, names)]


def _ids(wanted: int | str, names: Mapping[int, str]) -> list[int]:
    by_name = {folded(name): name for name in names.values()}
    asked = folded(wanted) if isinstance(wanted, str) else None
    found = [category for category, name in names.items() if wanted in (category, name)]
    found = found or [category for category, name in names.items() if folded(name) == asked]
    if found:
        return found
    near = did_you_mean(own_name(str(wanted), by_name, {}) or str(wanted), names.values())
    some = ", ".join(list(names.values())[:8]) + (", ..." if len(names) > 8 else "")
    raise ParameterError(f"categories: {wanted!r} is unknown{near or f'; expected one of {some}'}")
