"""Solids (boxes, cylinders, ellipsoids) and the first of them that each ray meets."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]
GROUND_M = -1.73  # z of the road, below the sensor at the origin
Vector = tuple[float, float, float]


class Shape(IntEnum):
    """The unit solids; a part stretches one to its half extents. Cylinders stand along z."""

    BOX = 0
    CYLINDER = 1
    ELLIPSOID = 2


class Surface(IntEnum):
    """What a surface looks like in the image."""

    PLAIN = 0
    ASPHALT = 1
    PAVING = 2
    FACADE = 3
    FOLIAGE = 4


class Part(NamedTuple):
    """One solid of a model, in the model's frame: x ahead, y left, z up from the ground, metres."""

    shape: Shape
    centre_m: Vector
    half_m: Vector
    colour: Vector
    pitch_deg: float = 0.0
    roll_deg: float = 0.0
    bore: float = 0.0  # radius of the hole through a cylinder, as a part of its own
    surface: Surface = Surface.PLAIN


@dataclass(frozen=True)
class Solids:
    """P placed parts, as arrays whose first axis is P; `owner` is the object, 0 for scenery."""

    shape: I32
    centre_m: F32
    rotation: F32  # (P, 3, 3), maps the part's frame to the world's
    half_m: F32
    bore: F32
    colour: F32
    surface: I32
    owner: I32

    @classmethod
    def join(cls, models: Sequence["Solids"]) -> "Solids":
        """All solids of several models."""
        return cls(*(np.concatenate(field) for field in zip(*map(_fields, models), strict=True)))


def _fields(solids: Solids) -> list[NDArray[np.generic]]:
    return list(vars(solids).values())


def place(parts: Sequence[Part], at_m: Vector, yaw_deg: float = 0.0, owner: int = 0) -> Solids:
    """Return a model's parts, turned about z and moved to `at_m` in the world."""
    turn = _rotation(yaw_deg, 0.0, 0.0)
    centre_m = np.array([part.centre_m for part in parts]) @ turn.T + at_m
    rotation = [_rotation(yaw_deg, part.pitch_deg, part.roll_deg) for part in parts]
    return Solids(
        shape=np.array([part.shape for part in parts], np.int32),
        centre_m=centre_m.astype(np.float32),
        rotation=np.array(rotation, np.float32),
        half_m=np.array([part.half_m for part in parts], np.float32),
        bore=np.array([part.bore for part in parts], np.float32),
        colour=np.array([part.colour for part in parts], np.float32),
        surface=np.array([part.surface for part in parts], np.int32),
        owner=np.full(len(parts), owner, np.int32),
    )


def _rotation(yaw_deg: float, pitch_deg: float, roll_deg: float) -> NDArray[np.float64]:
    (cy, cp, cr) = np.cos(np.radians([yaw_deg, pitch_deg, roll_deg]))
    (sy, sp, sr) = np.sin(np.radians([yaw_deg, pitch_deg, roll_deg]))
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    return np.asarray(about_z @ about_y @ about_x)


def first_hits(origins_m: F32, directions: F32, solids: Solids) -> tuple[F32, I32]:
    """Return each ray's distance to the first solid (inf: none) and that solid's index (-1: none).

    `directions` (3, B, R), of length 1, are B bundles of R neighbouring rays; `origins_m` is as
    large or (3, 1, 1). A solid is tried only on the bundles that can reach its bounding sphere.
    """
    origins_m = np.broadcast_to(origins_m, directions.shape)
    range_m = np.full(directions.shape[1:], np.inf, np.float32)
    solid = np.full(directions.shape[1:], -1, np.int32)
    reach = _reach(origins_m, directions, solids)
    with np.errstate(all="ignore"):  # parallel rays divide by zero; inf and NaN fail the tests
        for index in range(len(solids.shape)):
            near = np.flatnonzero(reach[index])
            hit_m = _intersect(origins_m[:, near], directions[:, near], solids, index)
            closer = hit_m < range_m[near]
            range_m[near] = np.where(closer, hit_m, range_m[near])
            solid[near] = np.where(closer, index, solid[near])
    return range_m, solid


def _reach(origins_m: F32, directions: F32, solids: Solids) -> NDArray[np.bool_]:
    """Return (P, B): whether a ray of the bundle may meet the solid's bounding sphere."""
    start = origins_m.mean(axis=2)
    axis = directions.mean(axis=2)
    axis /= np.linalg.norm(axis, axis=0)
    start_radius = np.linalg.norm(origins_m - start[:, :, None], axis=0).max(axis=1)
    cosine = np.einsum("cb,cbr->br", axis, directions).min(axis=1).clip(1e-3, 1)
    radius = np.linalg.norm(solids.half_m, axis=1)[:, None] + start_radius
    offset = solids.centre_m[:, :, None] - start
    along = np.einsum("pcb,cb->pb", offset, axis)
    across = np.sqrt(np.maximum((offset**2).sum(axis=1) - along**2, 0))
    spread = np.sqrt(1 - cosine**2) / cosine * along.clip(0)
    return np.asarray((across <= radius / cosine + spread + 1e-3) & (along >= -radius))


def _intersect(origins_m: F32, directions: F32, solids: Solids, index: int) -> F32:
    """Return the distance at which each ray enters the solid; NaN or inf where it does not."""
    to_unit = (solids.rotation[index] / solids.half_m[index]).T
    centre_m = solids.centre_m[index][:, None, None]
    start = np.tensordot(to_unit, origins_m - centre_m, axes=1)
    step = np.tensordot(to_unit, directions, axes=1)
    match Shape(int(solids.shape[index])):
        case Shape.BOX:
            entry = _enter_box(start, step)
        case Shape.CYLINDER:
            entry = _enter_cylinder(start, step, float(solids.bore[index]))
        case Shape.ELLIPSOID:
            entry = _enter_ball(start, step)
    return np.where(entry > 0, entry, np.float32(np.inf))


def _enter_box(start: F32, step: F32) -> F32:
    one, other = (-1 - start) / step, (1 - start) / step
    entry = np.minimum(one, other).max(axis=0)
    leave = np.maximum(one, other).min(axis=0)
    return np.where(entry <= leave, entry, np.float32(np.inf))


def _enter_ball(start: F32, step: F32) -> F32:
    # From the point nearest to the centre: in single precision the textbook discriminant of a
    # small ball far away is mostly rounding.
    speed2 = (step**2).sum(axis=0)
    middle = -(start * step).sum(axis=0) / speed2
    return np.asarray(middle - np.sqrt((1 - ((start + middle * step) ** 2).sum(axis=0)) / speed2))


def _enter_cylinder(start: F32, step: F32, bore: float) -> F32:
    side = _enter_ball(start[:2], step[:2])
    side = np.where(np.abs(start[2] + side * step[2]) <= 1, side, np.float32(np.inf))
    entry = np.where(side > 0, side, np.float32(np.inf))
    for cap in (-1, 1):
        at = (cap - start[2]) / step[2]
        radius2 = ((start[:2] + at * step[:2]) ** 2).sum(axis=0)
        on_cap = (radius2 <= 1) & (radius2 >= bore**2) & (at > 0)
        entry = np.where(on_cap, np.minimum(entry, at), entry)
    return entry


def normals(points_m: F32, solids: Solids, index: I32) -> F32:
    """Return the outward unit normal (n, 3) of solid `index` (n,) at points (n, 3) on it."""
    rotation, half_m = solids.rotation[index], solids.half_m[index]
    local = np.einsum("nij,ni->nj", rotation, points_m - solids.centre_m[index]) / half_m
    shape = solids.shape[index]
    face = np.abs(local) >= np.abs(local).max(axis=1, keepdims=True)
    cap = (np.abs(local[:, 2:]) > 0.999) & (np.arange(3) == 2)
    wall = np.where(cap.any(axis=1, keepdims=True), cap, np.arange(3) < 2)
    of_shape = [(shape == kind)[:, None] for kind in (Shape.BOX, Shape.CYLINDER)]
    keep = np.select(of_shape, [face, wall], True)
    outward = np.einsum("nij,nj->ni", rotation, local * keep / half_m)
    return np.asarray(outward / np.linalg.norm(outward, axis=1, keepdims=True))
