"""Notebooks from pages of the documentation: their text and examples, executed."""

import re
from collections.abc import Iterator
from doctest import DocTestParser
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from nbformat import NotebookNode
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

NOTEBOOKS = {
    "first-steps": "start.md",
    "cortex": "howto/cortex.md",
    "terrain": "howto/terrain.md",
    "cut-and-unroll": "howto/cutting.md",
    "proof": "howto/proofs.md",
    "progress-and-views": "howto/notebook.md",
}
"""Names of notebooks, and the pages that they are made from"""

_EXAMPLES = re.compile(r"^```python\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_FIRST = """import pyvista

pyvista.set_jupyter_backend("static")  # with pyvista[jupyter], "client" lets you turn views"""
_QUIETLY = ["--IPKernelApp.log_level=ERROR"]
_KERNEL = {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}


def notebook_of(page: str) -> NotebookNode:
    """Return the notebook of the text of a page: prose, and examples without their answers.

    Each answer gets a cell of its own. Pictures appear below cells instead of in files, and links
    are words.
    """
    cells = []
    for number, part in enumerate(_EXAMPLES.split(page)):
        if number % 2:
            cells += [new_code_cell(source) for source in _sources_of(part)]
        elif prose := _prose_of(part):
            cells.append(new_markdown_cell(prose))
    if any(".plot(" in cell.source for cell in cells):
        cells.insert(1, new_code_cell(_FIRST))
    for number, cell in enumerate(cells):
        cell.id = str(number)  # by itself it is another one in each build
    return new_notebook(cells=cells, metadata=_KERNEL)


def _sources_of(examples: str) -> Iterator[str]:
    """Yield the code up to each answer."""
    source = ""
    for example in DocTestParser().get_examples(examples):
        source += re.sub(r",? ?save=\"[^\"]+\.png\"", "", example.source)
        if example.want or ".plot(" in example.source:
            yield source.strip()
            source = ""
    if source:
        yield source.strip()


def _prose_of(text: str) -> str:
    without_pictures = re.sub(r"!\[[^]]*\]\([^)]*\)\n*", "", text)
    return re.sub(r"\[([^]]+)\]\((?!https?:)[^)]*\)", r"\1", without_pictures).strip()


def write_notebooks(pages: Path, folder: Path) -> None:
    """Execute the notebooks of some pages in a folder, and write them there with their answers.

    Raises
    ------
    nbclient.exceptions.CellExecutionError
        An example fails.
    """
    for name, page in NOTEBOOKS.items():
        notebook = notebook_of((pages / page).read_text())
        place = {"metadata": {"path": str(folder)}}
        NotebookClient(notebook, resources=place, extra_arguments=_QUIETLY).execute()
        for cell in notebook.cells:
            _tidy(cell)
        nbformat.write(notebook, folder / f"{name}.ipynb")


def _tidy(cell: NotebookNode) -> None:
    """Leave out what was said of this machine, and each picture but for one format."""
    kept = [output for output in cell.get("outputs", []) if output.get("name") != "stderr"]
    for output in kept:
        output.get("data", {}).pop("image/jpeg", None)
    if cell.cell_type == "code":
        cell.outputs = kept
