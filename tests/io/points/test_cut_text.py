"""Clouds in text, cut at every byte: no number of what is left is another than it was."""

import numpy as np
import pytest

import ldls

ROWS = np.array([[-12.25, 3.5e-3, 107.125], [4.0, -0.015625, 60.5], [1234.5, 10.75, -8.125]], np.float32)
BODY = "".join(f"{x} {y} {z}\n" for x, y, z in ROWS.tolist())
PCD = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 3\nHEIGHT 1\nPOINTS 3\nDATA ascii\n"
PLY = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nend_header\n"


@pytest.mark.parametrize(
    ("name", "header"),
    [
        pytest.param("a.pcd", PCD, id="PCD"),
        pytest.param("a.ply", PLY, id="PLY"),
        pytest.param("a.csv", "x y z\n", id="text with names"),
        pytest.param("a.xyz", "", id="text"),
    ],
)
def test_a_cut_within_the_last_number_gives_no_wrong_value(tmp_path, name, header):
    path, body = tmp_path / name, BODY.encode()
    for cut in range(len(body)):
        path.write_bytes(header.encode() + body[:cut])
        # only text without a count may end after any of its lines
        if path.suffix in (".csv", ".xyz") and (header.encode() + body[:cut]).endswith(b"\n"):
            np.testing.assert_array_equal(ldls.read_points(path), ROWS[: body[:cut].count(b"\n")])
        else:
            with pytest.raises(ldls.FileFormatError, match=name):
                ldls.read_points(path)
    path.write_bytes(header.encode() + body)
    np.testing.assert_array_equal(ldls.read_points(path), ROWS)


@pytest.mark.parametrize(("name", "header"), [("a.pcd", PCD), ("a.ply", PLY), ("a.csv", "x y z\n"), ("a.txt", "")])
def test_a_file_that_ends_with_a_number_says_how_to_mend_it(tmp_path, name, header):
    path = tmp_path / name
    path.write_text(header + BODY.rstrip())
    message = rf"{name}: line {header.count(chr(10)) + 3}: the file ends with '-8.125', .*add a line end if the file is"
    with pytest.raises(ldls.TruncatedFileError, match=message):
        ldls.read_points(path)
