"""How far objects that are seen are from tracks, from above, and which may be one with them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ldls.cloud import Floats
from ldls.sequences.track import Footprint, Sighting, Track, brought, gap, squared_distances

NEAR_M = 2.0
"""Distance up to which an object may be a track."""
SAME = 0.3
"""Share of the longer of two objects up to which they may be apart and are one object."""
SAME_M = 1.0
"""The same in metres."""
FEW_POINTS = 3
"""Points of which so many or fewer on an object are part of it, where both have labels of the same sweeps."""
ON_M = 0.2
"""Mean distance up to which they are on it."""
SAME_OF_FEW = 0.75
"""Share of the usual length of their category up to which two objects of so few points in every sweep may be apart and
are one: each of the points may be of either end."""

Seen = tuple[int, Sequence[Sighting]]
"""The category of an object, and its sightings."""


def compared(
    objects: Sequence[Seen], tracks: Sequence[Track], stamp: float
) -> tuple[Floats, NDArray[np.bool_], NDArray[np.bool_]]:
    """How o objects that are first seen at a moment lie to t tracks, brought there by their velocity.

    Args:
        objects: The objects, with what is seen of each then and soon after.
        tracks: The tracks.
        stamp: The moment, in seconds.

    Returns:
        (o, t) distance of each from each, as a share of the largest that they may have, infinite beyond it and where
        categories differ; (o, t) True where they are too near to be two objects; and (o, t) True where at first the
        object is of a few points, which lie on the track.
    """
    reach = _reach_of_few(objects, tracks)
    near = np.maximum(NEAR_M, reach)
    stood = [brought(sightings, np.zeros(2), stamp) for _, sightings in objects]
    apart = np.full(near.shape, np.inf)
    on = np.zeros(near.shape, bool)
    for j, track in enumerate(tracks):
        like = [i for i, (category, _) in enumerate(objects) if category == track.instance.category]
        if not like:
            continue
        there = track.at(stamp)
        for i in like:
            own = brought(objects[i][1], track.velocity, stamp) if track.moves else stood[i]
            if gap(own.box, there.box) <= near[i, j]:
                apart[i, j], on[i, j] = _apart(own, there, near[i, j])
    first = [sightings[0].footprint for _, sightings in objects]
    last = [track.sightings[-1].footprint for track in tracks]
    longer = np.maximum.outer([own.length for own in first], [own.length for own in last])
    same = (apart < np.minimum(SAME_M, SAME * longer)) | (apart < reach)
    few = np.array([len(own.points) <= FEW_POINTS for own in first], bool)
    return apart / near, same, on & few[:, None]


def _apart(one: Footprint, other: Footprint, near: float) -> tuple[float, bool]:
    """How far apart objects are in metres, infinite if not `near`, and whether one lies on the other.

    The former is the mean of two distances: of the points of the one of fewer to the nearest of the other, and of the
    middles.
    """
    few, many = sorted((one.points, other.points), key=len)
    distances = np.sqrt(squared_distances(few, many).min(axis=1))
    if distances.min() > near:
        return float("inf"), False
    middle = math.dist(one.middle.tolist(), other.middle.tolist())
    apart = float(np.minimum(distances, near).mean() + min(middle, near)) / 2
    return apart, bool(distances.mean() < ON_M)


def _reach_of_few(objects: Sequence[Seen], tracks: Sequence[Track]) -> Floats:
    """(o, t) distance in metres up to which two of few points in every sweep are the same; 0 for others."""
    few = np.array([track.most_points <= FEW_POINTS for track in tracks], bool)
    category = np.array([track.instance.category for track in tracks], np.int64)
    lengths = np.array([track.length for track in tracks], np.float64)
    usual = {each: float(np.median(lengths[~few & (category == each)])) for each in set(category[~few].tolist())}
    reach = np.array([SAME_OF_FEW * usual.get(each, 0.0) for each in category.tolist()]) * few
    most_points = [max(len(own.footprint.points) for own in sightings) for _, sightings in objects]
    return np.outer(np.array(most_points) <= FEW_POINTS, reach)
