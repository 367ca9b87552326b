"""A camera's picture of solids: sunlight, shadows, plain textures, sky."""

import numpy as np
from numpy.typing import NDArray

from ldls.simulation.demo.solids import F32, GROUND_M, I32, Solids, Surface, first_hits, normals

SUN = np.array([-0.60, -0.40, 0.693], np.float32)  # from the world to the sun
SUNLIGHT = np.array([1.22, 1.12, 0.94], np.float32)
SKYLIGHT = np.array([0.44, 0.48, 0.56], np.float32)
GLASS = np.array([0.17, 0.21, 0.26], np.float32)
HAZE = np.array([0.80, 0.86, 0.92], np.float32)
ZENITH = np.array([0.33, 0.55, 0.86], np.float32)


def shade(origin_m: F32, directions: F32, range_m: F32, solid: I32, solids: Solids) -> F32:
    """Return the colour (B, R, 3) in [0, 1] that each ray of a camera sees.

    `directions` (3, B, R), `range_m` and `solid` (B, R) are those of `first_hits`.
    """
    seen = np.isfinite(range_m)
    height = directions[2][:, :, None].clip(0, 0.5) * 2
    picture = (1 - height) * HAZE + height * ZENITH
    points_m = (origin_m + directions * np.where(seen, range_m, 0)).astype(np.float32)
    at_m, index = points_m[:, seen].T, solid[seen]
    normal = normals(at_m, solids, index)
    points_m[:, seen] += 0.02 * normal.T  # off the surface, lest a solid shades itself
    toward_sun = np.broadcast_to(SUN[:, None, None], points_m.shape)
    shaded = np.isfinite(first_hits(points_m, toward_sun, solids)[0][seen])
    lit = ~shaded * (normal @ SUN).clip(0)
    ambient = (0.75 + 0.25 * normal[:, 2:]) * SKYLIGHT
    colour = _surface_colour(at_m, solids, index) * (ambient + lit[:, None] * SUNLIGHT)
    clear = np.exp(-range_m[seen] / 220)[:, None]
    picture[seen] = clear * colour + (1 - clear) * HAZE
    return np.asarray(picture.clip(0, 1) ** np.float32(0.8))


def _surface_colour(at_m: F32, solids: Solids, index: I32) -> F32:
    colour = solids.colour[index]
    painters = {
        Surface.ASPHALT: _asphalt,
        Surface.PAVING: _paving,
        Surface.FACADE: _facade,
        Surface.FOLIAGE: _foliage,
    }
    surface = solids.surface[index]
    for kind, paint in painters.items():
        of_kind = surface == kind
        colour[of_kind] = paint(at_m[of_kind], colour[of_kind])
    return colour


def _speckle(at_m: F32, cell_m: float) -> F32:
    """Return a value in [0, 1) for each point, one for all points of a cube of the grid."""
    cell = np.floor(at_m / cell_m) @ np.array([12.99, 78.23, 37.72])
    return np.asarray(np.sin(cell) * 4375.85 % 1, np.float32)


def _asphalt(at_m: F32, colour: F32) -> F32:
    x, y = at_m[:, 0], at_m[:, 1]
    dashed = (np.abs(y - 1.6) < 0.07) & (x % 6 < 3)
    gutter = (np.abs(y - 6.65) < 0.12) | (np.abs(y + 3.55) < 0.12)
    grain = 0.88 + 0.14 * _speckle(at_m, 0.04) + 0.06 * _speckle(at_m, 1.3)
    paint = np.where(dashed, 2.3, np.where(gutter, 0.8, 1.0))
    return np.asarray(colour * (grain * paint)[:, None])


def _paving(at_m: F32, colour: F32) -> F32:
    slab = at_m / 0.6 + np.float32(0.3)
    joint = (slab[:, :2] % 1 < 0.04).any(axis=1)
    tone = 0.90 + 0.16 * _speckle(at_m + 0.18, 0.6)
    return colour * np.where(joint, 0.72, tone)[:, None]


def _facade(at_m: F32, colour: F32) -> F32:
    along = (at_m[:, 0] + at_m[:, 1]) % 2.4  # one of the two is constant on a wall
    up = at_m[:, 2] - GROUND_M
    shop = up < 3.2
    storey = (up - 3.2) % 3.0

    def opening(margin: float) -> NDArray[np.bool_]:
        upstairs = (np.abs(along - 1.25) < 0.5 + margin) & (np.abs(storey - 1.6) < 0.8 + margin)
        window = (along > 0.35) & (np.abs(up - 1.55) < 1.05)
        return np.asarray(np.where(shop, window, upstairs))

    trim = (opening(0.13) & ~shop) | (np.abs(up - 3.2) < 0.14)
    tone = np.where(trim, 1.22, np.where(shop, 0.82, 0.97)) + 0.05 * _speckle(at_m, 0.1)
    pane = 0.8 + 0.5 * _speckle(at_m, 1.2)
    return np.where(opening(0)[:, None], GLASS * pane[:, None], colour * tone[:, None])


def _foliage(at_m: F32, colour: F32) -> F32:
    leaf = 0.35 + 0.7 * _speckle(at_m, 0.06) + 0.45 * _speckle(at_m, 0.17)
    return np.asarray(colour * leaf[:, None])
