"""Labels that other moments know better: of objects that images overlook, and of points that a mask gives to another.

A segmenter misses an object for a while, a camera has no image, or a mask shows two. What is known of other moments
stays true: what stands still is where it was, and what moves is where its velocity takes it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ldls._optional import require
from ldls.sequences.moment import Boxes, Ints, Moment
from ldls.sequences.track import MEMORY_S, Floats, Track

ENOUGH_IMAGES = 5
"""Images that must have shown an object, or what others do not show is rather not there."""
FEW_IMAGES = 3
"""The same where the images show nothing at all, and so do not say that it is not there."""
NEAR_M = 0.8
"""Distance up to which a point takes the label of one of another moment: lines of a lidar are as far apart."""
BELOW_M = 0.03
"""Height below the lowest point of an object from which on points are of the ground that it stands on."""
LEAST_SHOWN = 0.65
"""A moment shows an object if it has this share or more of the most points that one of the others has of it."""
CONFIDENCE = 0.82
"""Share of the overlooked points whose label is right, on drives with a fifth of the masks left out."""
AROUND = 12
"""Most points of earlier moments that say of which object a point is that has a label."""
AROUND_M = 0.3
"""Distance up to which they do."""
OUTVOTED = 2
"""How many times as many of another object as of its own there must be."""
NO_CATEGORY = -1
"""In the place of that of what has no earlier points, or of a point that is not asked."""


def overlooked(moment: Moment, moments: Sequence[Moment], tracks: Sequence[Track]) -> Ints:
    """(n,) number of an object for each point of a moment that has none and must be of one; 0 for all others.

    A point is of an object if the nearest point that this has at the nearest moment that shows it, which moves with it,
    is nearer than all others there, which stay where they are, and is not below all of the object.

    Args:
        moment: The moment.
        moments: Those that are known, itself among them.
        tracks: The objects that are known.
    """
    found = np.zeros(len(moment.points), np.int64)
    distances = np.full(len(moment.points), np.inf)
    others = [each for each in moments if each is not moment and abs(each.stamp - moment.stamp) <= MEMORY_S]
    for track in tracks:
        if track.n_images < (FEW_IMAGES if moment.blind else ENOUGH_IMAGES):
            continue
        number = track.number
        most = max((each.counts.get(number, 0) for each in others), default=0)
        if most == 0:
            continue
        shown = (each for each in others if each.counts.get(number, 0) >= LEAST_SHOWN * most)
        there = min(shown, key=lambda each: abs(each.stamp - moment.stamp))
        way = np.array([*track.velocity, 0.0]) * (moment.stamp - there.stamp)
        own = there.points[there.tracks == number] + way
        low, high = own.min(axis=0) - (NEAR_M, NEAR_M, BELOW_M), own.max(axis=0) + NEAR_M
        free = moment.within(low, high)
        free = free[moment.tracks[free] == 0]
        if not len(free):
            continue
        beside = there.within(low - NEAR_M, high + NEAR_M)
        beside = beside[there.tracks[beside] != number]
        to_own = _distances(moment.points[free], own)
        nearer = (to_own < _distances(moment.points[free], there.points[beside])) & (to_own < distances[free])
        found[free[nearer]] = number
        distances[free[nearer]] = to_own[nearer]
    return found


def mistaken(moments: Sequence[Moment], before: Sequence[Moment], tracks: Sequence[Track]) -> list[Ints]:
    """(n,) number of another object for each point of each moment that is rather of that; 0 for all others.

    A mask shows points of the next object too, and two objects have one label for a while. A point is rather of what
    stands there, of its category, if of the earlier points around it more than twice as many are. An object that has no
    earlier points keeps its own.

    Args:
        moments: The moments.
        before: Earlier ones, which were not segmented with them.
        tracks: The objects that are known.
    """
    found = [np.zeros(len(each.points), np.int64) for each in moments]
    if not before:
        return found
    known = Boxes.around(*map(np.concatenate, zip(*(each.boxes for each in before), strict=True)))
    of_number = {track.number: track for track in tracks}
    # a call may be longer than tracks live
    goes_on = np.isin(known.numbers, [*of_number])
    known = Boxes(known.numbers[goes_on], known.low[goes_on], known.high[goes_on])
    of_known = [of_number[number] for number in known.numbers.tolist()]
    categories = np.array([track.instance.category for track in of_known], np.int64)
    stand = np.array([not track.velocity.any() for track in of_known], bool)
    # the category of each point that is asked, and the objects that it may be of
    asked = [np.full(len(each.points), NO_CATEGORY) for each in moments]
    involved: dict[int, set[int]] = {}
    for moment, of_points in zip(moments, asked, strict=True):
        for rows, of_category, objects in _beside(moment, known, categories, stand):
            of_points[rows] = of_category
            involved.setdefault(of_category, set()).update(objects)
    for of_category, numbers in involved.items():
        rows_of = [np.flatnonzero(each == of_category) for each in asked]
        points, of_objects = _together([each.some(rows) for each, rows in zip(moments, rows_of, strict=True)])
        new = _outvoted(points, of_objects, before, [*numbers])
        new[~np.isin(new, known.numbers[stand])] = 0
        ends = np.cumsum([len(rows) for rows in rows_of])
        for each, rows, of_rows in zip(found, rows_of, np.split(new, ends[:-1]), strict=True):
            each[rows] = of_rows
    return found


def _beside(
    moment: Moment, known: Boxes, categories: Ints, stand: NDArray[np.bool_]
) -> Iterator[tuple[Ints, int, Ints]]:
    """Points of each object that boxes of others of its category hold which stand, that category, and the objects.

    Args:
        moment: The moment.
        known: Boxes of objects at earlier moments.
        categories: (k,) that of each.
        stand: (k,) whether each stands.
    """
    own = moment.boxes
    of_known = dict(zip(known.numbers.tolist(), categories.tolist(), strict=True))
    category = np.array([of_known.get(number, NO_CATEGORY) for number in own.numbers.tolist()], np.int64)
    rivals = stand & (category[:, None] == categories) & (own.numbers[:, None] != known.numbers)
    meet = (own.low[:, None] <= known.high + AROUND_M) & (own.high[:, None] >= known.low - AROUND_M)
    rivals &= meet.all(axis=2)
    for at in np.flatnonzero(rivals.any(axis=1)):
        rows = np.flatnonzero(moment.tracks == own.numbers[at])
        rows = rows[known.hold(moment.points[rows], rivals[at], AROUND_M)]
        if len(rows):
            yield rows, int(category[at]), np.append(known.numbers[rivals[at]], own.numbers[at])


def _outvoted(points: Floats, own: Ints, before: Sequence[Moment], objects: Sequence[int]) -> Ints:
    """(n,) number of another of some objects for each point that is rather of that; 0 for all others.

    Args:
        points: (n, 3) x y z in metres.
        own: (n,) number of the object of each.
        before: Earlier moments.
        objects: Numbers of those that may have points around them then, their own among them.
    """
    there, numbers = _together(
        [each.some(each.labelled[np.isin(each.tracks[each.labelled], objects)]) for each in before]
    )
    tree = require("scipy.spatial", "eval").KDTree(there)
    _, nearest = tree.query(points, AROUND, distance_upper_bound=AROUND_M)
    # where fewer are so near, the tree says that they are after the last
    around = np.append(numbers, 0)[nearest]
    votes = np.sum(around[:, :, None] == around[:, None, :], axis=2) * (around > 0)
    most = (np.arange(len(points)), votes.argmax(axis=1))
    return np.where(votes[most] > OUTVOTED * np.sum(around == own[:, None], axis=1), around[most], 0)


def _together(parts: Sequence[tuple[Floats, Ints]]) -> tuple[Floats, Ints]:
    """Points of all moments, and the number of the object of each."""
    points, numbers = zip(*parts, strict=True)
    return np.concatenate(points), np.concatenate(numbers)


def _distances(points: Floats, others: Floats) -> Floats:
    """Distance in metres of each point to the nearest other; infinite beyond `NEAR_M`."""
    if not len(points) or not len(others):
        return np.full(len(points), np.inf)
    distances, _ = require("scipy.spatial", "eval").KDTree(others).query(points, distance_upper_bound=NEAR_M)
    return np.asarray(distances, np.float64)
