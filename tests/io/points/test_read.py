import os
import sys

import numpy as np
import pytest

import ldls
from ldls.io.points import READERS

SUFFIXES = list(READERS)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_is_no_regular_file_is_refused(tmp_path, suffix):
    folder, pipe, device = (tmp_path / f"{name}{suffix}" for name in ("folder", "pipe", "device"))
    folder.mkdir()
    os.mkfifo(pipe)
    device.symlink_to("/dev/zero")
    for path, kind in ((folder, "a folder"), (pipe, "a pipe"), (device, "a device")):
        with pytest.raises(ldls.FileFormatError, match=f"{path.name}: expected a regular file, got {kind}"):
            ldls.read_points(path)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_an_empty_file_is_no_cloud(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    path.touch()
    with pytest.raises(ldls.FileFormatError, match=f"a{suffix}: "):
        ldls.read_points(path)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_zeros_and_noise_are_named_errors(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    for content in (bytes(1001), np.random.default_rng(0).bytes(1001)):
        path.write_bytes(content)
        with pytest.raises(ldls.FileFormatError, match=f"a{suffix}"):
            ldls.read_points(path)


def test_suffixes_may_be_capitals(tmp_path):
    (tmp_path / "A.CSV").write_text("1,2,3\n")
    assert ldls.read_points(tmp_path / "A.CSV").tolist() == [[1, 2, 3]]


def test_options_of_bin_files_are_refused_elsewhere(tmp_path):
    (tmp_path / "a.csv").write_text("1,2,3\n")
    for options in ({"columns": 4}, {"recover": True}):
        with pytest.raises(ldls.ParameterError, match="a.csv; leave them out"):
            ldls.read_points(tmp_path / "a.csv", **options)


def test_a_missing_library_names_its_extra(tmp_path, monkeypatch):
    header = b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nPOINTS 1\nDATA binary_compressed\n"
    (tmp_path / "a.pcd").write_bytes(header + np.array([2, 12], "<u4").tobytes() + b"ab")
    monkeypatch.setitem(sys.modules, "lzf", None)
    with pytest.raises(ImportError, match=r"ldls\[pcd\]"):
        ldls.read_points(tmp_path / "a.pcd")


@pytest.mark.parametrize("columns", [6, 8])
def test_rows_of_more_columns_are_not_taken_for_four(tmp_path, columns):
    cloud = np.zeros((120, columns), np.float32)
    cloud[:, :4] = np.random.default_rng(0).uniform(-40, 40, (120, 4))
    # a time in double precision fills two of them
    cloud[:, columns - 2 :] = (1.7e9 + np.linspace(0, 977, 120))[:, None].view(np.float32)
    cloud.tofile(tmp_path / "a.bin")
    with pytest.raises(ldls.FileFormatError, match=rf"a\.bin: guessed 4 floats a point, .*; pass columns={columns} "):
        ldls.read_points(tmp_path / "a.bin")
    np.testing.assert_array_equal(ldls.read_points(tmp_path / "a.bin", columns=columns)[:, :4], cloud[:, :4])
