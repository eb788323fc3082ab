"""The two distributions of this repository: one version, and each its own folder."""

import re
import subprocess
import tomllib
import zipfile
from itertools import chain
from pathlib import Path
from typing import Any

import pytest

from app import __version__
from geodesic_core.kernels.jit.cache import PRECOMPILED
from tests.support.fresh import told_by
from tests.support.paths import ROOT

LIBRARY, SERVICE = ROOT / "geodesic_core", ROOT


def project(folder: Path) -> dict[str, Any]:
    table: dict[str, Any] = tomllib.loads((folder / "pyproject.toml").read_text())["project"]
    return table


def requirements(folder: Path) -> dict[str, str]:
    """Return what a distribution requires, with its extras: the versions by name."""
    extras = project(folder).get("optional-dependencies", {})
    listed = chain(project(folder)["dependencies"], *extras.values())
    return dict(re.fullmatch(r"([\w.-]+(?:\[.*\])?)(.*)", each).groups() for each in listed)


def test_both_have_one_version_and_the_service_requires_that_of_the_library() -> None:
    assert project(LIBRARY)["version"] == project(SERVICE)["version"] == __version__
    assert requirements(SERVICE)["geodesic-core[all]"] == f"=={__version__}"


def test_both_ask_for_the_same_of_python_and_of_what_both_require() -> None:
    library, service = requirements(LIBRARY), requirements(SERVICE)
    shared = library.keys() & service.keys()
    assert shared >= {"numpy", "scipy", "filelock"}
    assert {name: library[name] for name in shared} == {name: service[name] for name in shared}
    assert project(LIBRARY)["requires-python"] == project(SERVICE)["requires-python"]


def test_both_have_the_license() -> None:
    assert (LIBRARY / "LICENSE").read_bytes() == (SERVICE / "LICENSE").read_bytes()


def test_all_extras_of_the_library_are_in_one() -> None:
    extras = project(LIBRARY)["optional-dependencies"]
    for name in ("tables", "brain", "vtk", "plot"):  # large, or of a field of its own
        del extras[name]
    assert extras.pop("all") == [f"geodesic-core[{','.join(extras)}]"]


@pytest.mark.parametrize(("folder", "package"), [(LIBRARY, "geodesic_core"), (SERVICE, "app")])
def test_a_wheel_has_the_sources_of_its_package_and_nothing_else(
    folder: Path, package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wheels = pytest.importorskip("hatchling.builders.wheel")
    monkeypatch.setenv("HATCH_BUILD_NO_HOOKS", "true")
    builder = wheels.WheelBuilder(str(folder))
    (wheel,) = builder.build(directory=str(tmp_path), versions=["standard"])
    names = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    sources = {
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / package).rglob("*.py")
        if "node_modules" not in path.parts
    }
    sources.discard("geodesic_core/hatch_build.py")
    examples = {f"app/examples/{path.name}" for path in (ROOT / "openapi/examples").iterdir()}
    assert names == (sources if package == "geodesic_core" else sources | examples)


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
