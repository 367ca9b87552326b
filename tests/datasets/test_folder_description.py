"""Files that describe folders and are none: an error of ours that names the file."""

import pytest

import ldls
from datasets import layouts
from ldls.datasets.folder_description import read_description


def test_a_description_is_read(tmp_path):
    layouts.write_text(tmp_path / "ldls.toml", layouts.FOLDER_TOML)
    assert list(read_description(tmp_path / "ldls.toml").cameras) == ["front"]


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        pytest.param("columns = " + "9" * 5000, ldls.CorruptFileError, "ValueError", id="number of 5,000 digits"),
        pytest.param("a = " + "[" * 60_000, ldls.CorruptFileError, "RecursionError", id="60,000 brackets"),
        pytest.param(".".join(["a"] * 30_000) + " = 1", ldls.CorruptFileError, "256 dots", id="key of 30,000 parts"),
        pytest.param("a = 2001-99-99", ldls.CorruptFileError, "ldls.toml", id="date that is none"),
        pytest.param("#" * (1 << 16) + "\n", ldls.LimitError, "65,537 bytes, expected at most 65,536", id="64 KB"),
        pytest.param("\0", ldls.CorruptFileError, "not a whole TOML file", id="NUL"),
        pytest.param(
            layouts.FOLDER_TOML.replace("50.0", "9" * 400),
            ldls.LdlsError,
            "K: ",
            id="huge integer",
        ),
        pytest.param(
            layouts.FOLDER_TOML.replace("-0.1", '"x"'),
            ldls.LdlsError,
            "coefficients: got .*expected a list of finite numbers",
            id="coefficient in text",
        ),
        pytest.param(
            layouts.FOLDER_TOML.replace("masks/{frame}.npz", "masks.png"),
            ldls.ParameterError,
            r"cameras\.front: masks is 'masks\.png', expected \{frame\} .*, or one \.json of all images",
            id="masks of one image",
        ),
        pytest.param(
            layouts.FOLDER_TOML.replace("masks/", "{camera}/"),
            ldls.ParameterError,
            r"masks is '\{camera\}/\{frame\}\.npz', expected \{frame\} and nothing else in braces",
            id="camera in braces",
        ),
        pytest.param(
            layouts.FOLDER_TOML + layouts.FOLDER_TOML.partition("\n\n")[2].replace("front", "back"),
            ldls.ParameterError,
            r"cameras\.back: masks is 'masks/\{frame\}\.npz', as of cameras\.front, and both would get the masks",
            id="masks of two cameras",
        ),
    ],
)
def test_what_is_no_description_is_refused(tmp_path, text, error, message):
    (tmp_path / "ldls.toml").write_text(text)
    with pytest.raises(error, match=message) as caught:
        read_description(tmp_path / "ldls.toml")
    assert str(caught.value).count("ldls.toml") == 1


def test_a_description_that_is_no_text(tmp_path):
    (tmp_path / "ldls.toml").write_bytes(b"points = '\xff'")
    with pytest.raises(ldls.CorruptFileError, match=r"ldls\.toml: not a text file \(invalid start byte at byte 10\)"):
        read_description(tmp_path / "ldls.toml")
