"""The motion between two poses: even along a line, and by the shortest turn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ldls.camera.rigid import from_parts, from_quaternion, to_quaternion, transformed
from ldls.cloud import Floats


@dataclass(frozen=True, eq=False)
class Step:
    """The motion from one pose to another.

    Attributes:
        pose: (4, 4) the one.
        shift: (3,) from its place to that of the other, in metres.
        axis: (3,) of the turn, in coordinates of the one; zeros for none.
        half_turn: Half of the angle, in radians.
    """

    pose: Floats
    shift: Floats
    axis: Floats
    half_turn: float

    @classmethod
    def between(cls, one: Floats, other: Floats) -> Step:
        """The motion from the pose `one` to the pose `other`, both (4, 4)."""
        w, *vector = to_quaternion(one[:3, :3].T @ other[:3, :3]).tolist()
        sine = float(np.linalg.norm(vector))
        axis = np.array(vector) / sine if sine > 0 else np.zeros(3)
        return cls(one, other[:3, 3] - one[:3, 3], axis, float(np.arctan2(sine, w)))

    def at(self, share: float) -> Floats:
        """The pose at this share of the way; below 0 and above 1 the motion goes on."""
        half_turn = share * self.half_turn
        turn = from_quaternion("turn", np.array([np.cos(half_turn), *(np.sin(half_turn) * self.axis)]))
        return from_parts(self.pose[:3, :3] @ turn, self.pose[:3, 3] + share * self.shift)

    def moved(self, xyz: Floats, shares: Floats) -> Floats:
        """(n, 3) points, each moved by the pose at its own share of the way.

        It is `at` for many, with the turn by Rodrigues' formula: 1 + sin(a) K + (1 - cos(a)) K K, K x = axis cross x.
        """
        angles = 2 * self.half_turn * shares[:, None]
        x, y, z = self.axis
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        turn = self.pose[:3, :3]
        moved = transformed(xyz, self.pose) + shares[:, None] * self.shift
        moved += np.sin(angles) * transformed(xyz, from_parts(turn @ cross))
        moved += (1 - np.cos(angles)) * transformed(xyz, from_parts(turn @ cross @ cross))
        return moved
