import numpy as np
import pytest

import ldls
from datasets.layouts import ascii_body

ROWS = np.array([[1.5, -2, 3, 0.25], [4, 5, 6, 0.5], [np.nan, 8, 9, 1]], np.float32)
NAMES = ("x", "y", "z", "intensity")


def header(encoding, count=3, properties=tuple(f"float {name}" for name in NAMES), before=(), after=()):
    lines = ["ply", f"format {encoding} 1.0", "comment by hand", *before, f"element vertex {count}"]
    return "\n".join([*lines, *(f"property {one}" for one in properties), *after, "end_header\n"]).encode()


def write(tmp_path, content):
    (tmp_path / "a.ply").write_bytes(content)
    return tmp_path / "a.ply"


FACES = ("element face 1", "property list uchar int vertex_indices")


@pytest.mark.parametrize(
    "content",
    [
        pytest.param(header("ascii") + ascii_body(ROWS), id="ascii"),
        pytest.param(header("binary_little_endian") + ROWS.astype("<f4").tobytes(), id="little endian"),
        pytest.param(header("binary_big_endian") + ROWS.astype(">f4").tobytes(), id="big endian"),
        pytest.param(b"\xef\xbb\xbf" + header("ascii") + ascii_body(ROWS), id="byte order mark"),
        pytest.param((header("ascii") + ascii_body(ROWS)).replace(b"\n", b"\r\n"), id="CRLF, ascii"),
        pytest.param(header("binary_little_endian").replace(b"\n", b"\r\n") + ROWS.tobytes(), id="CRLF, binary"),
        pytest.param(header("ascii") + ascii_body(ROWS) + b"# made by hand\n", id="a comment behind, ascii"),
        pytest.param(
            header("ascii", after=("element edge 1", "property int a")) + ascii_body(ROWS) + b"# edges\n7\n",
            id="a comment before another element, ascii",
        ),
        pytest.param(
            header("ascii", after=FACES) + ascii_body(ROWS) + b"3 0\n1 2\n", id="a face over two lines, ascii"
        ),
        pytest.param(
            header("binary_little_endian", after=FACES) + ROWS.tobytes() + b"\3\0\0\0\0\1\0\0\0\2\0\0\0",
            id="faces after",
        ),
        pytest.param(
            header("binary_big_endian", before=("element camera 2", "property double f", "property uchar id"))
            + bytes(18)
            + ROWS.astype(">f4").tobytes(),
            id="another element before, binary",
        ),
        pytest.param(
            header("ascii", before=("element camera 1", "property double f")) + b"7\n" + ascii_body(ROWS),
            id="another element before, ascii",
        ),
        pytest.param(header("ascii") + ascii_body(ROWS) + b"\n \n", id="blank lines at the end"),
        pytest.param(
            header("binary_little_endian") + ROWS.tobytes() + b"\r\n" * 20, id="white space at the end, binary"
        ),
        pytest.param(header("ascii", after=FACES) + ascii_body(ROWS) + b"3 0 1 2\n", id="faces after, ascii"),
        pytest.param(
            header("binary_little_endian", after=("element edge 2", "property int a", "property int b"))
            + ROWS.tobytes()
            + bytes(16),
            id="another element after, binary",
        ),
        pytest.param(
            header(
                "binary_little_endian",
                properties=("uchar red", "float scalar_Intensity", "float z", "float y", "float x"),
            )
            + np.rec.fromarrays([np.zeros(3, "u1"), *ROWS.T[::-1]]).tobytes(),
            id="another order and names",
        ),
    ],
)
def test_vertices_are_points(tmp_path, content):
    points = ldls.read_points(write(tmp_path, content))
    np.testing.assert_array_equal(points, ROWS)
    assert points.dtype == np.float32


def test_doubles_stay_doubles_and_intensity_may_miss(tmp_path):
    rows = np.array([[500000.123456, 5000000.654321, 1]])
    content = header("binary_little_endian", 1, [f"double {name}" for name in "xyz"]) + rows.tobytes()
    points = ldls.read_points(write(tmp_path, content))
    np.testing.assert_array_equal(points, rows)
    assert points.dtype == np.float64


def test_digits_of_text_that_single_precision_loses_are_kept(tmp_path):
    content = header("ascii", 1, [f"float {name}" for name in "xyz"]) + b"500000.123456 5000000.654321 1\n"
    points = ldls.read_points(write(tmp_path, content))
    np.testing.assert_array_equal(points, [[500000.123456, 5000000.654321, 1]])


def test_a_file_of_results_reads_back(small_scene, tmp_path):
    points, masks, camera = small_scene
    ldls.save(ldls.segment(points, masks, camera), tmp_path / "a.ply")
    np.testing.assert_array_equal(ldls.read_points(tmp_path / "a.ply"), points)


@pytest.mark.parametrize(
    ("content", "error", "message"),
    [
        pytest.param(header("ascii", -1), ldls.CorruptFileError, "line 4: element vertex: .*'-1'", id="minus one"),
        pytest.param(
            header("binary_little_endian", 2_000_000_000) + bytes(24),
            ldls.TruncatedFileError,
            "vertex 2000000000 needs 32000000000 bytes .* has 24; last whole vertex is 1",
            id="2e9 in 24 bytes",
        ),
        pytest.param(
            header("ascii", 2_000_000_000) + b"1 2 3 4\n", ldls.TruncatedFileError, "ends after 1", id="2e9 in ascii"
        ),
        pytest.param(
            header("ascii", 20) + ascii_body(np.ones((10, 4))), ldls.TruncatedFileError, "ends after 10", id="at row 10"
        ),
        pytest.param(
            header("ascii", 1) + b"1 2", ldls.TruncatedFileError, "line 10: expected at least 4 cells", id="in a row"
        ),
        pytest.param(
            header("ascii", 2) + ascii_body(ROWS),
            ldls.CorruptFileError,
            "line 12: the elements of the header have 2 lines, the file has 3; mend the header",
            id="fewer in ascii",
        ),
        pytest.param(
            header("ascii", 2, after=("element edge 1", "property int a")) + ascii_body(ROWS) + b"# edges\n7\n",
            ldls.CorruptFileError,
            "line 16: the elements of the header have 3 lines, the file has 4",
            id="fewer before another element, ascii",
        ),
        pytest.param(
            header("binary_big_endian", 2) + ROWS.astype(">f4").tobytes(),
            ldls.CorruptFileError,
            "header need 32 bytes after it, the file has 48; mend the header",
            id="fewer in binary",
        ),
        pytest.param(
            header("binary_little_endian", 2, after=("element edge 2", "property int a")) + ROWS.tobytes() + bytes(8),
            ldls.CorruptFileError,
            "need 40 bytes after it, the file has 56",
            id="fewer before another element, binary",
        ),
        pytest.param(
            header("binary_little_endian", 2, after=("element face 0", FACES[1])) + ROWS.tobytes(),
            ldls.CorruptFileError,
            "need 32 bytes after it, the file has 48",
            id="fewer before no faces, binary",
        ),
        pytest.param(
            header("ascii", 2) + b"1 2 3 4\n5 6 7 8 9\n",
            ldls.CorruptFileError,
            "line 11: expected 4 cells, got 5: '5 6 7 8 9'",
            id="a long row",
        ),
        pytest.param(
            header("ascii", 2) + b"1 2 3 4 5\n5 6 7 8 9\n",
            ldls.CorruptFileError,
            "line 10: expected 4 cells, got 5",
            id="long rows",
        ),
        pytest.param(
            header("ascii", 1, ("float x", "float y", "float z", "uchar red")) + b"1 2 3 4 5\n",
            ldls.CorruptFileError,
            "line 10: expected 4 cells, got 5",
            id="a long row with columns that are not wanted",
        ),
        pytest.param(header("ascii", 1) + b"1 2 a 4", ldls.CorruptFileError, "line 10: .*'a'", id="word"),
        pytest.param(
            header("ascii", properties=("float x", "float y", "float z", "list uchar int ids")),
            ldls.UnsupportedFormatError,
            "property list 'ids' of element vertex",
            id="list",
        ),
        pytest.param(
            header("ascii", before=FACES),
            ldls.UnsupportedFormatError,
            "'vertex_indices' of element face",
            id="list before",
        ),
        pytest.param(header("ascii")[:-11], ldls.CorruptFileError, "no line 'end_header'", id="no end"),
        pytest.param(header("ascii", properties=("float x",)), ldls.CorruptFileError, "column y is missing", id="no y"),
        pytest.param(header("ascii", properties=("half x",)), ldls.CorruptFileError, "got 'half x'", id="type"),
        pytest.param(header("binary_middle_endian"), ldls.CorruptFileError, "line 2: expected a format", id="format"),
        pytest.param(b"ply\nend_header\n", ldls.CorruptFileError, "names no format", id="bare"),
        pytest.param(
            b"ply\nformat ascii 1.0\nend_header\n", ldls.CorruptFileError, "element vertex, found 0", id="none"
        ),
        pytest.param(b"solid\nend_header\n", ldls.CorruptFileError, "expected 'ply'", id="STL"),
        pytest.param(header("ascii", "9" * 5000), ldls.CorruptFileError, "expected a whole number", id="long count"),
    ],
)
def test_faults_of_ply_are_named(tmp_path, content, error, message):
    with pytest.raises(error, match=f"a.ply.*{message}"):
        ldls.read_points(write(tmp_path, content))
