import re

import numpy as np
import pytest

import ldls
from ldls.errors import RecoveredFileWarning
from ldls.simulation import sample_frame


def rows(n, columns):
    return np.random.default_rng(0).normal(size=(n, columns)).astype("<f4")


@pytest.mark.parametrize(
    ("name", "columns", "options"),
    [
        pytest.param("sweep.bin", 4, {}, id="KITTI"),
        pytest.param("sweep.pcd.bin", 5, {}, id="nuScenes"),
        pytest.param("SWEEP.PCD.BIN", 5, {}, id="nuScenes, in capitals"),
        pytest.param("sweep.bin", 7, {"columns": 7}, id="seven columns"),
    ],
)
def test_bin_files_hold_rows_of_floats(tmp_path, name, columns, options):
    values = rows(11, columns)
    values.tofile(tmp_path / name)
    points = ldls.read_points(tmp_path / name, **options)
    np.testing.assert_array_equal(points, values)
    assert points.dtype == np.float32
    assert points.flags.writeable, "as points of other formats"


@pytest.mark.parametrize("columns", [3, 4, 5, 6])
@pytest.mark.parametrize("other", [">f4", "<f8", ">f8"])
def test_rows_of_other_numbers_are_refused_with_what_mends_them(tmp_path, other, columns):
    # of as many bytes as some rows of four float32
    n = 1004 if other == ">f4" else 1002
    path, sweep = tmp_path / "sweep.bin", np.resize(sample_frame().points[:n].T, (columns, n)).T
    sweep.astype(other).tofile(path)
    with pytest.raises(ldls.FileFormatError, match=f"as '{other}' none does; write the file anew"):
        ldls.read_points(path)
    np.fromfile(path, other).astype("<f4").tofile(path)
    np.testing.assert_array_equal(ldls.read_points(path, columns=columns), sweep)
    sweep.astype(other).tofile(path)
    if columns == 4:
        assert ldls.read_points(path, columns=columns).tobytes() == path.read_bytes()


def test_npy_files_keep_their_precision(tmp_path):
    values = rows(5, 3).astype(np.float64)
    np.save(tmp_path / "sweep.npy", values)
    np.testing.assert_array_equal(ldls.read_points(tmp_path / "sweep.npy"), values)


def test_an_empty_bin_file_is_a_cloud_without_a_point_where_that_is_asked_for(tmp_path):
    (tmp_path / "sweep.bin").touch()
    with pytest.raises(ldls.TruncatedFileError, match=r"sweep\.bin: empty, expected 4 float32 a point; write it again"):
        ldls.read_points(tmp_path / "sweep.bin")
    with pytest.warns(RecoveredFileWarning, match=r"sweep\.bin: empty"):
        assert ldls.read_points(tmp_path / "sweep.bin", recover=True).shape == (0, 4)


def test_a_truncated_file_says_where_it_ends(tmp_path):
    path = tmp_path / "000123.bin"
    path.write_bytes(rows(11, 4).tobytes()[:167])
    message = r"000123\.bin: 167 bytes is not a multiple of 16.*last whole point ends at 160"
    with pytest.raises(ldls.TruncatedFileError, match=message):
        ldls.read_points(path)
    with pytest.warns(RecoveredFileWarning, match=message):
        points = ldls.read_points(path, recover=True)
    np.testing.assert_array_equal(points, rows(11, 4)[:10])


@pytest.mark.parametrize(
    ("columns", "mend"),
    [
        pytest.param(
            None, "; pass columns= if rows are of another length; else .* have ldls.read_points recover", id="usual"
        ),
        pytest.param(5, "; pass another columns= if rows are of another length; else copy it again", id="given"),
    ],
)
def test_what_mends_a_truncated_file_tells_by_whom_its_columns_are_given(tmp_path, columns, mend):
    path = tmp_path / "000123.bin"
    path.write_bytes(rows(11, 4).tobytes()[:168])
    with pytest.raises(ldls.TruncatedFileError, match=mend):
        ldls.read_points(path, columns=columns)


def test_five_columns_are_not_taken_for_four(tmp_path):
    values = rows(8, 5)
    values[:, 4] = np.arange(8)
    path = tmp_path / "sweep.bin"
    values.tofile(path)
    with pytest.raises(ldls.FileFormatError, match="pass columns=5"):
        ldls.read_points(path)
    np.testing.assert_array_equal(ldls.read_points(path, columns=5), values)
    assert ldls.read_points(path, columns=4).shape == (10, 4)


def sweep(n, columns):
    """Plausible rows: metres, intensity as the sensors of KITTI and of nuScenes give it, and rings."""
    generator = np.random.default_rng(4)
    xyz = generator.normal(0, [20, 20, 1], (n, 3)).round(3)
    intensity = generator.uniform(0, 1, n).round(2) if columns == 4 else generator.integers(0, 256, n)
    return np.column_stack([xyz, intensity, np.arange(n) % 32]).astype("<f4")[:, :columns]


@pytest.mark.parametrize(
    ("name", "n", "columns", "guess"),
    [
        pytest.param("sweep.pcd.bin", 100, 4, 5, id="four for five"),
        pytest.param("sweep.bin", 80, 5, 4, id="five for four"),
    ],
)
def test_a_guess_that_scrambles_the_rows_is_refused(tmp_path, name, n, columns, guess):
    values = sweep(n, columns)
    values.tofile(tmp_path / name)
    message = rf"{re.escape(name)}: guessed {guess} floats.*pass columns={columns} \(or columns={guess} to insist"
    with pytest.raises(ldls.FileFormatError, match=message):
        ldls.read_points(tmp_path / name)
    np.testing.assert_array_equal(ldls.read_points(tmp_path / name, columns=columns), values)
    assert ldls.read_points(tmp_path / name, columns=guess).shape == (400 // guess, guess)


def scan(n):
    """Points as a lidar sees them, in the order of a ring, with an intensity."""
    azimuth = np.linspace(np.pi, -np.pi, n, endpoint=False)
    range_m = 12 + 4 * np.sin(3 * azimuth)
    x, y = range_m * np.cos(azimuth), range_m * np.sin(azimuth)
    return np.column_stack([x, y, np.full(n, -1.7), 0.5 + 0.4 * np.cos(azimuth)]).astype("<f4")


N = 840
MORE = {
    "no intensity": scan(N)[:, :3],
    "time": np.column_stack([scan(N), np.linspace(0, 0.1, N)]),
    "ring and time": np.column_stack([scan(N), np.arange(N) // 100, np.linspace(0, 0.1, N)]),
    "velocities": np.column_stack([scan(N), np.random.default_rng(0).normal(0, 0.2, (N, 3))]),
    "as PCL pads them": np.insert(scan(N), [3, 4, 4, 4], [1, 0, 0, 0], axis=1),
}


@pytest.mark.parametrize("values", MORE.values(), ids=MORE)
def test_a_sweep_of_another_width_is_refused_with_its_width(tmp_path, values):
    columns = values.shape[1]
    values.astype("<f4").tofile(tmp_path / "sweep.bin")
    message = rf"sweep\.bin: guessed 4 floats a point.*pass columns={columns} \(or columns=4 to insist"
    with pytest.raises(ldls.FileFormatError, match=message):
        ldls.read_points(tmp_path / "sweep.bin")
    np.testing.assert_array_equal(ldls.read_points(tmp_path / "sweep.bin", columns=columns), values.astype("<f4"))
    assert ldls.read_points(tmp_path / "sweep.bin", columns=4).shape[1] == 4


@pytest.mark.parametrize("n", [1, 2, 3, 32, 33, 60, N])
@pytest.mark.parametrize(
    "change",
    [
        pytest.param(lambda values: values, id="of a lidar"),
        pytest.param(np.random.default_rng(0).permutation, id="in no order"),
        pytest.param(lambda values: values * (np.arange(len(values)) % 2 > 0)[:, None], id="every second is zero"),
        pytest.param(lambda values: values * [1, 1, 1, 0], id="no intensity"),
        pytest.param(lambda values: np.where(np.arange(len(values))[:, None] % 3, np.nan, values), id="NaN"),
        pytest.param(lambda values: values * 0, id="zeros"),
        pytest.param(lambda values: values[:1].repeat(len(values), axis=0), id="one place"),
        pytest.param(lambda values: values[np.argsort(values[:, 2] + values[:, 3])], id="by height"),
    ],
)
def test_rows_of_four_are_read_whatever_their_points(tmp_path, n, change):
    values = change(scan(N)[:: N // n][:n]).astype("<f4")
    values.tofile(tmp_path / "sweep.bin")
    np.testing.assert_array_equal(ldls.read_points(tmp_path / "sweep.bin"), values)


@pytest.mark.parametrize("n", [1, 2, 3])
def test_a_few_points_of_which_one_is_far_away_are_not_of_other_numbers(tmp_path, n):
    values = np.array([[1e9, 1.5, 2, 0], [1, 2, 3, 0], [1, 2, 3, 0]], "<f4")[:n]
    values.tofile(tmp_path / "sweep.bin")
    np.testing.assert_array_equal(ldls.read_points(tmp_path / "sweep.bin"), values)


@pytest.mark.parametrize("name, columns", [("sweep.pcd.bin", 5), ("sweep.bin", 4)])
@pytest.mark.parametrize("zeros", [False, True], ids=["a sweep", "nothing but zeros"])
def test_a_guess_that_fits_stands_though_the_other_divides(tmp_path, name, columns, zeros):
    values = sweep(400 // columns, columns) * (not zeros)
    values.tofile(tmp_path / name)
    np.testing.assert_array_equal(ldls.read_points(tmp_path / name), values)


def test_real_nuscenes_points_have_five_columns(data_folder):
    (path,) = (data_folder / "nuscenes").glob("*.pcd.bin")
    assert ldls.read_points(path).shape == (34688, 5)


@pytest.mark.parametrize(
    ("name", "content", "error", "message"),
    [
        pytest.param("a.obj", b"", ldls.UnsupportedFormatError, "expected .bin, .npy, .pcd", id="suffix"),
        pytest.param("a.npy", b"", ldls.CorruptFileError, "got an empty one", id="empty npy"),
        pytest.param("a.npy", b"\x93NUMPY\1\0", ldls.CorruptFileError, "whole .npy", id="cut npy"),
        pytest.param("a.npy", b"hello there", ldls.FileFormatError, "a.npy", id="no npy"),
    ],
)
def test_files_that_cannot_be_read_are_named(tmp_path, name, content, error, message):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(error, match=message):
        ldls.read_points(tmp_path / name)


def test_arrays_that_are_no_cloud_are_named_with_their_file(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros((3, 100)))
    with pytest.raises(ldls.ShapeError, match="a.npy: points: .*transpose"):
        ldls.read_points(tmp_path / "a.npy")
    np.save(tmp_path / "b.npy", np.array([{}]), allow_pickle=True)
    with pytest.raises(ldls.UnsafeFileError, match="b.npy"):
        ldls.read_points(tmp_path / "b.npy")


def test_missing_files_and_folders(tmp_path):
    with pytest.raises(FileNotFoundError):
        ldls.read_points(tmp_path / "none.bin")
    with pytest.raises(ldls.FileFormatError, match="expected a regular file"):
        ldls.read_points(tmp_path)


def test_bits_that_are_no_number_make_no_warning(tmp_path):
    values = np.full(20, 0x7FA00000, "<u4")  # a signalling NaN
    (tmp_path / "sweep.bin").write_bytes(values.tobytes())
    assert np.isnan(ldls.read_points(tmp_path / "sweep.bin")).all()
    values = np.column_stack([sweep(98, 4), np.full((98, 2), 1e9, "<f4")])
    values.view("<u4")[7, 0] = 0x7FA00000
    values.tofile(tmp_path / "sweep.bin")
    with pytest.raises(ldls.FileFormatError, match="points lie farther"):
        ldls.read_points(tmp_path / "sweep.bin")
