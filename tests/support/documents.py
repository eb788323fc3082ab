"""The examples of a document, run one after another as a reader would."""

import re
from doctest import ELLIPSIS, NORMALIZE_WHITESPACE
from pathlib import Path

from sybil import Sybil
from sybil.parsers.markdown import PythonCodeBlockParser


def run_examples(page: Path) -> int:
    """Run the blocks of Python of a page, and compare the output where it is given.

    Returns
    -------
    int
        How many examples there were.
    """
    parser = PythonCodeBlockParser(doctest_optionflags=ELLIPSIS | NORMALIZE_WHITESPACE)
    examples = list(Sybil([parser]).parse(page).examples())
    for example in examples:
        example.evaluate()
    return len(examples)


def pictures_of(page: Path) -> set[str]:
    """Return the names of the pictures that a page shows and its examples draw."""
    return set(re.findall(r"\]\((?:\.\./)?drawn/([^)]+\.png)\)", page.read_text()))
