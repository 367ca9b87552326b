"""Links and other things that somebody put into the folder of results beforehand are never followed."""

import itertools
import os

import pytest

from batch import runs
from command import command
from ldls import batch
from ldls.batch.journal import JOURNAL_NAME
from ldls.batch.lock import HOLDER_NAME, LOCK_NAME
from ldls.batch.summary import FAILURES_NAME
from ldls.errors import BatchError, FileFormatError, UnsafePathError
from ldls.io import files

PRECIOUS = b"the only copy\n"


@pytest.fixture
def folder(few, tmp_path):
    """A folder of results, a file beside it that nobody may touch, and a run into the folder."""
    out, precious = tmp_path / "out", tmp_path / "precious"
    out.mkdir()
    precious.write_bytes(PRECIOUS)
    yield out, precious, lambda: batch.run(few, out, runs.stored(few))
    assert precious.read_bytes() == PRECIOUS


def link(path, target):
    try:
        path.symlink_to(target)
    except OSError:
        pytest.skip("no links may be made here")


@pytest.mark.parametrize("name", [LOCK_NAME, JOURNAL_NAME])
@pytest.mark.parametrize("target", ["precious", "none"], ids=["to a file", "to nothing"])
def test_a_link_in_the_place_of_lock_or_journal_is_refused(folder, name, target):
    out, precious, run = folder
    link(out / name, precious.with_name(target))
    with pytest.raises(UnsafePathError, match=f"{name}: is a link to .*{target}, .*; remove the link"):
        run()
    assert not precious.with_name("none").exists()
    assert [path.name for path in out.iterdir()] == [name]


@pytest.mark.parametrize("name", [LOCK_NAME, JOURNAL_NAME])
def test_a_link_that_comes_between_look_and_opening_is_refused(folder, name, monkeypatch):
    out, precious, run = folder
    link(out / name, precious)
    for module in ("ldls.io.files", "ldls.batch.lock"):
        monkeypatch.setattr(f"{module}.refuse_link", lambda path: None)
    with pytest.raises(OSError, match=name):
        run()


@pytest.mark.parametrize("name", [HOLDER_NAME, FAILURES_NAME, "000003.label"])
def test_a_link_in_the_place_of_a_file_is_replaced(few, folder, name):
    out, precious, run = folder
    (few / "masks/000005.json").unlink()
    run()
    journal = out / JOURNAL_NAME
    journal.write_bytes(journal.read_bytes().splitlines(keepends=True)[0])
    (out / name).unlink(missing_ok=True)
    link(out / name, precious)
    assert len(run().failures) == 1
    assert not (out / name).is_symlink()
    assert (out / name).exists() == (name != HOLDER_NAME)


def test_links_with_the_names_of_temporary_files_are_neither_written_to_nor_kept(folder, monkeypatch):
    out, precious, run = folder
    tokens = itertools.count()
    monkeypatch.setattr(files.secrets, "token_hex", lambda _: f"{next(tokens):04}")
    # the note of who holds the lock is written before the folder is swept
    for token in range(3, 30):
        link(out / f".{token:04}{files.UNFINISHED}", precious)
    assert run().n_done == 12
    assert not list(out.glob(f"*{files.UNFINISHED}"))


@pytest.mark.parametrize("target", ["precious", "none"], ids=["to a file", "to nothing"])
def test_a_link_in_the_place_of_a_result_is_refused_where_no_run_has_begun(folder, target):
    out, precious, run = folder
    link(out / "000003.label", precious.with_name(target))
    with pytest.raises(BatchError, match=r"holds 000003\.label, which no run here wrote"):
        run()
    assert [path.name for path in out.iterdir()] == ["000003.label"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes have names here")
def test_a_pipe_in_the_place_of_the_journal_is_refused(folder):
    out, _, run = folder
    os.mkfifo(out / JOURNAL_NAME)
    with pytest.raises(FileFormatError, match="expected a regular file, got a pipe"):
        run()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes have names here")
def test_a_pipe_in_the_place_of_the_holder_does_not_hold_up_a_second_run(few, folder):
    out, _, _ = folder
    hold = "import sys, os, time; from pathlib import Path; from ldls.batch import lock\n"
    hold += "out = Path(sys.argv[1])\n"
    hold += "with lock.only_run(out):\n"
    hold += "    (out / lock.HOLDER_NAME).unlink(); os.mkfifo(out / lock.HOLDER_NAME)\n"
    hold += "    print('held', flush=True); time.sleep(60)"
    with runs.started([out], program=["-c", hold]) as holder:
        assert holder.stdout.readline() == "held\n"
        outcome = command(*runs.arguments(few, out))
    assert outcome.exit_code == 1
    assert "another run is at work here (process unknown)" in outcome.output
