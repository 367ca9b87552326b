"""`import ldls` imports a name when it is used: the names for type checkers are those that are imported."""

import ast
import subprocess
import sys
from pathlib import Path

import ldls


def test_names_for_type_checkers_are_those_that_are_imported():
    tree = ast.parse(Path(ldls.__file__).read_text())
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    stated = {(node.module, alias.name) for node in block.body for alias in node.names}
    imported = {(module, name) for module, names in ldls._NAMES.items() for name in names}
    assert stated == imported | {("ldls", "stages")}
    assert all(getattr(ldls, name) is not None for _, name in imported)


def test_rooms_need_no_import_of_their_own():
    program = (
        "import ldls; print(ldls.viewing.overlay.__name__, ldls.datasets.open_source.__name__, hasattr(ldls, 'no'))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "overlay open_source False\n"


def test_the_command_line_answers_without_numpy():
    program = "import sys; from ldls.cli import app; print('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
