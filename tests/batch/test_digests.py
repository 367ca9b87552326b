"""Results and inputs that were changed behind a run's back are noticed by their digests."""

import hashlib
import os
from pathlib import Path

import pytest

from batch import runs
from command import command
from ldls import batch
from ldls.batch import known_files
from ldls.errors import BatchError, ChangedFileWarning
from ldls.segmenters import SEGMENTERS, BoxSegmenter


def run(source, out, **settings):
    settings = {"masks": str(source / "masks"), **settings}
    return batch.run(source, out, batch.RunSettings(**settings))


def overwrite(path):
    """Change one bit of a file, and neither its size nor its time."""
    before = path.stat()
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert path.stat().st_mtime_ns == before.st_mtime_ns


def test_a_result_overwritten_with_as_many_other_bytes_is_made_again(few, tmp_path):
    out = tmp_path / "out"
    run(few, out, formats=("label", "ply"))
    before = runs.contents(out)
    overwrite(out / "000003.label")
    overwrite(out / "000007.ply")
    with pytest.warns(ChangedFileWarning, match=r"files of 2 frames were changed .* \(000003, 000007\).* done again"):
        summary = run(few, out, formats=("label", "ply"))
    assert summary.n_earlier == 10
    assert runs.contents(out) == before


def test_the_command_says_that_a_result_was_changed(few, tmp_path):
    words = runs.arguments(few, tmp_path / "out")
    assert command(*words).exit_code == 0
    overwrite(tmp_path / "out/000003.label")
    outcome = command(*words)
    assert outcome.exit_code == 0
    assert "warning: " in outcome.output
    assert "files of 1 frames were changed since they were written (000003)" in outcome.output


@pytest.mark.parametrize("file", ["velodyne/000004.bin", "calib/000004.txt", "masks/000004.json"])
def test_an_input_changed_with_the_same_size_and_time_is_refused(few, tmp_path, file):
    run(few, tmp_path / "out")
    before = runs.contents(tmp_path / "out")
    overwrite(few / file)
    with pytest.raises(BatchError, match=f"{file}, of which frame 000004 was made, was changed since"):
        run(few, tmp_path / "out")
    assert runs.contents(tmp_path / "out") == before


@pytest.mark.parametrize("file", ["velodyne/000004.bin", "calib/000004.txt", "masks/000004.json"])
def test_an_input_copied_again_with_the_same_bytes_is_the_same(few, tmp_path, file):
    run(few, tmp_path / "out")
    before = runs.contents(tmp_path / "out")
    os.utime(few / file, ns=(0, 0))
    assert run(few, tmp_path / "out").n_earlier == 12
    assert runs.contents(tmp_path / "out") == before


@pytest.mark.parametrize(("formats", "is_read"), [(("label",), False), (("label", "png"), True)])
def test_images_have_a_digest_where_they_are_read(few, tmp_path, formats, is_read):
    run(few, tmp_path / "out", formats=formats)
    (image,) = [
        state for path, state in runs.records(tmp_path / "out")["000004"]["inputs"].items() if path.endswith(".png")
    ]
    assert (image[2] is not None) == is_read


def test_a_file_that_all_frames_share_is_read_once(few, tmp_path, monkeypatch):
    digested = []
    digest_of = known_files.digest_of
    monkeypatch.setattr(known_files, "digest_of", lambda path: (digested.append(path), digest_of(path))[1])
    monkeypatch.setitem(SEGMENTERS, "model", BoxSegmenter.read_kitti)
    shared = f"model:{few}/label_2/000000.txt"
    out = tmp_path / "out"
    batch.run(few, out, batch.RunSettings(segmenter=shared), workers=1)
    assert 1 <= digested.count(few / "label_2/000000.txt") <= 2
    overwrite(few / "label_2/000000.txt")
    with pytest.raises(BatchError, match=r"label_2/000000\.txt, of which frame \d+ was made, was changed since"):
        batch.run(few, out, batch.RunSettings(segmenter=shared), workers=1)


def test_files_of_many_frames_are_known_by_size_and_time(few, tmp_path, monkeypatch):
    monkeypatch.setattr(known_files, "LARGEST_DIGESTED_BYTES", 1500)
    run(few, tmp_path / "out")
    states = {Path(path).suffix: state for path, state in runs.records(tmp_path / "out")["000004"]["inputs"].items()}
    assert states[".bin"][0] > 1500
    assert states[".bin"][2] is None
    assert len(states[".txt"][2]) == 64
    assert run(few, tmp_path / "out").n_earlier == 12


def test_the_journal_holds_the_digests_of_the_files(few, tmp_path):
    run(few, tmp_path / "out")
    record = runs.records(tmp_path / "out")["000004"]
    for path, (size, _, digest) in [*record["inputs"].items()]:
        content = Path(path).read_bytes()
        assert (size, digest) in {(len(content), hashlib.sha256(content).hexdigest()), (len(content), None)}
    contents = {name: (tmp_path / "out" / name).read_bytes() for name in ("000004.npz", "000004.label")}
    assert record["files"] == {
        name: [len(content), hashlib.sha256(content).hexdigest()] for name, content in contents.items()
    }
