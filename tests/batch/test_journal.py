"""Journals that are none, or that somebody changed, are refused by name and stay as they are."""

import json

import pytest

from batch import runs
from ldls import batch
from ldls.batch.journal import LONGEST_LINE_BYTES
from ldls.errors import BatchError, ChangedFileWarning, CorruptFileError

BRACKETS = b"[" * 100_000 + b"]" * 100_000
DIGITS = b"9" * 5_000
STATE = [1, 2, "0" * 64]
FRAME = {
    "frame": "000001", "files": {}, "inputs": {}, "window": ["000001"], "stamp": None, "pose": None, "images": [],
    "objects": [], "nothing_in_view": None,
}  # fmt: skip
ERROR = {"stage": "read", "code": "a", "message": "b"}


def line(**changed):
    return json.dumps({**FRAME, **changed}).encode()


@pytest.fixture
def finished(few, tmp_path):
    """A finished run of twelve frames: its journal, and what begins it again."""
    settings = runs.stored(few)
    out = tmp_path / "out"
    batch.run(few, out, settings)
    return out / "journal.jsonl", lambda: batch.run(few, out, settings)


LINES = [
    pytest.param(b"null", id="null"),
    pytest.param(BRACKETS, id="100,000 brackets"),
    pytest.param(b'{"frame":' + DIGITS + b"}", id="a number of 5,000 digits"),
    pytest.param(b"[]", id="a list"),
    pytest.param(b"a diary", id="no JSON"),
    pytest.param(b"\xff\xfe", id="no text"),
    pytest.param(b"", id="blank"),
    pytest.param(b'"' + b"x" * LONGEST_LINE_BYTES + b'"', id="a line without an end"),
]


@pytest.mark.parametrize("content", LINES)
@pytest.mark.parametrize("number", [1, 5, 13])
def test_a_line_that_is_no_record_is_refused_with_its_number(finished, content, number):
    journal, again = finished
    lines = journal.read_bytes().splitlines()
    lines[number - 1] = content
    journal.write_bytes(b"\n".join(lines) + b"\n")
    before = runs.contents(journal.parent)
    with pytest.raises(CorruptFileError, match=rf"journal\.jsonl: line {number}: not a journal .* empty this one"):
        again()
    assert runs.contents(journal.parent) == before


@pytest.mark.parametrize(
    "content",
    [
        pytest.param(b"{}", id="nothing"),
        pytest.param(line(frame=5), id="a number for a name"),
        pytest.param(b'{"frame":"000001"}', id="neither files nor error"),
        pytest.param(line(files=None), id="no files"),
        pytest.param(line(files={"000001.label": 5}), id="a size alone"),
        pytest.param(line(files={"000001.label": STATE}), id="files like inputs"),
        pytest.param(line(inputs=[]), id="inputs in a list"),
        pytest.param(line(inputs={"a": [1, 2]}), id="an input without a digest"),
        pytest.param(line(inputs={"a": ["1", 2, None]}), id="a size in words"),
        pytest.param(line(objects={"car": 2}), id="counts for objects"),
        pytest.param(line(objects=[{"label": 1}]), id="an object without its columns"),
        pytest.param(line(objects=None), id="no objects"),
        pytest.param(line(images=[["image_2", 375]]), id="an image without its width"),
        pytest.param(line(images=None), id="no images"),
        pytest.param(line(window=[1]), id="a number for a name in the window"),
        pytest.param(line(stamp="1"), id="a stamp in words"),
        pytest.param(line(pose=[[1, 0, 0]] * 4), id="a pose of three columns"),
        pytest.param(line(pose=[[1, 0, 0, 0]] * 3), id="a pose of three rows"),
        pytest.param(line(nothing_in_view=1), id="a number for a cause"),
        pytest.param(b'{"frame":"000001","error":null}', id="no error"),
        pytest.param(b'{"frame":"000001","error":{"stage":"read"}}', id="half an error"),
        pytest.param(json.dumps({"frame": "1", "error": {**ERROR, "more": 1}}).encode(), id="more than an error"),
    ],
)
def test_a_record_of_another_shape_is_refused(finished, content):
    journal, again = finished
    journal.write_bytes(journal.read_bytes() + content + b"\n")
    with pytest.raises(CorruptFileError, match=r"line 14: not a journal of ldls \(expected a record of a frame, got"):
        again()


def test_a_record_of_this_shape_is_taken(finished):
    journal, again = finished
    journal.write_bytes(journal.read_bytes() + line(frame="of the past") + b"\n")
    assert again().n_earlier == 12


def test_records_name_no_files_outside_the_folder(finished):
    journal, again = finished
    changed = journal.read_bytes().replace(b'"000001.label"', b'"../../etc/x"')
    journal.write_bytes(changed)
    with pytest.warns(ChangedFileWarning, match="000001"):
        assert again().n_earlier == 11


def test_an_input_with_a_name_that_none_can_have_counts_as_changed(finished):
    journal, again = finished
    journal.write_bytes(journal.read_bytes().replace(b"calib/000001.txt", b"calib\\u0000001.txt"))
    with pytest.raises(BatchError, match="was changed since"):
        again()


@pytest.mark.parametrize("content", [b"a diary", b"{ ", b"\0" * 100, b"x" * LONGEST_LINE_BYTES], ids=len)
def test_a_foreign_file_without_line_breaks_is_kept(few, tmp_path, content):
    journal = tmp_path / "journal.jsonl"
    journal.write_bytes(content)
    with pytest.raises(CorruptFileError, match="line 1: not a journal of ldls"):
        batch.run(few, tmp_path, runs.stored(few))
    assert journal.read_bytes() == content
