"""The workflows that check and release: what they name is there, and they may do no more than they need."""

import re
from pathlib import Path

import pytest

yaml = pytest.importorskip("yaml")

ROOT = Path(__file__).parents[1]
WORKFLOWS = sorted((ROOT / ".github/workflows").glob("*.yml"))
TARGETS = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
PYPROJECT = (ROOT / "pyproject.toml").read_text()
# programs that a runner has, or that an earlier step installs
PROGRAMS = {"cargo", "make", "pip", "pytest", "rustup", "sudo", "test"}
TAGGED = "startsWith(github.ref, 'refs/tags/v')"


JOBS = [
    pytest.param(job, id=f"{path.name}: {name}")
    for path in WORKFLOWS
    for name, job in yaml.safe_load(path.read_text())["jobs"].items()
]


def commands(job):
    """The lines of shell of a job, those that name a value of its matrix once for each."""
    for line in "\n".join(step.get("run", "") for step in job["steps"]).split("\n"):
        named = re.search(r"\$\{\{ matrix\.(\w+) \}\}", line)
        yield from [line.replace(named[0], value) for value in job["strategy"]["matrix"][named[1]]] if named else [line]


def test_both_workflows_are_there():
    assert [path.name for path in WORKFLOWS] == ["ci.yml", "release.yml"]


@pytest.mark.parametrize("job", JOBS)
def test_every_command_and_make_target_and_extra_exists(job):
    lines = [line for line in commands(job) if line]
    assert {part.split()[0] for line in lines for part in line.split("&&")} <= PROGRAMS
    assert {target for line in lines for target in re.findall(r"^make (\S+)", line)} <= TARGETS
    extras = {extra for line in lines for extra in re.findall(r"\[(\w+)\]", line)}
    assert [extra for extra in extras if not re.search(rf"^{extra} = \[", PYPROJECT, re.MULTILINE)] == []


@pytest.mark.parametrize("path", [pytest.param(path, id=path.name) for path in WORKFLOWS])
def test_nothing_may_be_written_save_by_trusted_publishing(path):
    workflow = yaml.safe_load(path.read_text())
    assert workflow["permissions"] == {"contents": "read"}
    allowed = {name: job["permissions"] for name, job in workflow["jobs"].items() if "permissions" in job}
    assert allowed == ({"publish": {"id-token": "write"}} if path.name == "release.yml" else {})
    assert "secrets." not in path.read_text()


@pytest.mark.parametrize("job", JOBS)
def test_actions_are_pinned_to_a_major_version(job):
    for action in filter(None, (step.get("uses") for step in job["steps"])):
        assert re.fullmatch(r"[\w-]+/[\w-]+@(v\d+|release/v\d+)", action), action
        if action.startswith("actions/checkout"):
            assert all(
                step["with"]["persist-credentials"] is False for step in job["steps"] if step.get("uses") == action
            )


def test_every_version_of_python_is_tested_on_every_system():
    matrix = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text())["jobs"]["test"]["strategy"]["matrix"]
    assert matrix["os"] == ["ubuntu-latest", "macos-latest", "windows-latest"]
    assert matrix["python"] == ["3.11", "3.12", "3.13", "3.14"]
    assert f'requires-python = ">={matrix["python"][0]}"' in PYPROJECT


def test_only_tested_wheels_of_a_tag_are_published():
    workflow = yaml.safe_load((ROOT / ".github/workflows/release.yml").read_text())["jobs"]
    assert {row["target"] for row in workflow["wheel"]["strategy"]["matrix"]["include"]} == {
        "x86_64-unknown-linux-gnu", "aarch64-unknown-linux-gnu", "x86_64-apple-darwin", "aarch64-apple-darwin",
        "x86_64-pc-windows-msvc",
    }  # fmt: skip
    steps = [step.get("run") or step["uses"].partition("@")[0] for step in workflow["wheel"]["steps"]]
    assert steps.index("PyO3/maturin-action") < steps.index("pytest") < steps.index("actions/upload-artifact")
    assert workflow["publish"]["needs"] == ["wheel", "sdist"]
    assert workflow["publish"]["if"] == TAGGED
    assert {step.get("if") for step in workflow["sdist"]["steps"] if "test -f" in step.get("run", "")} == {TAGGED}
