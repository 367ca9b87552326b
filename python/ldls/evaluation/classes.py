"""The classes that are scored, and what becomes of all others."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ldls.categories import COCO_NAMES, find_categories, folded, synonyms
from ldls.checks import checked
from ldls.errors import InputError, LdlsWarning, ParameterError
from ldls.io.labels.kitti_objects import KITTI
from ldls.io.labels.nuscenes_labels import LIDARSEG, NUSCENES
from ldls.io.labels.semantic_kitti import SEMANTIC_KITTI
from ldls.io.labels.squeezeseg import SQUEEZESEG
from ldls.labeling import BACKGROUND, Labeling

CLASS_SHIFT = 32
SITTING = "Person_sitting"
LEFT_OUT: tuple[str, ...] = ("Van", "Cyclist", "Misc", "DontCare")
"""KITTI's classes that look so much like a scored one that neither finding nor missing them is an error."""

VOID: tuple[str, ...] = ("unlabeled", "outlier", "noise", "vehicle.ego")
"""Names under which a data set says that it does not know, or that the sensor saw its own car."""


@checked
@dataclass(frozen=True, kw_only=True)
class ClassSet:
    """The scored classes and how names of other vocabularies map onto them. Capitals of names do not count.

    Attributes:
        names: The scored classes, in the order of the tables.
        aliases: Scored class of other names: {"car": "Car", "person": "Pedestrian"}.
        left_out: Names whose points, in truth, no score counts. In predictions they are background.
        background: Other names that truth may hold; their points are background. A name that truth holds and that
            stands nowhere here is an error, one that predictions hold is background.

    Raises:
        ParameterError: There is no class, one stands there twice, or the attributes contradict one another.
    """

    names: tuple[str, ...]
    aliases: Mapping[str, str] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()
    background: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        names = tuple(self.names)
        object.__setattr__(self, "names", names)
        if not names or len({BACKGROUND, "", *map(folded, names)}) != len(names) + 2:
            raise ParameterError(f"names: got {names}, expected one or more different classes without background")
        for alias, name in self.aliases.items():
            if name not in names:
                raise ParameterError(f"aliases: {alias!r} stands for {name!r}, which is none of {names}")
        both = sorted(name for name in self.left_out if self.index(name))
        if both:
            raise ParameterError(f"left_out: {both} are scored too; score a class or leave it out")

    @classmethod
    @checked
    def kitti(
        cls,
        names: Sequence[str] = ("Car", "Pedestrian"),
        *,
        merge_sitting: bool = True,
        leave_out: Sequence[str] | None = None,
        background: Sequence[str] = (),
    ) -> Self:
        """Classes by name, with the synonyms of KITTI, COCO, SqueezeSeg, SemanticKITTI and nuScenes.

        Args:
            names: The scored classes; any name of those vocabularies, or one of your own.
            merge_sitting: Count Person_sitting as Pedestrian; it is left out otherwise, unless it is scored.
            leave_out: Classes whose points in truth do not count; `LEFT_OUT`, less those scored, by default. Points
                that a data set calls unlabeled are left out whatever this says.
            background: Names of your own that truth may hold and that are background; those of the vocabularies are
                known.

        Raises:
            ParameterError: Two names are of one class, one is scored and left out, or background, by whatever of its
                names, or `leave_out` holds a name of no vocabulary.
        """
        known = _known_names()
        leave_out = None if leave_out is None else tuple(leave_out)
        unknown = _without(leave_out or (), known)
        if unknown:
            raise ParameterError(f"leave_out: no data set has {unknown}; expected names such as {', '.join(KITTI)}")
        for one, other in combinations(names, 2):
            if not _without([one], synonyms(other)):
                raise ParameterError(f"names: {one!r} and {other!r} are one class; score it by one of its names")
        aliases = {alias: name for name in names for alias in _without(_merged(name, merge_sitting), names)}
        for argument, given, instead in (
            ("leave_out", leave_out or (), "leave it out"),
            ("background", background, "have it as background"),
        ):
            clash = [name for name in given if not _without([name], [*names, *aliases])]
            if clash:
                raise ParameterError(f"{argument}: {clash} are scored too; score a class or {instead}")
        wanted = LEFT_OUT if leave_out is None else leave_out
        wanted = (*wanted, *VOID) if merge_sitting else (*wanted, *VOID, SITTING)
        left_out = _without((alias for name in wanted for alias in synonyms(name)), [*names, *aliases])
        return cls(
            names=tuple(names),
            aliases=aliases,
            left_out=tuple(left_out),
            background=tuple(_without([*known, *background], [*names, *aliases, *left_out])),
        )

    @classmethod
    @checked
    def nuscenes(cls) -> Self:
        """The 16 classes of nuScenes' lidarseg challenge; points of its other classes do not count, as there.

        Predictions may call the classes by what KITTI, COCO, SqueezeSeg and SemanticKITTI do, as "person".
        """
        own, names = {*NUSCENES.values()}, tuple(LIDARSEG)
        aliases = {
            alias: name
            for name, held in LIDARSEG.items()
            for one in held
            for alias in _without(synonyms(one), [*names, *(own - {*held})])
        }
        return cls(names=names, aliases=aliases, left_out=tuple(_without([*own, *VOID], [*names, *aliases])))

    @property
    def vocabulary(self) -> tuple[str, ...]:
        """Names of a mapped labeling: background, then the scored classes."""
        return (BACKGROUND, *self.names)

    @checked
    def map(self, labeling: Labeling, *, truth: bool = False) -> Labeling:
        """The labels of `labeling` with the names of `vocabulary`.

        Classes that are not scored become background. In truth, names that are left out are ignored, and a name that
        is not known is an error; in a prediction both are background, for a method must not choose which points count.

        Raises:
            InputError: This is truth and holds an unknown class.
        """
        if truth:
            self._check_known(labeling)
        targets = np.array([self.index(name) for name in labeling.names], np.int32)
        classes = targets[labeling.classes]
        ignored = labeling.ignored
        if truth:
            left_out = {*map(folded, self.left_out)}
            ignored = ignored | np.array([folded(name) in left_out for name in labeling.names])[labeling.classes]
        return Labeling(classes, _distinct_instances(labeling, classes), ignored, self.vocabulary)

    @checked
    def index(self, name: str) -> int:
        """Number of the class of `name` in `vocabulary`; 0 for whatever is not scored."""
        return self._numbers.get(folded(name), 0)

    @checked
    def knows(self, name: str) -> bool:
        """True for a name that truth may hold."""
        return self.index(name) > 0 or folded(name) in map(folded, (BACKGROUND, *self.left_out, *self.background))

    @cached_property
    def _numbers(self) -> dict[str, int]:
        """Index of each name and alias, these folded."""
        places = {name: number for number, name in enumerate(self.names, start=1)}
        every = places | {alias: places[name] for alias, name in self.aliases.items()}
        return {folded(name): number for name, number in every.items()}

    def check_occur(self, seen: Iterable[str]) -> None:
        """Warn of scored names that neither a vocabulary nor any label has, and that nothing else counts as.

        Args:
            seen: The names of classes that truth or predictions have.

        Raises:
            ParameterError: All are such; the message, as that of the warning, has the nearest name.
        """
        every = dict(enumerate(dict.fromkeys([*sorted({*seen} - {BACKGROUND}), *sorted(_known_names())])))
        faults = []
        for name in self.names:
            if name not in self.aliases.values():
                try:
                    find_categories([name], every)
                except ParameterError as error:
                    faults.append(error)
        if len(faults) == len(self.names):
            raise faults[0]
        for fault in faults:
            warnings.warn(str(fault), LdlsWarning, stacklevel=2)

    def _check_known(self, truth: Labeling) -> None:
        unknown = [name for name, count in truth.counts().items() if count and not self.knows(name)]
        if unknown:
            raise InputError(
                f"truth has points of {unknown}, which the class set {self.names} does not know; "
                "name them in its aliases, left_out or background"
            )


def object_codes(classes: NDArray[np.int32], instances: NDArray[np.int32]) -> NDArray[np.int64]:
    """One number for class and instance of each point's object, the class from `CLASS_SHIFT` on; -1 for none."""
    return np.where((classes > 0) & (instances > 0), classes.astype(np.int64) << CLASS_SHIFT | instances, -1)


def _distinct_instances(labeling: Labeling, classes: NDArray[np.int32]) -> NDArray[np.int32]:
    """Instances of scored classes, numbered anew where two classes that become one share a number."""
    instances = np.where(classes > 0, labeling.instances, 0).astype(np.int32)
    rows = np.flatnonzero(instances)
    own, mapped = (object_codes(k[rows], labeling.instances[rows]) for k in (labeling.classes, classes))
    before, numbers = np.unique(own, return_inverse=True)
    if len(before) > len(np.unique(mapped)):
        instances[rows] = numbers.reshape(-1) + 1
    return instances


def _merged(name: str, merge_sitting: bool) -> tuple[str, ...]:
    group = synonyms(name)
    return (*group, SITTING) if merge_sitting and "Pedestrian" in group else group


def _without(names: Iterable[str], others: Iterable[str]) -> list[str]:
    """Each of `names` once that is none of the `others`, sorted."""
    gone = {*map(folded, others)}
    return sorted({name for name in names if folded(name) not in gone})


def _known_names() -> set[str]:
    tables = (COCO_NAMES, SQUEEZESEG, SEMANTIC_KITTI, NUSCENES)
    return {*KITTI, *(name for table in tables for name in table.values())}
