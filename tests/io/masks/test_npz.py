import zipfile

import numpy as np
import pytest

import ldls
from mask_samples import of_coco, random_masks


def test_the_research_layout_is_the_research_codes(tmp_path):
    masks = of_coco(random_masks(1))
    ldls.save(masks, tmp_path / "masks.npz", layout="research")
    with np.load(tmp_path / "masks.npz") as arrays:
        assert set(arrays) == {"shape", "rois", "masks", "class_ids", "scores"}
        assert tuple(arrays["shape"]) == masks.image_size
        assert arrays["masks"].shape == (*masks.image_size, len(masks))
        for pixels, (top, left, bottom, right) in zip(np.moveaxis(arrays["masks"], 2, 0), arrays["rois"], strict=True):
            assert pixels.sum() == pixels[top:bottom, left:right].sum()
        assert arrays["class_ids"].min() >= 1
        assert arrays["class_ids"].max() <= 80


def test_capitals_do_not_count_in_the_research_layout(tmp_path):
    masks = ldls.InstanceMasks.from_array(np.ones((1, 4, 5), bool), categories=[3], names={3: "Car"})
    ldls.save(masks, tmp_path / "masks.npz", layout="research")
    assert ldls.read_masks(tmp_path / "masks.npz")[0].name == "car"


def test_the_research_layout_knows_only_cocos_categories(tmp_path):
    with pytest.raises(ldls.MaskError, match=r"mask \d: category 10\d '.*' is not COCO's"):
        ldls.save(random_masks(1), tmp_path / "masks.npz", layout="research")
    with pytest.raises(ldls.ParameterError, match="layout: got 'dense', expected one of runs, research"):
        ldls.save(random_masks(1), tmp_path / "masks.npz", layout="dense")
    assert list(tmp_path.iterdir()) == []


def own_arrays(**changes):
    arrays = {
        "size": np.array([4, 5]),
        "runs": np.array([3, 2, 15], np.uint32),
        "run_counts": np.array([3]),
        "categories": np.array([1]),
        "scores": np.array([0.5], np.float32),
        "category_ids": np.array([1]),
        "category_names": np.array(["object"]),
    } | changes
    return {name: array for name, array in arrays.items() if array is not None}


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        pytest.param({"size": np.array([4.0, 5.0])}, ldls.MaskError, "size is", id="size in floats"),
        pytest.param({"size": np.array(4)}, ldls.MaskError, "size is 4", id="one side"),
        pytest.param({"size": np.array([2**20, 2**20])}, ldls.LimitError, "pixels", id="huge image"),
        pytest.param({"runs": np.array([3, -1, 18])}, ldls.MaskError, "runs and run_counts", id="signed runs"),
        pytest.param({"runs": np.array([3, 2], np.uint32)}, ldls.MaskError, "run_counts sum to 3", id="run missing"),
        pytest.param({"runs": np.array([3, 2, 5], np.uint32)}, ldls.MaskError, "runs sum to 10", id="runs too short"),
        pytest.param({"run_counts": np.array([[3]])}, ldls.MaskError, "runs and run_counts", id="counts in a table"),
        pytest.param({"run_counts": np.array([4, -1])}, ldls.MaskError, "run_counts sum", id="negative count"),
        pytest.param({"categories": np.array([0])}, ldls.MaskError, "mask 0: category is 0", id="category 0"),
        pytest.param({"categories": np.array([2])}, ldls.MaskError, "mask 0: category 2 is unknown", id="unknown"),
        pytest.param({"categories": np.array([2**32 + 1])}, ldls.MaskError, "got 4294967297", id="64-bit category"),
        pytest.param({"scores": np.array([np.nan])}, ldls.MaskError, "mask 0: score is nan", id="NaN score"),
        pytest.param({"scores": np.array([1.0, 1])}, ldls.MaskError, "scores: expected one", id="two scores"),
        pytest.param({"category_names": np.array([])}, ldls.MaskError, r"got \(1,\) int64 and \(0,\)", id="no names"),
        pytest.param({"category_ids": np.array(["x"])}, ldls.MaskError, "got .* <U1 and", id="letters as ids"),
        pytest.param({"category_ids": None}, ldls.UnsupportedFormatError, "found arrays", id="an array missing"),
        pytest.param({"scores": np.array([{}])}, ldls.UnsafeFileError, "object arrays", id="pickle"),
    ],
)
def test_faults_of_own_files_are_named(tmp_path, changes, error, message):
    np.savez(tmp_path / "masks.npz", **own_arrays(**changes))
    with pytest.raises(error, match=message) as caught:
        ldls.read_masks(tmp_path / "masks.npz")
    assert "masks.npz" in str(caught.value)


def test_research_masks_with_nan_are_refused(tmp_path):
    arrays = {"masks": np.full((4, 5, 1), np.nan), "class_ids": np.array([1]), "scores": np.array([1.0])}
    np.savez(tmp_path / "masks.npz", **arrays)
    with pytest.raises(ldls.MaskError, match=r"masks\.npz: mask 0: pixel \(0, 0\) is nan"):
        ldls.read_masks(tmp_path / "masks.npz")


def header(shape, dtype="|b1"):
    text = f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()


WANTED = {"class_ids.npy": header((0,)), "scores.npy": header((0,))}
NO_HEADER = b"\x93NUMPY\x01\x00\x05\x00((((("


@pytest.mark.parametrize(
    ("members", "error", "message"),
    [
        pytest.param(
            WANTED | {"masks.npy": header((10**12, 10**6))}, ldls.TruncatedFileError, "needs", id="lying header"
        ),
        pytest.param(
            WANTED | {"masks.npy": header((10**12,), "<U0")}, ldls.TruncatedFileError, "needs", id="entries of no bytes"
        ),
        pytest.param(WANTED | {"masks.npy": NO_HEADER}, ldls.CorruptFileError, "npy", id="no header"),
        pytest.param({"../masks.npy": header((0,))}, ldls.UnsupportedFormatError, "found arrays", id="name with ../"),
        pytest.param({f"{i}.npy": b"" for i in range(1001)}, ldls.LimitError, "1001 arrays", id="many members"),
        pytest.param({"masks.txt": b"no array"}, ldls.UnsupportedFormatError, r"found arrays \[\]", id="no arrays"),
    ],
)
def test_archives_that_lie_are_refused(tmp_path, members, error, message):
    with zipfile.ZipFile(tmp_path / "masks.npz", "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    with pytest.raises(error, match=message):
        ldls.read_masks(tmp_path / "masks.npz")


def test_a_zip_bomb_is_refused_before_it_is_unpacked(tmp_path):
    path = tmp_path / "masks.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in ("masks.npy", "class_ids.npy", "scores.npy"):
            archive.writestr(name, bytes(1 << 20))
    content, size = path.read_bytes(), (1 << 20).to_bytes(4, "little")
    path.write_bytes(content.replace(size, (2**32 - 16).to_bytes(4, "little")))
    with pytest.raises(ldls.LimitError, match=r"masks\.npz: unpacks to 3 arrays of 12884901840 bytes"):
        ldls.read_masks(path)


def write_zeros(path, name, n_bytes, others):
    """Archive with a member of zeros, packed as well as DEFLATE can, beside `others`."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for other, content in others.items():
            archive.writestr(other, content)
        with archive.open(name, "w") as member:
            member.write(header((n_bytes,), "|u1"))
            for start in range(0, n_bytes, 1 << 24):
                member.write(bytes(min(1 << 24, n_bytes - start)))


def forbid_unpacking(monkeypatch):
    def unpack(*arguments):
        raise AssertionError("unpacked")

    monkeypatch.setattr(zipfile.ZipExtFile, "read", unpack)


def test_a_member_of_700_mb_packed_to_its_thousandth_is_refused_before_it_is_unpacked(tmp_path, monkeypatch):
    path = tmp_path / "masks.npz"
    write_zeros(path, "masks.npy", 700_000_000, WANTED)
    assert path.stat().st_size < 720_000
    forbid_unpacking(monkeypatch)
    with pytest.raises(
        ldls.UnsafeFileError, match=r"masks\.npz: masks\.npy: unpacks from 68\d,\d{3} bytes to 700,000,"
    ):
        ldls.read_masks(path)


def test_what_no_reader_wants_is_not_unpacked(tmp_path, monkeypatch):
    path = tmp_path / "masks.npz"
    write_zeros(path, "more.npy", 1_000_000, {})
    forbid_unpacking(monkeypatch)
    with pytest.raises(ldls.UnsupportedFormatError, match=r"masks\.npz: found arrays \['more'\]"):
        ldls.read_masks(path)


def test_masks_without_a_pixel_pack_well_and_are_read(tmp_path):
    nothing = np.zeros((1080, 1920, 60), np.bool_)
    arrays = {"masks": nothing, "class_ids": np.ones(60, np.int32), "scores": np.ones(60, np.float32)}
    np.savez_compressed(tmp_path / "masks.npz", **arrays)
    assert (tmp_path / "masks.npz").stat().st_size * 900 < nothing.nbytes
    assert len(ldls.read_masks(tmp_path / "masks.npz")) == 60


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA], ids=["bzip2", "lzma"])
def test_ways_of_packing_that_numpy_has_not_are_refused(tmp_path, method):
    with zipfile.ZipFile(tmp_path / "masks.npz", "w", method) as archive:
        for name in (*WANTED, "masks.npy"):
            archive.writestr(name, header((0,)))
    with pytest.raises(ldls.UnsupportedFormatError, match=r"packed by method 1[24]"):
        ldls.read_masks(tmp_path / "masks.npz")


def test_a_million_members_are_refused_by_their_list(tmp_path):
    path = tmp_path / "masks.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.npy", b"")
    content = path.read_bytes()
    at = content.index(b"PK\x01\x02")
    entry, end = content[at : content.index(b"PK\x05\x06")], bytearray(content[content.index(b"PK\x05\x06") :])
    million = entry * 1_000_000
    end[12:16] = len(million).to_bytes(4, "little")
    path.write_bytes(content[:at] + million + end)
    with pytest.raises(ldls.LimitError, match=r"masks\.npz: a list of members of 51,000,000 bytes"):
        ldls.read_masks(path)
