"""Long JSON lists, an object at a time."""

import json

import pytest

import ldls
from ldls.io import json_rows
from ldls.io.json_rows import read_json_rows

ROWS = [{"token": f"t{k}", "text": 'a "]" and a }, {', "list": [1, [2.5]], "inner": {"k": k}} for k in range(7)]


@pytest.mark.parametrize("chunk", [1, 7, 64, 1 << 20])
@pytest.mark.parametrize("indent", [None, 0, 2])
def test_rows_equal_those_of_json_for_any_chunk(tmp_path, monkeypatch, chunk, indent):
    monkeypatch.setattr(json_rows, "CHUNK_CHARACTERS", chunk)
    path = tmp_path / "table.json"
    path.write_text("\n" * (chunk == 64) + json.dumps(ROWS, indent=indent) + "\n")
    assert list(read_json_rows(path)) == ROWS


@pytest.mark.parametrize(
    ("content", "error", "message"),
    [
        pytest.param(b"", ldls.CorruptFileError, "after the first 0", id="empty"),
        pytest.param(b'{"a": 1}', ldls.CorruptFileError, r"Expecting '\['", id="an object"),
        pytest.param(b'[{"a": 1}, 3]', ldls.CorruptFileError, "after the first 1", id="a number among objects"),
        pytest.param(b'[{"a": 1}, {"a"', ldls.TruncatedFileError, "after 1 whole objects", id="cut within an object"),
        pytest.param(b'[{"a": 1}', ldls.TruncatedFileError, "after 1 whole objects", id="cut between objects"),
        pytest.param(b'[{"a": "\xff"}]', ldls.CorruptFileError, "utf-8", id="not text"),
    ],
)
def test_broken_lists_are_refused(tmp_path, content, error, message):
    path = tmp_path / "table.json"
    path.write_bytes(content)
    with pytest.raises(error, match=message):
        list(read_json_rows(path))


def test_an_object_that_does_not_end_is_not_kept_for_ever(tmp_path, monkeypatch):
    monkeypatch.setattr(json_rows, "CHUNK_CHARACTERS", 64)
    monkeypatch.setattr(json_rows, "LONGEST_OBJECT", 512)
    path = tmp_path / "table.json"
    path.write_text('[{"a": nonsense ' + "x" * 10_000)
    with pytest.raises(ldls.CorruptFileError):
        list(read_json_rows(path))
