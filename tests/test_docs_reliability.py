"""docs/reliability.md: every row is there, and every test that it names exists."""

import ast
import re

import pages
import pytest

PAGE = (pages.ROOT / "docs/reliability.md").read_text()
ROWS = dict(re.findall(r"^\| (F?\d+) \| (.*) \|$", PAGE, re.MULTILINE))
CODE = re.findall(r"`([^`\n]+)`", pages.FENCED.sub("", PAGE))
PYTHON = sorted({code for code in CODE if code.startswith("tests/")})
RUST = sorted({code.removeprefix("ldls-core: ") for code in CODE if code.startswith("ldls-core: ")} - {"..."})
TARGETS = sorted({code.removeprefix("make ") for code in CODE if code.startswith("make ")} - {"..."})
RUST_TEST = re.compile(r"#\[test\]\s+fn (\w+)")


def functions_in(path):
    """The names of the functions in a file of Python."""
    tree = ast.parse((pages.ROOT / path).read_text())
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


def rust_tests():
    sources = (pages.ROOT / "rust/ldls-core").rglob("*.rs")
    return {name for path in sources for name in RUST_TEST.findall(path.read_text())}


def test_every_row_is_there_once_and_in_order():
    expected = [*map(str, range(1, 84)), *(f"F{number}" for number in range(1, 20))]
    assert re.findall(r"^\| (F?\d+) \|", PAGE, re.MULTILINE) == expected == list(ROWS)


@pytest.mark.parametrize("number", ROWS)
def test_a_row_names_a_test_or_says_that_it_is_open(number):
    named = ROWS[number].rpartition(" | ")[2]
    assert re.search(r"`(tests/|ldls-core: |make )|\bopen\b", named)


@pytest.mark.parametrize("name", PYTHON)
def test_a_test_of_python_exists(name):
    if name != "tests/...":
        path, _, function = name.partition("::")
        assert function.startswith("test_")
        assert function in functions_in(path)


def test_every_test_of_rust_exists():
    assert len(RUST) > 20
    assert set(RUST) <= rust_tests()


def test_every_make_target_exists():
    assert {"asan", "tsan", "miri", "kills"} <= set(TARGETS)
    makefile = (pages.ROOT / "Makefile").read_text()
    assert [target for target in TARGETS if not re.search(rf"^{target}:", makefile, re.MULTILINE)] == []
