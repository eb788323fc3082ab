"""Configuration of the documentation site, which `scripts/docs` builds."""

import os
import re
import sys
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS.parent))

from docs.notebooks import write_notebooks  # noqa: E402
from docs.results import with_results  # noqa: E402
from tests.support.documents import pictures_of, run_examples  # noqa: E402

os.environ.setdefault("PYVISTA_OFF_SCREEN", "true")

project = "Geodesic"
default_role = "py:obj"  # names in backticks lead to what they name, where it is documented
html_theme = "furo"
html_title = "Geodesic"
html_static_path = ["static", "drawn/static"]
html_copy_source = False  # the wheel carries the site
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
]
exclude_patterns = ["_build"]
suppress_warnings = ["misc.highlighting_failure"]  # sessions show answers shortened by …
myst_heading_anchors = 4
napoleon_google_docstring = False
napoleon_use_ivar = True
autodoc_typehints = "none"  # the signature and the docstring have them
autodoc_preserve_defaults = True  # progress=ignore_progress, not its address in memory
autodoc_member_order = "bysource"


def draw(_: Sphinx) -> None:
    """Draw the pictures that pages show, and write notebooks, by running the examples of pages."""
    folder = DOCS / "drawn"
    folder.mkdir(exist_ok=True)
    before = Path.cwd()
    os.chdir(folder)
    try:
        for page in sorted(DOCS.rglob("*.md")):
            if pictures_of(page):
                run_examples(page)
    finally:
        os.chdir(before)
    write_notebooks(DOCS, folder)


def leave_out_links_to_the_repository(app: Sphinx, page: str, text: list[str]) -> None:
    """Leave the words of links to Markdown files that are no pages of the site."""
    folder = Path(app.env.doc2path(page)).parent

    def kept(link: re.Match[str]) -> str:
        inside = (folder / link[2]).resolve().is_relative_to(DOCS)
        return link[0] if inside else link[1]

    text[0] = re.sub(r"\[([^]]+)\]\(([^)#:]+\.md)(?:#[^)]*)?\)", kept, text[0])


def insert_results(_app: Sphinx, _page: str, text: list[str]) -> None:
    """Take figures from the results of benchmarks."""
    text[0] = with_results(text[0])


def add_diagrams(
    app: Sphinx, _page: str, _template: str, _context: dict[str, Any], tree: nodes.document | None
) -> None:
    """Have a page draw its diagrams, by a script that the site carries: it needs no network."""
    blocks = tree.findall(nodes.literal_block) if tree else ()
    if any(block.get("language") == "mermaid" for block in blocks):
        app.add_js_file("mermaid.tiny.js", loading_method="defer")
        app.add_js_file("diagrams.js", loading_method="defer")


def setup(app: Sphinx) -> None:
    """Connect what is done before pages are read, as they are read, and as they are written."""
    app.connect("builder-inited", draw)
    app.connect("source-read", insert_results)
    app.connect("source-read", leave_out_links_to_the_repository)
    app.connect("html-page-context", add_diagrams)
