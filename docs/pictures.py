"""Make the pictures of the documentation anew, by the commands that stand beside them: `python docs/pictures.py`."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from pages import ROOT, Recipe, pages, recipes


def make(recipe: Recipe, folder: Path) -> dict[str, Path]:
    """Run the commands of a recipe in a folder; what they made, by the paths of the pictures in the repository."""
    # benches are no part of the package, and found in the source tree
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))}
    subprocess.run(["bash", "-euo", "pipefail", "-c", recipe.commands], cwd=folder, env=environment, check=True)
    return {picture: folder / file for picture, file in recipe.files.items()}


def main(names: list[str]) -> None:
    """Make the pictures of the pages named, or of all."""
    chosen = [ROOT / name for name in names] or pages()
    for page in chosen:
        with TemporaryDirectory() as folder:
            for recipe in recipes(page):
                for picture, file in make(recipe, Path(folder)).items():
                    shutil.copyfile(file, ROOT / picture)
                    print(f"{page.relative_to(ROOT)}: {picture}")


if __name__ == "__main__":
    main(sys.argv[1:])
