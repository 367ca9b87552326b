"""Clouds whose files become shorter while they are read."""

import numpy as np
import pytest

import ldls
from ldls.io.files import InputFile

ROWS = np.random.default_rng(5).uniform(-9, 9, (64, 4)).round(2).astype(np.float32)
WRITERS = {
    "a.bin": lambda path, _: ROWS.tofile(path),
    "a.npy": lambda path, _: np.save(path, ROWS),
    "a.txt": lambda path, _: np.savetxt(path, ROWS),
    "a.pcd": lambda path, result: ldls.save(result, path),
    "a.ply": lambda path, result: ldls.save(result, path),
    "a.las": lambda path, result: ldls.save(result, path),
    "a.laz": lambda path, result: ldls.save(result, path),
}


@pytest.mark.parametrize("name", WRITERS)
def test_a_file_that_shrinks_while_it_is_read_is_refused(tmp_path, monkeypatch, small_scene, name):
    if name in ("a.las", "a.laz"):
        pytest.importorskip("lazrs", reason="the extra las is not installed")
    if name == "a.pcd":
        pytest.importorskip("pypcd4", reason="the extra pcd is not installed")
    path = tmp_path / name
    WRITERS[name](path, ldls.segment(*small_scene))
    ldls.read_points(path)
    half = path.stat().st_size // 32 * 16

    def shrinking(read):
        def shrink(file, *size):
            with path.open("r+b") as writer:
                writer.truncate(half)
            return read(file, *size)

        return shrink

    for name_of_read in ("read", "array"):
        monkeypatch.setattr(InputFile, name_of_read, shrinking(getattr(InputFile, name_of_read)))
    with pytest.raises(ldls.FileFormatError, match=name):
        ldls.read_points(path)
