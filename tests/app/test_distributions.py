"""The distributions of this repository: one version, and each its own folder."""

import importlib
import json
import re
import subprocess
import tomllib
import zipfile
from importlib.metadata import distribution
from itertools import chain
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from app import __version__
from app.cli.documents import PLACES
from geodesic_core.kernels.jit.cache import PRECOMPILED
from tests.support.fresh import told_by
from tests.support.paths import ROOT

LIBRARY, SERVICE, CLIENT = ROOT / "geodesic_core", ROOT, ROOT / "client"
LOCK = ROOT / "requirements.lock"


def project(folder: Path) -> dict[str, Any]:
    table: dict[str, Any] = tomllib.loads((folder / "pyproject.toml").read_text())["project"]
    return table


def requirements(folder: Path) -> dict[str, str]:
    """Return what a distribution requires, with its extras: the versions by name."""
    extras = project(folder).get("optional-dependencies", {})
    listed = chain(project(folder)["dependencies"], *extras.values())
    return dict(re.fullmatch(r"([\w.-]+(?:\[.*\])?)(.*)", each).groups() for each in listed)


def test_all_have_one_version_and_the_service_requires_that_of_the_library() -> None:
    assert project(LIBRARY)["version"] == project(SERVICE)["version"] == __version__
    assert project(CLIENT)["version"] == __version__
    types = json.loads((CLIENT / "typescript" / "package.json").read_text())
    assert types["version"] == __version__
    assert requirements(SERVICE)["geodesic-core[all]"] == f"=={__version__}"


def test_all_ask_for_the_same_of_python_and_of_what_they_share() -> None:
    library, service = requirements(LIBRARY), requirements(SERVICE)
    shared = library.keys() & service.keys()
    assert shared >= {"numpy", "scipy"}
    assert {name: library[name] for name in shared} == {name: service[name] for name in shared}
    assert requirements(CLIENT)["numpy"] == library["numpy"]
    pythons = {project(folder)["requires-python"] for folder in (LIBRARY, SERVICE, CLIENT)}
    assert len(pythons) == 1


def test_the_lock_has_a_version_of_all_that_is_required() -> None:
    lines = map(Requirement, filter(None, map(uncommented, LOCK.read_text().splitlines())))
    here = (each for each in lines if each.marker is None or each.marker.evaluate())
    locked = {canonicalize_name(each.name): str(each.specifier) for each in here}
    for folder in (LIBRARY, SERVICE, CLIENT):
        for name, versions in requirements(folder).items():
            required = Requirement(name + versions)
            if required.name.startswith("geodesic"):
                continue
            if required.marker is None or required.marker.evaluate():
                version = locked[canonicalize_name(required.name)].removeprefix("==")
                assert version in required.specifier, required


def uncommented(line: str) -> str:
    return line.partition("#")[0].strip()


def test_the_lock_names_no_place() -> None:
    """Whoever installs has a registry of their own."""
    assert not re.search("://|^-|@", LOCK.read_text(), re.MULTILINE)


def test_the_client_brings_neither_compiler_nor_web_framework() -> None:
    brought, waiting = set[str](), {"geodesic-client"}
    while waiting:
        name = waiting.pop()
        brought.add(name)
        required = map(Requirement, distribution(name).requires or ())
        names = {
            canonicalize_name(each.name)
            for each in required
            if each.marker is None or each.marker.evaluate({"extra": ""})
        }
        waiting |= names - brought
    assert {"httpx2", "numpy", "stamina"} < brought
    assert not brought & {"numba", "llvmlite", "fastapi", "starlette", "pydantic", "geodesic-core"}
    assert len(brought) < 20


def test_all_have_the_license() -> None:
    licenses = {(folder / "LICENSE").read_bytes() for folder in (LIBRARY, SERVICE, CLIENT)}
    assert len(licenses) == 1


def test_all_extras_of_the_library_are_in_one() -> None:
    extras = project(LIBRARY)["optional-dependencies"]
    for name in ("tables", "terrain", "vtk", "plot", "proof"):  # large, or for few
        del extras[name]
    assert extras.pop("all") == [f"geodesic-core[{','.join(extras)}]"]


def test_distributions_carry_the_documents_where_they_were_built(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("hatchling.builders.wheel")
    hatch_build = importlib.import_module("hatch_build")
    monkeypatch.setattr(hatch_build, "build", lambda _root: None)
    site = tmp_path / "docs" / "_build"

    def included() -> dict[str, str]:
        build_data: dict[str, Any] = {"artifacts": [], "force_include": {}}
        hook = hatch_build.PageHook(str(tmp_path), {}, None, None, "", "wheel")
        hook.initialize("standard", build_data)
        assert PLACES[0].relative_to(ROOT).as_posix() in build_data["artifacts"]
        return dict(build_data["force_include"])

    assert included() == {}
    site.mkdir(parents=True)
    assert included() == {str(site): PLACES[0].relative_to(ROOT).as_posix()}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("folder", "package"),
    [(LIBRARY, "geodesic_core"), (SERVICE, "app"), (CLIENT, "geodesic_client")],
)
def test_a_wheel_has_the_sources_of_its_package_and_nothing_else(
    folder: Path, package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wheels = pytest.importorskip("hatchling.builders.wheel")
    monkeypatch.setenv("HATCH_BUILD_NO_HOOKS", "true")
    builder = wheels.WheelBuilder(str(folder))
    (wheel,) = builder.build(directory=str(tmp_path), versions=["standard"])
    names = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    root = CLIENT if folder == CLIENT else ROOT
    sources = {
        path.relative_to(root).as_posix()
        for path in (root / package).rglob("*.py")
        if "node_modules" not in path.parts
    }
    sources.discard("geodesic_core/hatch_build.py")
    others: dict[str, set[str]] = {
        "app": {"app/openapi.json"},
        "geodesic_core": {"geodesic_core/py.typed"},
        "geodesic_client": {"geodesic_client/py.typed"},
    }
    assert names == sources | others.get(package, set())


def test_compiled_kernels_lie_in_the_wheel_where_the_library_looks_for_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wheels = pytest.importorskip("hatchling.builders.wheel")
    level = tmp_path / "digest" / "cp311-x86-64-v3"
    level.mkdir(parents=True)
    (level / "sweep.kernel").touch()
    done = subprocess.CompletedProcess([], 0, f"{level}\n")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: done)
    monkeypatch.setenv("GEODESIC_WHEEL_LEVELS", "x86-64-v3")
    monkeypatch.delenv("HATCH_BUILD_NO_HOOKS", raising=False)
    builder = wheels.WheelBuilder(str(LIBRARY))
    (wheel,) = builder.build(directory=str(tmp_path), versions=["standard"])
    place = PRECOMPILED.relative_to(ROOT) / level.relative_to(tmp_path) / "sweep.kernel"
    assert place.as_posix() in zipfile.ZipFile(wheel).namelist()


@pytest.mark.slow
def test_the_example_of_the_library_runs() -> None:
    (example,) = re.findall(r"```python\n(.*?)```", (LIBRARY / "README.md").read_text(), re.DOTALL)
    assert float(told_by(example).split()[0]) > 3.0  # half way around the sphere
