"""Tutorials as notebooks for a hosted machine: `python docs/_ext/notebooks.py FOLDER`, or `make
notebooks`.
"""

import re
import sys
from pathlib import Path

import nbformat
from myst_nb.core.read import read_myst_markdown_notebook
from myst_parser.config.main import MdParserConfig

NOTEBOOKS = {
    "attack-a-model": ("sb3", "train"),
    "measure-your-model": ("your-model", "train"),
    "audit-your-log": ("ratings", "cli,logs"),
}
"""Name of each notebook, the tutorial that it is made of, and the extras that this needs."""

_TUTORIALS = Path(__file__).parents[1] / "tutorials"
_INSTALL = """\
# From an index that has the package, or from the wheel of a release in the folder of this notebook.
%pip install --quiet --find-links . "roletrust-env[{extras}]\""""


def notebook(name: str) -> nbformat.NotebookNode:
    """Return a notebook: the tutorial without links that lead nowhere, with a cell that installs
    the package.

    Args:
        name: Name of the notebook, one of `NOTEBOOKS`.
    """
    page, extras = NOTEBOOKS[name]
    book = read_myst_markdown_notebook(
        (_TUTORIALS / f"{page}.md").read_text(encoding="utf-8"), MdParserConfig()
    )
    book.cells.insert(1, nbformat.v4.new_code_cell(_INSTALL.format(extras=extras)))
    for number, cell in enumerate(book.cells):
        cell.id = f"cell-{number}"  # the same bytes each time
        cell.metadata = {}  # of the site
        if cell.cell_type == "markdown":
            cell.source = re.sub(r"\[([^\]]+)\]\((?!https?://)[^)]+\)", r"\1", cell.source)
    book.metadata = {"kernelspec": dict(book.metadata.kernelspec)}
    return book


def main(folder: Path) -> None:
    """Write all notebooks to a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in NOTEBOOKS:
        nbformat.write(notebook(name), folder / f"{name}.ipynb")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
