"""Categories of the classes that a network numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ldls.categories import COCO_NAMES, CONTIGUOUS_IDS, category_ids
from ldls.errors import MaskError

LAST_COCO_ID = 90
UNUSED = "N/A"


@dataclass(frozen=True)
class Classes:
    """Categories of a network's class numbers.

    Attributes:
        ids: Category id of each class.
        names: Name of each category id.
    """

    ids: Mapping[int, int]
    names: Mapping[int, str]

    def id(self, instance: int, number: int) -> int:
        """Category id of the class `number`.

        Raises:
            MaskError: There is no such class; the message names the instance.
        """
        if number not in self.ids:
            raise MaskError(
                f"instance {instance}: class {number} is unknown, expected one of {len(self.ids)} "
                f"from {min(self.ids, default=0)} to {max(self.ids, default=0)}; pass names={{{number}: '...'}}"
            )
        return self.ids[number]


def coco_classes() -> Classes:
    """Classes that are ids of COCO's 91-entry list; the ids that COCO never used are called N/A."""
    names = {i: COCO_NAMES.get(i, UNUSED) for i in range(1, LAST_COCO_ID + 1)}
    return Classes({i: i for i in names}, names)


def contiguous_coco_classes(first: int) -> Classes:
    """COCO's 80 classes without gaps, numbered from `first`."""
    return Classes(dict(enumerate(CONTIGUOUS_IDS, start=first)), COCO_NAMES)


def named_classes(names: Mapping[int, str]) -> Classes:
    """Classes by their names, with the ids of `ldls.categories.category_ids`."""
    ids, own = category_ids(names)
    return Classes(ids, COCO_NAMES | own)
