"""`.npy` files that lie or are cut: the same refusals from every reader of them."""

import tracemalloc
import zipfile

import numpy as np
import pytest

import ldls
from ldls.io.arrays import open_npz, read_npy, write_npz
from ldls.io.labels.squeezeseg import read_squeezeseg

READERS = {"points": ldls.read_points, "masks": ldls.read_masks, "squeezeseg": read_squeezeseg}


def npy(text, version=b"\x01\x00", length=None):
    sizes = 2 if version == b"\x01\x00" else 4
    return b"\x93NUMPY" + version + (len(text) if length is None else length).to_bytes(sizes, "little") + text


def header(shape, descr="'<f4'", order="False"):
    return f"{{'descr': {descr}, 'fortran_order': {order}, 'shape': {shape}, }}\n".encode()


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize(
    ("content", "error"),
    [
        pytest.param(b"", ldls.CorruptFileError, id="empty"),
        pytest.param(b"\x93NUM", ldls.CorruptFileError, id="cut in the first word"),
        pytest.param(npy(header((5, 4)))[:9], ldls.CorruptFileError, id="cut before the header"),
        pytest.param(npy(header((5, 4))[:20]), ldls.CorruptFileError, id="header that ends too early"),
        pytest.param(npy(header((5, 4)), length=9999), ldls.CorruptFileError, id="header cut off"),
        pytest.param(npy(b"(" * 200 + b"\n"), ldls.CorruptFileError, id="brackets that do not close"),
        pytest.param(npy(b"-" * 9000 + b"1\n"), ldls.CorruptFileError, id="signs without end"),
        pytest.param(npy(b"{'a'"), ldls.CorruptFileError, id="tokens that end"),
        pytest.param(npy(b" 1 +\\"), ldls.CorruptFileError, id="line that goes on"),
        pytest.param(npy(b"\xff" * 50), ldls.CorruptFileError, id="no text"),
        pytest.param(npy(header((5, 4)) + b" " * 59_999), ldls.CorruptFileError, id="long header"),
        pytest.param(npy(b"{}", b"\x02\x00", length=2**32 - 1), ldls.CorruptFileError, id="header of 4 GB"),
        pytest.param(npy(header((10**12, 4))), ldls.TruncatedFileError, id="shape of 16 TB"),
        pytest.param(npy(header((2**62, 2**62))), ldls.TruncatedFileError, id="shape beyond 64 bits"),
        pytest.param(npy(header((10**30,))), ldls.TruncatedFileError, id="side beyond 64 bits"),
        pytest.param(npy(header((10**30, 0))), ldls.CorruptFileError, id="side beyond 64 bits of nothing"),
        pytest.param(npy(header((-1, 4))), ldls.CorruptFileError, id="negative side"),
        pytest.param(npy(header("('a',)")), ldls.CorruptFileError, id="side in letters"),
        pytest.param(npy(header((10**12,), "'<U0'")), ldls.TruncatedFileError, id="entries of no bytes"),
        pytest.param(npy(header((1,), "'<U99999999'")), ldls.TruncatedFileError, id="entry of 400 MB"),
        pytest.param(npy(header((1,), "'<U99999999999'")), ldls.CorruptFileError, id="entry that no type has"),
        pytest.param(npy(header((1,), "[('a', '<f4'), ('a', '<f4')]")), ldls.CorruptFileError, id="field twice"),
        pytest.param(npy(header((5, 4), order="7")), ldls.CorruptFileError, id="order that is none"),
        pytest.param(npy(header((5, 4))) + bytes(79), ldls.TruncatedFileError, id="last byte missing"),
        pytest.param(npy(header((1,), "'|O'")) + bytes(99), ldls.UnsafeFileError, id="objects"),
    ],
)
def test_cut_and_lying_headers_are_refused_before_memory_is_taken(tmp_path, reader, content, error):
    path = tmp_path / "a.npy"
    path.write_bytes(content)
    tracemalloc.start()
    try:
        with pytest.raises(error, match=r"a\.npy: "):
            READERS[reader](path)
        assert tracemalloc.get_traced_memory()[1] < 16 << 20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    "array",
    [
        pytest.param(np.arange(20.0).reshape(5, 4), id="rows"),
        pytest.param(np.asfortranarray(np.arange(20.0).reshape(5, 4)), id="columns"),
        pytest.param(np.arange(6, dtype=">i2"), id="big-endian"),
        pytest.param(np.array(5), id="no axis"),
        pytest.param(np.zeros((0, 3)), id="empty"),
        pytest.param(np.zeros((2, 3), "U0"), id="entries of no bytes"),
        pytest.param(np.array([(1, 2.5)], [("a", "i4"), ("b", "f8")]), id="fields"),
        pytest.param(np.arange(3 << 20, dtype=np.uint8), id="several chunks"),
    ],
)
def test_arrays_are_read_as_numpy_reads_them(tmp_path, array):
    np.save(tmp_path / "a.npy", array)
    found, expected = read_npy(tmp_path / "a.npy"), np.load(tmp_path / "a.npy")
    np.testing.assert_array_equal(found, expected)
    assert found.dtype == expected.dtype
    assert found.flags.f_contiguous == expected.flags.f_contiguous
    assert found.flags.writeable


def test_what_does_not_get_half_as_large_is_stored_as_it_stands(tmp_path):
    generator = np.random.default_rng(0)
    arrays = {
        "coordinates": generator.normal(size=(20_000, 4)).astype(np.float32),
        "columns_first": np.asfortranarray(generator.normal(size=(20_000, 3))),
        "labels": np.repeat(np.arange(20, dtype=np.int32), 1000),
        "names": np.array(["car", "person"] * 500),
        "empty": np.zeros((0, 3)),
        "text": np.array("{}"),
    }
    write_npz(tmp_path / "a.npz", arrays)
    with zipfile.ZipFile(tmp_path / "a.npz") as archive:
        stored = {member.filename for member in archive.infolist() if member.compress_type == zipfile.ZIP_STORED}
    assert {"coordinates.npy", "columns_first.npy"} <= stored
    assert not stored & {"labels.npy", "names.npy"}
    with open_npz(tmp_path / "a.npz", "arrays") as read:
        for name, array in arrays.items():
            np.testing.assert_array_equal(read[name], array)
