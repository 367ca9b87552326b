import numpy as np
import pytest
from scipy.spatial import KDTree

import ldls
from datasets.layouts import ascii_body

pypcd4 = pytest.importorskip("pypcd4", reason="the extra pcd is not installed")

NAMES = ("x", "y", "z", "intensity")
ROWS = np.tile(np.random.default_rng(1).normal(size=(5, 4)), (8, 1)).astype(np.float32)  # what packs well
ROWS[::7, 2] = np.nan
HEADER = {
    "VERSION": "0.7", "FIELDS": "x y z intensity", "SIZE": "4 4 4 4", "TYPE": "F F F F", "COUNT": "1 1 1 1",
    "WIDTH": "40", "HEIGHT": "1", "VIEWPOINT": "0 0 0 1 0 0 0", "POINTS": "40", "DATA": "binary",
}  # fmt: skip


def header(**changes):
    lines = HEADER | changes
    return "".join(f"{key} {value}\n" for key, value in lines.items() if value is not None).encode()


def packed(rows=ROWS, **sizes):
    import lzf

    columns = np.ascontiguousarray(rows.T).tobytes()
    content = lzf.compress(columns)
    two = np.array([sizes.get("packed", len(content)), sizes.get("unpacked", len(columns))], "<u4")
    return header(DATA="binary_compressed") + two.tobytes() + content


def write(tmp_path, content):
    (tmp_path / "a.pcd").write_bytes(content)
    return tmp_path / "a.pcd"


@pytest.mark.parametrize("encoding", ["ASCII", "BINARY", "BINARY_COMPRESSED"])
@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_files_of_another_writer(tmp_path, encoding, kind):
    flat = np.tile(ROWS[1:2], (100, 1)).astype(kind)
    cloud = pypcd4.PointCloud.from_points(flat, NAMES, (kind,) * 4)
    cloud.save(tmp_path / "a.pcd", getattr(pypcd4.Encoding, encoding))
    points = ldls.read_points(tmp_path / "a.pcd")
    tolerance = 1e-6 if encoding == "ASCII" else 0
    np.testing.assert_allclose(points, flat, rtol=0, atol=tolerance)
    assert points.dtype == kind


@pytest.mark.parametrize(
    "content",
    [
        pytest.param(header(DATA="ascii") + ascii_body(ROWS), id="ascii with nan"),
        pytest.param((header(DATA="ascii") + ascii_body(ROWS)).replace(b"\n", b"\r\n"), id="ascii, CRLF"),
        pytest.param(header().replace(b"\n", b"\r\n") + ROWS.tobytes(), id="binary, CRLF"),
        pytest.param(header() + ROWS.tobytes(), id="binary"),
        pytest.param(packed(), id="packed"),
        pytest.param(b"# .PCD v.7\n" + header(COUNT=None, VERSION=".7") + ROWS.tobytes(), id="no COUNT"),
        pytest.param(header(WIDTH="8", HEIGHT="5") + ROWS.tobytes(), id="with rows"),
        pytest.param(header(POINTS=None) + ROWS.tobytes(), id="no POINTS"),
        pytest.param(
            header(FIELDS="_ x y z _ intensity _", SIZE="1 4 4 4 2 4 1", TYPE="U F F F U F U", COUNT="3 1 1 1 2 1 5")
            + np.concatenate(
                [
                    np.zeros((40, 3), "u1"),
                    ROWS[:, :3].copy().view("u1"),
                    np.zeros((40, 4), "u1"),
                    ROWS[:, 3:].copy().view("u1"),
                    np.zeros((40, 5), "u1"),
                ],
                axis=1,
            ).tobytes(),
            id="padding",
        ),
    ],
)
def test_variants_of_a_file(tmp_path, content):
    points = ldls.read_points(write(tmp_path, content))
    np.testing.assert_array_equal(points, ROWS)
    assert points.dtype == np.float32


def test_fields_of_other_types_and_places(tmp_path):
    rows = np.rec.fromarrays([np.arange(3, dtype="u1"), *np.arange(9, dtype="<f8").reshape(3, 3)], names="i,z,y,x")
    content = header(FIELDS="Intensity z y x", SIZE="1 8 8 8", TYPE="U F F F", WIDTH="3", POINTS="3")
    points = ldls.read_points(write(tmp_path, content + rows.tobytes()))
    np.testing.assert_array_equal(points, np.stack([rows.x, rows.y, rows.z, rows.i], axis=1))
    assert points.dtype == np.float64


def test_a_cloud_without_points(tmp_path):
    for encoding in ("ascii", "binary", "binary_compressed"):
        content = header(WIDTH="0", POINTS="0", DATA=encoding)
        assert ldls.read_points(write(tmp_path, content)).shape == (0, 4)


@pytest.mark.parametrize(
    ("content", "error", "message"),
    [
        pytest.param(header(POINTS="41"), ldls.CorruptFileError, "POINTS 41, WIDTH 40 x HEIGHT 1 is 40", id="counts"),
        pytest.param(
            header(POINTS="4000000000", WIDTH="4000000000") + ROWS.tobytes(),
            ldls.TruncatedFileError,
            "POINTS 4000000000 need 64000000000 bytes after DATA binary, the file has 640",
            id="4e9 points",
        ),
        pytest.param(
            header(POINTS="4000000000", WIDTH="4000000000", DATA="ascii"),
            ldls.TruncatedFileError,
            "has 0",
            id="4e9, ascii",
        ),
        pytest.param(header() + ROWS.tobytes()[:-1], ldls.TruncatedFileError, "640 bytes .* has 639", id="cut"),
        pytest.param(header() + bytes(700), ldls.CorruptFileError, "has 700; mend the header", id="more than said"),
        pytest.param(header(DATA="ascii") + b"1 2 3 4\n" * 39, ldls.TruncatedFileError, "has 39", id="cut, ascii"),
        pytest.param(header(DATA="ascii") + b"1 2 3 4\n" * 41, ldls.CorruptFileError, "has 41", id="more, ascii"),
        pytest.param(
            header(DATA="ascii") + b"1 2 3 4\n" * 39 + b"1 2 3 4 5\n",
            ldls.CorruptFileError,
            "line 50: expected 4 cells, got 5",
            id="a long row",
        ),
        pytest.param(
            header(DATA="ascii") + b"1 2 3 4\n" * 39 + b"1 2 oops 4",
            ldls.CorruptFileError,
            "line 50: .*oops",
            id="word",
        ),
        pytest.param(header(COUNT="1 1 1 0"), ldls.CorruptFileError, "field intensity: COUNT 0", id="COUNT 0"),
        pytest.param(
            header(COUNT="1 1 1 2147483648"), ldls.CorruptFileError, "8589934604 bytes a point", id="COUNT 2^31"
        ),
        pytest.param(header(COUNT="2 1 1 1"), ldls.CorruptFileError, "COUNT of x is 2, expected 1", id="two x"),
        pytest.param(header(COUNT="1 1 1 -1"), ldls.CorruptFileError, "expected a whole number from 0", id="COUNT -1"),
        pytest.param(header(TYPE="F F F C"), ldls.CorruptFileError, "field intensity: TYPE and SIZE C 4", id="TYPE"),
        pytest.param(header(SIZE="4 4 4 3"), ldls.CorruptFileError, "TYPE and SIZE F 3", id="SIZE"),
        pytest.param(header(SIZE="4 4 4"), ldls.CorruptFileError, "4 FIELDS, 3 of SIZE", id="lengths"),
        pytest.param(header(FIELDS=None), ldls.CorruptFileError, "0 FIELDS, 4 of SIZE", id="no FIELDS"),
        pytest.param(header(FIELDS="a y z i"), ldls.CorruptFileError, "column x is missing", id="no x"),
        pytest.param(header(WIDTH=None, POINTS=None), ldls.CorruptFileError, "neither POINTS nor WIDTH", id="no size"),
        pytest.param(header(POINTS="many"), ldls.CorruptFileError, "POINTS: expected a whole number", id="word count"),
        pytest.param(b"POINTS 1\n" + header(), ldls.CorruptFileError, "line 10: POINTS stands there twice", id="twice"),
        pytest.param(header(DATA="zip"), ldls.UnsupportedFormatError, "DATA 'zip'", id="encoding"),
        pytest.param(header(DATA=None), ldls.CorruptFileError, "no line 'DATA'", id="no DATA"),
        pytest.param(header(DATA="binary_compressed") + b"abc", ldls.TruncatedFileError, "two sizes", id="no sizes"),
        pytest.param(packed(packed=10_000), ldls.TruncatedFileError, "packed size 10000", id="packed size lies"),
        pytest.param(
            packed(unpacked=10_000), ldls.CorruptFileError, "unpacked size 10000, exp", id="unpacked size lies"
        ),
        pytest.param(packed(packed=5), ldls.CorruptFileError, "5 packed bytes cannot hold 640", id="ratio"),
        pytest.param(packed(packed=100), ldls.CorruptFileError, "unpacks to|compressed data", id="cut stream"),
        pytest.param(packed()[:-9], ldls.TruncatedFileError, "packed size", id="cut file"),
    ],
)
def test_faults_of_pcd_are_named(tmp_path, content, error, message):
    with pytest.raises(error, match=f"a.pcd.*({message})"):
        ldls.read_points(write(tmp_path, content))


def test_a_header_without_types_is_refused(tmp_path):
    with pytest.raises(ldls.CorruptFileError, match="a.pcd: 4 FIELDS, 0 of TYPE; expected as many"):
        ldls.read_points(write(tmp_path, header(TYPE=None) + ROWS.tobytes()))


@pytest.mark.parametrize("value", ["1.5", "-1", "256", "nan", "1e30"])
def test_numbers_that_a_field_of_whole_numbers_cannot_hold_are_named(tmp_path, value):
    content = header(WIDTH="2", POINTS="2", DATA="ascii", SIZE="4 4 4 1", TYPE="F F F U")
    with pytest.raises(ldls.CorruptFileError, match="intensity of point 1 is .*, expected whole numbers 0 to 255"):
        ldls.read_points(write(tmp_path, content + f"1 2 3 255\n1 2 3 {value}\n".encode()))


def test_zeros_that_make_a_page_with_the_header_are_padding(tmp_path):
    cloud = np.arange(12, dtype=np.float32).reshape(4, 3)
    head = b"VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 4\nHEIGHT 1\nPOINTS 4\nDATA binary\n"
    path = tmp_path / "a.pcd"
    path.write_bytes(head + cloud.tobytes() + bytes(4096 - len(head)))
    np.testing.assert_array_equal(ldls.read_points(path), cloud)
    path.write_bytes(head + cloud.tobytes() + bytes(4095 - len(head)) + b"\1")
    with pytest.raises(ldls.CorruptFileError, match="mend the header"):
        ldls.read_points(path)


def test_early_versions_call_fields_columns(tmp_path):
    content = header().replace(b"FIELDS", b"COLUMNS")
    np.testing.assert_array_equal(ldls.read_points(write(tmp_path, content + ROWS.tobytes())), ROWS)


def test_text_with_commas_and_the_digits_of_utm(tmp_path):
    head = "VERSION .7\nFIELDS x y z i\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 2\nWIDTH 2\nPOINTS 2\nDATA ascii\n"
    path = tmp_path / "a.pcd"
    path.write_text(f"{head}289814.15,4320978.61,170.76,1,2\n289814.64,4320978.84,170.76,3,4\n")
    points = ldls.read_points(path)
    # a field of several values is no intensity
    assert points.dtype == np.float64 and points.tolist() == [
        [289814.15, 4320978.61, 170.76],
        [289814.64, 4320978.84, 170.76],
    ]


@pytest.mark.parametrize(
    ("name", "n_points"),
    [("padded_pcl.pcd", 110), ("padded_intensity.pcd", 213), ("commas.pcd", 10), ("count_4.pcd", 8)],
)
def test_files_of_others(data_folder, name, n_points):
    points = ldls.read_points(data_folder / "real/clouds" / name)
    assert len(points) == n_points and np.isfinite(points[:, :3]).all()


@pytest.mark.parametrize("number", range(4))
def test_sweeps_of_others_hold_the_boards_cut_out_of_them(data_folder, number):
    sweep, board = (ldls.read_points(data_folder / f"real/boards/{name}{number}.pcd") for name in ("", "plane"))
    kept = sweep[np.isfinite(sweep).all(axis=1), :3]
    # the cut-out was written as text
    distances, _ = KDTree(kept).query(board[:, :3])
    assert len(board) > 100 and distances.max() < 1e-7
