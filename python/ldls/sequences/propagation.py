"""Labels that other moments know better: of objects that images overlook, and of points that a mask gives to another.

A segmenter misses an object for a while, a camera has no image, or a mask shows two. What is known of other moments
stays true: what stands still is where it was, and what moves is where its velocity takes it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ldls._optional import require
from ldls.cloud import Floats, Ints
from ldls.sequences.moment import Boxes, Moment
from ldls.sequences.track import MEMORY_S, Track
from ldls.sequences.trajectory import SAME_S

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

    A point is of an object if of all points of the nearest moment that shows the object, the earlier of two as near,
    one of the object is nearest, and it is not below all of it. Objects for which this is that moment are moved from
    there by their velocity.

    Args:
        moment: The moment.
        moments: Those that are known, itself among them, in the order of their stamps.
        tracks: The objects that are known.
    """
    found = np.zeros(len(moment.points), np.int64)
    others = [each for each in moments if each is not moment and abs(each.stamp - moment.stamp) <= MEMORY_S + SAME_S]
    enough = FEW_IMAGES if moment.blind else ENOUGH_IMAGES
    tracks = [track for track in tracks if track.n_images >= enough]
    if not others or not tracks:
        return found
    counts = np.array([each.counts_of([track.number for track in tracks]) for each in others])
    most = counts.max(axis=0)
    since = np.abs([moment.stamp - each.stamp for each in others])
    shown = np.where(counts >= LEAST_SHOWN * most, since[:, None], np.inf)
    # of equally near ones the earlier, not the one that rounding favours
    nearest = np.where(most > 0, (shown <= shown.min(axis=0) + SAME_S).argmax(axis=0), -1)
    distances = np.full(len(moment.points), np.inf)
    for at in set(nearest.tolist()) - {-1}:
        of_moment = [tracks[i] for i in np.flatnonzero(nearest == at)]
        rows, numbers, apart = _nearest_to(moment, others[at], of_moment)
        nearer = apart < distances[rows]
        found[rows[nearer]] = numbers[nearer]
        distances[rows[nearer]] = apart[nearer]
    return found


def _nearest_to(moment: Moment, there: Moment, tracks: Sequence[Track]) -> tuple[Ints, Ints, Floats]:
    """Points of a moment that have no object, are nearest to one of these of another moment, and not below all of it.

    Returns:
        (m,) the indices of the points, the number of the object of each, and how far it is in metres.
    """
    boxes = there.boxes.of([track.number for track in tracks])
    ways = np.array([[*track.velocity, 0.0] for track in tracks]) * (moment.stamp - there.stamp)
    around = Boxes(boxes.numbers, boxes.low + ways - (NEAR_M, NEAR_M, BELOW_M), boxes.high + ways + NEAR_M)
    held = around.hold(moment.free_points)
    rows = moment.free[_in_any(held, len(moment.free))]
    if not len(rows):
        return rows, rows, np.zeros(0)
    # objects around which no point is free find none, and stay where they were
    at = np.flatnonzero([len(each) for each in held])
    around, ways = around.some(at), ways[at]
    way_of = np.zeros((len(there.counts), 3))
    way_of[around.numbers] = ways
    is_beside = _in_any(around.longer(NEAR_M).hold(there.points), len(there.points))
    is_beside |= np.isin(there.tracks, around.numbers[np.any(ways, axis=1)])
    points, numbers = there.some(np.flatnonzero(is_beside))
    points += way_of[numbers]
    tree = require("scipy.spatial", "eval").KDTree(points, balanced_tree=False, compact_nodes=False)
    apart, nearest = tree.query(moment.points[rows], distance_upper_bound=NEAR_M)
    # where nothing is so near, the tree says that it is after the last
    numbers = np.append(numbers, 0)[nearest]
    lowest = np.full(len(there.counts), np.inf)
    lowest[around.numbers] = around.low[:, 2]
    kept = moment.points[rows, 2] >= lowest[numbers]
    return rows[kept], numbers[kept], apart[kept]


def _in_any(rows: Sequence[Ints], n: int) -> NDArray[np.bool_]:
    """(n,) True for each index that is in any of the rows."""
    found = np.zeros(n, bool)
    for each in rows:
        found[each] = True
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
    known = known.some(goes_on)
    of_known = [of_number[number] for number in known.numbers.tolist()]
    categories = np.array([track.instance.category for track in of_known], np.int64)
    stand = np.array([not track.moves for track in of_known], bool)
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
        stand: (k,) True for those that stand.
    """
    own = moment.boxes
    of_known = dict(zip(known.numbers.tolist(), categories.tolist(), strict=True))
    category = np.array([of_known.get(number, NO_CATEGORY) for number in own.numbers.tolist()], np.int64)
    rivals = stand & (category[:, None] == categories) & (own.numbers[:, None] != known.numbers)
    meet = (own.low[:, None] <= known.high + AROUND_M) & (own.high[:, None] >= known.low - AROUND_M)
    rivals &= meet.all(axis=2)
    for at in np.flatnonzero(rivals.any(axis=1)):
        rows = np.flatnonzero(moment.tracks == own.numbers[at])
        held = known.some(rivals[at]).longer(AROUND_M).hold(moment.points[rows])
        rows = rows[_in_any(held, len(rows))]
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
