"""Text without a header: colours and normals do not land in the intensity."""

import numpy as np
import pytest

import ldls

XYZ = np.array([[1.5, -2.25, 0.5], [20.0, 3.0, -1.0], [7.0, 8.0, 9.5]])
INTENSITY = np.array([[0.3], [12.0], [200.5]])
COLOURS = np.array([[255, 0, 12], [40, 41, 42], [0, 0, 0]])
NORMALS = np.array([[1.0, 0, 0], [0, 0.6, 0.8], [0, 0, -1]])
LABELS = np.array([[1.0], [2], [3]])
BYTES = np.array([[17.0], [250], [0]])
RETURNS = np.array([[1, 1, 7], [1, 2, 8], [2, 2, 9]])


@pytest.mark.parametrize(
    ("columns", "n_kept"),
    [
        pytest.param((XYZ, COLOURS), 3, id="colours"),
        pytest.param((XYZ, COLOURS, LABELS), 3, id="colours and a label"),
        pytest.param((XYZ, NORMALS), 3, id="normals"),
        pytest.param((XYZ, COLOURS, NORMALS), 3, id="colours and normals"),
        pytest.param((XYZ, INTENSITY), 4, id="intensity"),
        pytest.param((XYZ, INTENSITY, COLOURS), 4, id="intensity and colours"),
        pytest.param((XYZ, COLOURS, BYTES), 3, id="colours and an intensity of whole numbers"),
        pytest.param((XYZ, COLOURS, COLOURS), 3, id="two colours"),
        pytest.param((XYZ, INTENSITY, NORMALS), 4, id="intensity and normals"),
        pytest.param((XYZ, INTENSITY, RETURNS), 7, id="intensity and numbers of returns"),
        pytest.param((XYZ, RETURNS), 6, id="numbers of returns"),
        pytest.param((XYZ,), 3, id="places alone"),
    ],
)
def test_colours_and_normals_are_left_out(tmp_path, columns, n_kept):
    rows = np.hstack(columns)
    path = tmp_path / "a.xyz"
    np.savetxt(path, rows, fmt="%.10g")
    np.testing.assert_allclose(ldls.read_points(path), rows[:, :n_kept])
