"""Files for containers: what they say is valid, and what they run exists."""

import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import kubernetes_validate
import pytest
import yaml
from typer.main import get_command

from app.cli.program import cli
from app.settings import Settings, variable_of
from tests.support.paths import ROOT

DOCKER = ROOT / "docker"
COMPOSE = yaml.safe_load((DOCKER / "compose.yaml").read_text())
KUBERNETES = list(yaml.safe_load_all((DOCKER / "kubernetes/geodesic.yaml").read_text()))
KUBERNETES_VERSION = "1.31"
VARIABLES = {variable_of(name) for name in Settings.model_fields}


def commands() -> Iterator[tuple[str, list[str]]]:
    """Yield each command that the containers run, by its place."""
    places = {
        f"compose: {name}": [*service.get("entrypoint", []), *service.get("command", [])]
        for name, service in COMPOSE["services"].items()
        if str(service["image"]).startswith("geodesic") and "command" in service
    }
    for document in KUBERNETES:
        for container in containers(document):
            places[f"kubernetes: {container['name']}"] = container["command"] + container["args"]
    (words,) = re.findall(r"^CMD (\[.*\])$", (DOCKER / "Dockerfile").read_text(), re.MULTILINE)
    places["Dockerfile"] = ["geodesic", *yaml.safe_load(words)]
    for place, words in places.items():
        if words[0] == "sh":
            for number, line in enumerate(words[2].split("&&")):
                yield f"{place}, {number}", shlex.split(line.strip().removeprefix("exec "))
        else:
            yield place, words


def containers(document: dict[str, Any]) -> list[dict[str, Any]]:
    template = document.get("spec", {}).get("template", {})
    found: list[dict[str, Any]] = template.get("spec", {}).get("containers", [])
    return found


@pytest.mark.slow
def test_compose_is_valid_by_its_schema() -> None:
    checker = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", "vendor.compose-spec"]
    ran = subprocess.run(  # noqa: S603 - a tool of ours
        [*checker, DOCKER / "compose.yaml"], capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stdout


@pytest.mark.parametrize("document", KUBERNETES, ids=lambda each: f"{each['kind']}")
def test_kubernetes_is_valid_by_its_schemas(document: dict[str, Any]) -> None:
    kubernetes_validate.validate(document, KUBERNETES_VERSION, strict=True)


def test_pods_get_no_variables_of_services() -> None:
    """Kubernetes would tell later pods of the Service `geodesic` by variables, see `Settings`."""
    pods = [document["spec"]["template"]["spec"] for document in KUBERNETES if containers(document)]
    assert [pod.get("enableServiceLinks") for pod in pods] == [False, False, False]


@pytest.mark.parametrize("words", list(dict(commands()).values()), ids=dict(commands()))
def test_commands_are_those_of_the_command_lines(words: list[str]) -> None:
    program, name, *options = words
    if program == "ray":
        ray = pytest.importorskip("ray.scripts.scripts")
        ray.cli.commands[name].make_context(name, options)
    else:
        command = get_command(cli).commands[name]  # type: ignore[attr-defined]
        command.make_context(name, options)


def test_variables_are_those_of_the_settings() -> None:
    texts = [path.read_text() for path in DOCKER.rglob("*") if path.is_file()]
    named = {name for text in texts for name in re.findall(r"\bGEODESIC_[A-Z_]+\b", text)}
    assert named - VARIABLES - {"GEODESIC_WHEEL_LEVELS"} == set()


def test_selectors_of_kubernetes_find_their_pods() -> None:
    labels = {
        document["spec"]["template"]["metadata"]["labels"]["app"]
        for document in KUBERNETES
        if containers(document)
    }
    for document in KUBERNETES:
        selector = document.get("spec", {}).get("selector", {})
        app = selector.get("app") or selector.get("matchLabels", {}).get("app")
        assert app is None or app in labels


@pytest.mark.slow
def test_the_image_is_built_of_what_it_copies(tmp_path: Path) -> None:
    """The steps of the Dockerfile that copy and build, in a folder that has nothing else."""
    lines = (DOCKER / "Dockerfile").read_text().partition("FROM python")[2].splitlines()
    for line in lines[: next(i for i, line in enumerate(lines) if line.startswith("FROM"))]:
        if line.startswith("COPY"):
            *sources, target = line.split()[1:]
            for source in sources:
                copy_to(ROOT / source, tmp_path / target)
    for folder in ("geodesic_core", "."):
        build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", tmp_path]
        ran = subprocess.run(  # noqa: S603 - a tool of ours
            [*build, folder],
            cwd=tmp_path,
            env={"HATCH_BUILD_NO_HOOKS": "1", "PATH": str(Path(sys.executable).parent)},
            capture_output=True,
            text=True,
            check=False,
        )
        assert ran.returncode == 0, ran.stderr + ran.stdout
    assert len(list(tmp_path.glob("*.whl"))) == 2


def copy_to(source: Path, target: Path) -> None:
    """Copy as COPY does: the content of a folder, or a file into a folder."""
    if source.is_dir():
        leave_out = shutil.ignore_patterns("node_modules", "__pycache__", "static")
        shutil.copytree(source, target, dirs_exist_ok=True, ignore=leave_out)
    else:
        shutil.copy(source, target)


def test_prometheus_asks_the_replicas_and_knows_the_alerts() -> None:
    configuration = yaml.safe_load((DOCKER / "prometheus/prometheus.yaml").read_text())
    for name in configuration["rule_files"]:
        assert (DOCKER / "prometheus" / name).is_file()
    (job,) = configuration["scrape_configs"]
    for target in job["static_configs"][0]["targets"]:
        assert target.partition(":")[0] in COMPOSE["services"]
