"""Poses that keep to the ground, and the points that stand on it."""

import numpy as np
from scipy.spatial.transform import Rotation

from ldls.sequences.ground_level import levelled, split_standing


def test_levelling_undoes_a_wrong_height_roll_and_pitch_and_leaves_the_rest():
    generator = np.random.default_rng(0)
    xy = generator.uniform(-20, 20, (30_000, 2))
    hills = np.column_stack([xy, 0.1 * np.sin(xy[:, 0] / 5) + 0.02 * xy[:, 1] - 1.7])
    true = np.eye(4)
    true[:3, :3], true[:3, 3] = Rotation.from_euler("z", 5, degrees=True).as_matrix(), [0.8, 0.1, 0]
    later = (hills - true[:3, 3]) @ true[:3, :3]
    wrong = true.copy()
    wrong[:3, :3] = Rotation.from_euler("xy", [0.5, -0.8], degrees=True).as_matrix() @ true[:3, :3]
    wrong[2, 3] = 0.1
    np.testing.assert_allclose(levelled(wrong, later, np.eye(4), hills), true, atol=3e-3)
    # another storey, or no ground in common, is none to be level with
    assert np.array_equal(levelled(wrong, later + np.array([0, 0, 3]), np.eye(4), hills), wrong)
    assert np.array_equal(levelled(wrong, later + np.array([500, 0, 0]), np.eye(4), hills), wrong)


def test_ground_that_slopes_in_the_world_is_level_with_itself_wherever_the_lines_of_a_sweep_lie():
    def ground(first_m):
        """Lines across the way, on a plane that rises by 9 cm a metre, as for a lidar that is mounted with pitch."""
        x, y = np.meshgrid(np.arange(first_m, 20, 2.3), np.arange(-20, 20, 0.2))
        return np.column_stack([x.ravel(), y.ravel(), 0.09 * x.ravel() + 0.03 * y.ravel() - 1.7])

    before, later = ground(-20.0), ground(-19.6)
    np.testing.assert_allclose(levelled(np.eye(4), later, np.eye(4), before), np.eye(4), atol=1e-9)


def test_points_stand_above_the_lowest_of_their_column():
    generator = np.random.default_rng(1)
    xyz = generator.uniform([-4, -4, -2], [4, 4, 0], (400, 3))
    standing, low = split_standing(xyz)
    expected = [
        z - min(c for a, b, c in xyz if np.floor(a) == np.floor(x) and np.floor(b) == np.floor(y)) > 0.3
        for x, y, z in xyz
    ]
    np.testing.assert_array_equal(standing, xyz[expected])
    np.testing.assert_array_equal(low, xyz[~np.array(expected)])
