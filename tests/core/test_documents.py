"""The documents, held against the code: files, links, functions and examples."""

import ast
import importlib
import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import geodesic_core as gc
from geodesic_core import kernels, tolerances
from tests.support.documents import pictures_of, run_examples
from tests.support.paths import ROOT
from tests.support.syntax import syntax_tree

DOCUMENTS = sorted(
    [
        *ROOT.glob("*.md"),
        *(ROOT / "docs").rglob("*.md"),
        *(ROOT / "benchmarks").rglob("*.md"),
        ROOT / "geodesic_core" / "README.md",
    ]
)
BLENDER = shutil.which("blender")
HOWTO_OF_BLENDER = ROOT / "docs" / "howto" / "blender.md"
REFERENCE = [
    f"reference/{path.name}" for path in sorted((ROOT / "docs" / "reference").glob("*.md"))
]
"""Their pictures take 15 s, and `scripts/docs` draws them as well."""
PAGES_OF_EXAMPLES = [
    "start.md",
    *(
        f"howto/{path.name}"
        for path in sorted((ROOT / "docs" / "howto").glob("*.md"))
        if path != HOWTO_OF_BLENDER
    ),
]
ROOMS = [
    "",
    "front.",
    "sweep.",
    "fast.",
    "paths.",
    "curves.",
    "cutting.",
    "retained.",
    "isolines.",
    "borders.",
    "mesh.",
]
"""Of the kernels, which documents name without their package."""
OBJECTS = ("field", "path", "solver", "mesh")
"""Whose attributes are named like functions of a module."""
BUILT = ("app/web/dist", "docs/_build")
"""Folders that a build makes."""
VARIABLES = ("NUMBA_", "GEODESIC_", "OTEL_", "FORWARDED_", "HATCH_", "RAY_", "XDG_")
"""Beginnings of environment variables."""
COLUMNS = ("ENTRY_EDGE",)
"""Of the state, which are no tolerances."""


def texts(pattern: str) -> list[tuple[str, str]]:
    """What a pattern finds between backticks in the documents, and where."""
    return sorted(
        {
            (path.relative_to(ROOT).as_posix(), found)
            for path in DOCUMENTS
            for code in re.findall(r"`([^`\n]+)`", path.read_text())
            for found in re.findall(pattern, code)
        }
    )


@pytest.mark.parametrize(
    ("document", "name"),
    texts(r"^(?:app|geodesic_core|tests|docs|scripts|openapi|kernels|docker|benchmarks)/[\w./-]+$"),
)
def test_files_that_documents_name_are_there(document: str, name: str) -> None:
    if document != "CHANGELOG.md" and name not in BUILT:
        places = [ROOT / name, ROOT / "geodesic_core" / name]
        assert any(place.exists() or place.with_suffix(".py").exists() for place in places)


def test_files_of_the_table_of_changes_are_there() -> None:
    table = (ROOT / "CONTRIBUTING.md").read_text().partition("## Where to make which change")[2]
    named = set(re.findall(r"`((?:[\w-]+/)*[\w-]+\.(?:py|ts|md|json|toml))`", table))
    folders = ("app", "benchmarks", "geodesic_core", "client", "docs", "openapi", "tests")
    paths = [
        "/" + path.relative_to(ROOT).as_posix()
        for folder in folders
        for path in (ROOT / folder).rglob("*.*")
        if "node_modules" not in path.parts
    ]
    paths += [f"/{path.name}" for path in ROOT.glob("*.*")]
    assert len(named) > 50
    assert {name for name in named if not any(path.endswith(f"/{name}") for path in paths)} == set()


def test_tests_that_documents_name_are_there() -> None:
    sources = (path.read_text() for path in (ROOT / "tests").rglob("test_*.py"))
    tests = {name for source in sources for name in re.findall(r"(?m)^def (test_\w+)", source)}
    named = {name for _, name in texts(r"^test_\w+$")}
    assert len(named) > 20
    assert named <= tests


@pytest.mark.parametrize(
    ("document", "target"),
    sorted(
        {
            (path, target)
            for path in DOCUMENTS
            for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", path.read_text())
            if "drawn/" not in target  # which examples draw
        }
    ),
    ids=str,
)
def test_links_between_documents_lead_somewhere(document: Path, target: str) -> None:
    assert (document.parent / target).exists()


@pytest.mark.parametrize(
    ("document", "module", "name"),
    [
        (document, module, name)
        for document, (module, name) in (
            (document, found.replace("/", ".").rsplit(".", 1))
            for document, found in texts(r"^(?:\w+/)?[a-z_]+\.[a-z_]+$")
        )
        if document in ("docs/algorithm.md", "docs/accuracy.md")
        and name not in ("py", "md")
        and module not in OBJECTS
    ],
)
def test_functions_that_documents_name_are_there(document: str, module: str, name: str) -> None:
    for room in ROOMS:
        try:
            found = importlib.import_module(f"{kernels.__name__}.{room}{module}")
        except ModuleNotFoundError:
            continue
        if hasattr(found, name):
            return
    pytest.fail(f"{document} names {module}.{name}, which is not there")


@pytest.mark.parametrize("name", sorted({name for _, name in texts(r"^[A-Z]+_[A-Z_]+$")}))
def test_tolerances_that_documents_name_are_there(name: str) -> None:
    assert name.startswith(VARIABLES) or name in COLUMNS or hasattr(tolerances, name)


@pytest.mark.slow
@pytest.mark.parametrize("folder", ["geodesic_core", "app", "tests", "benchmarks"])
def test_docstrings_of_modules_begin_with_a_noun_or_a_verb(folder: str) -> None:
    sources = [path for path in (ROOT / folder).rglob("*.py") if "node_modules" not in path.parts]
    docstrings = [ast.get_docstring(syntax_tree(path)) or "" for path in sources]
    assert len(docstrings) > 10
    openings = {text.split()[0].strip(",:") for text in docstrings if text}
    assert not openings & {"What", "Who", "Which", "Where", "How"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "least"),
    [
        ("algorithm.md", 4),
        ("sharing.md", 4),
        *(pytest.param(name, 0, marks=(pytest.mark.jit, pytest.mark.full)) for name in REFERENCE),
        *(pytest.param(name, 8, marks=pytest.mark.jit) for name in PAGES_OF_EXAMPLES),
    ],
)
def test_the_examples_of_documents_run(
    name: str, least: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    page = ROOT / "docs" / name
    assert run_examples(page) >= least
    assert {path.name for path in tmp_path.glob("*.png")} == pictures_of(page)


@pytest.mark.jit
@pytest.mark.slow
def test_python_in_the_readme_runs(capsys: pytest.CaptureFixture[str]) -> None:
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    for block in blocks:
        exec(block, {})  # noqa: S102 - our own documents

    assert len(capsys.readouterr().out.splitlines()) >= len(blocks) > 0


@pytest.mark.skipif(BLENDER is None, reason="to run it, install Blender (apt install blender)")
def test_the_script_for_blender_runs_in_it(tmp_path: Path) -> None:
    gc.samples.sphere(320).to_trimesh().export(tmp_path / "object.obj")
    mesh = gc.load_mesh(tmp_path / "object.obj")
    distances = gc.exact_distance(mesh, 0).distances
    np.save(tmp_path / "distances.npy", distances)
    (script,) = re.findall(r"```python\n(.*?)```", HOWTO_OF_BLENDER.read_text(), re.DOTALL)
    before = "import bpy\nbpy.ops.import_scene.obj(filepath='object.obj')\n"
    before += "bpy.context.view_layer.objects.active = bpy.context.selected_objects[0]\n"
    after = "print('DISTANCES', [value.value for value in layer.data])\n"
    (tmp_path / "script.py").write_text(before + script + after)
    run = subprocess.run(  # noqa: S603 - our own document
        [str(BLENDER), "--background", "--factory-startup", "--python", "script.py"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    (shown,) = re.findall(r"(?m)^DISTANCES (.*)$", run.stdout)
    assert json.loads(shown) == pytest.approx(distances, rel=1e-6)
