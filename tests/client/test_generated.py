"""Generators make a client of the interface document, which computes a path, and types."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.node import PACKAGES, alone, build_page, miss, node_runner
from tests.support.paths import ROOT
from tests.support.processes import Server

pytestmark = [pytest.mark.slow, pytest.mark.file_slice(1)]

DOCUMENT = ROOT / "openapi" / "openapi.json"
TYPES = ROOT / "client" / "typescript" / "src" / "schema.ts"

GENERATOR = "openapi-python-client==0.29.1"
"""The most used generator of Python; in an environment of its own, as it asks for an older Typer"""
ENVIRONMENT = ROOT / ".cache" / "generator"
CONFIGURATION = """
content_type_overrides:
  application/x-npy: application/octet-stream
post_hooks: []
"""
MYPY = """
[mypy]
[mypy-generated.client]
# Written by the generator whatever the document says; httpx has narrower types.
ignore_errors = True
"""
PROGRAM = """
import sys
from generated import Client
from generated.api.meshes import create_mesh
from generated.api.queries import compute_path
from generated.models import CreateMeshSample, MeshDocument, PathAnswer, PathRequest

client = Client(base_url=sys.argv[1])
mesh = create_mesh.sync(client=client, sample=CreateMeshSample.PLANE, faces=200)
assert isinstance(mesh, MeshDocument)
question = PathRequest(source=0, target=120)
path = compute_path.sync(mesh.id, client=client, body=question)
assert isinstance(path, PathAnswer)
print(path.length)
"""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    server = Server(tmp_path_factory.mktemp("generated"))
    yield server
    server.close()


@pytest.fixture(scope="module")
def generator(tmp_path_factory: pytest.TempPathFactory, testrun_uid: str) -> Path:
    """The folder of programs of the environment with the generator, which is made once."""
    programs = ENVIRONMENT / "bin"
    done = ENVIRONMENT / GENERATOR
    with alone("generator", tmp_path_factory, testrun_uid):
        if not done.is_file():
            venv = ("venv", "--clear", "--without-pip", ENVIRONMENT)
            pip = ("pip", "--python", programs / "python", "install", "--quiet", "--no-compile")
            subprocess.run([sys.executable, "-m", *venv], check=True)  # noqa: S603
            installed = subprocess.run(  # noqa: S603
                [sys.executable, "-m", *pip, GENERATOR], check=False
            )
            if installed.returncode:
                miss(f"{GENERATOR} could not be installed")
            done.touch()
    return programs


def run(*command: str | Path, folder: Path) -> str:
    done = subprocess.run(  # noqa: S603 - programs of the environments of this test
        command, cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_a_generated_python_client_computes_a_path(
    server: Server, generator: Path, tmp_path: Path
) -> None:
    (tmp_path / "configuration.yaml").write_text(CONFIGURATION)
    (tmp_path / "mypy.ini").write_text(MYPY)
    (tmp_path / "program.py").write_text(PROGRAM)
    options = ("--meta", "none", "--output-path", "generated", "--fail-on-warning")
    command = (generator / "openapi-python-client", "generate", "--path", DOCUMENT)
    run(*command, "--config", "configuration.yaml", *options, folder=tmp_path)

    python = generator / "python"
    mypy = (sys.executable, "-m", "mypy", "--strict", "--python-executable", python)
    run(*mypy, "generated", "program.py", folder=tmp_path)
    assert float(run(python, "program.py", server.url, folder=tmp_path)) == pytest.approx(2**0.5)


@pytest.fixture(scope="module")
def _packages(tmp_path_factory: pytest.TempPathFactory, testrun_uid: str) -> None:
    with alone("page", tmp_path_factory, testrun_uid):
        build_page()


@pytest.mark.usefixtures("_packages")
def test_the_types_for_typescript_are_those_of_the_document(tmp_path: Path) -> None:
    script = PACKAGES / "openapi-typescript" / "bin" / "cli.js"
    node_runner(tmp_path)(script, str(DOCUMENT), "--output", "schema.ts")
    assert (tmp_path / "schema.ts").read_text() == TYPES.read_text(), "run: scripts/page types"
