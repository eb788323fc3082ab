"""The diagram of the library in docs/architecture.md, against its imports."""

import itertools
import re

import grimp
import pytest

from tests.support.paths import ROOT

PARTS = [
    "brain",
    "terrain",
    "compilation",
    "solvers",
    "matrices",
    "sampling",
    "loops",
    "costs",
    "cutting",
    "search",
    "fields",
    "io",
    "samples",
    "mesh",
]
PARTS += ["plotting"]
KERNELS = [
    "borders",
    "certificates",
    "isolines",
    "retained",
    "curves",
    "paths",
    "sweep",
    "fast",
    "front",
]
MODULES = {f"geodesic_core.{part}": part for part in PARTS}
MODULES |= {f"geodesic_core.kernels.{room}": room for room in KERNELS}
MODULES |= {
    "geodesic_core.kernels.costs": "cost_graph",
    "geodesic_core.kernels.cutting": "triangulations",
    "geodesic_core.kernels.mesh": "half_edges",
}

Arrows = set[tuple[str, str]]


def drawn() -> Arrows:
    text = (ROOT / "docs" / "architecture.md").read_text().partition("```mermaid")[2]
    arrows: Arrows = set()
    for line in text.partition("```")[0].splitlines():
        names = re.sub(r'\[".*?"\]', "", line).split("-->")
        ends = [[name.strip() for name in part.split("&")] for part in names]
        for starts, targets in itertools.pairwise(ends):
            arrows |= {(a, b) for a in starts for b in targets}
    return arrows


def leads(start: str, end: str, arrows: Arrows) -> bool:
    seen = {start}
    while found := {b for a, b in arrows if a in seen} - seen:
        seen |= found
    return end in seen


@pytest.mark.slow
def test_arrows_are_the_imports_that_no_others_imply() -> None:
    graph = grimp.build_graph("geodesic_core", exclude_type_checking_imports=True)
    part_of = {
        module: part
        for prefix, part in MODULES.items()
        for module in graph.modules
        if module == prefix or module.startswith(f"{prefix}.")
    }
    imports = {
        (part_of[module], part_of[other])
        for module in part_of
        for other in graph.find_modules_directly_imported_by(module)
        if other in part_of and part_of[module] != part_of[other]
    }
    assert drawn() == {each for each in imports if not leads(*each, imports - {each})}
