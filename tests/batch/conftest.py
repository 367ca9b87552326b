import pytest

from batch import runs
from datasets import layouts


@pytest.fixture(scope="session")
def source(tmp_path_factory):
    """300 frames with stored masks; nobody changes them."""
    return layouts.many_frames(tmp_path_factory.mktemp("source"))


@pytest.fixture(scope="session")
def undisturbed(source, tmp_path_factory):
    """What a run that nothing disturbs leaves of these."""
    out = tmp_path_factory.mktemp("undisturbed")
    outcome = runs.finished(runs.arguments(source, out))
    assert outcome.returncode == 0, outcome.stderr
    return runs.contents(out)
