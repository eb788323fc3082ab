"""The client for TypeScript, as it is packed: it compiles, and has a running service answer."""

import json
import re
import tarfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.support.node import PACKAGES, alone, build_page, node_runner, pack
from tests.support.paths import ROOT
from tests.support.processes import Server

pytestmark = pytest.mark.slow

PACKAGE = ROOT / "client" / "typescript"
PROGRAM = Path(__file__).with_name("program.mts")
NODE_TYPES = """
declare module "node:assert/strict" {
  const assert: {
    ok(value: unknown, message?: string): asserts value;
    equal(actual: unknown, expected: unknown): void;
    deepEqual(actual: unknown, expected: unknown): void;
    match(text: string, pattern: RegExp): void;
    rejects(work: Promise<unknown>, error: object): Promise<void>;
  };
  export default assert;
}
declare const process: { argv: string[] };
"""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    server = Server(tmp_path_factory.mktemp("typescript"))
    yield server
    server.close()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, testrun_uid: str) -> Path:
    """A folder in which the package is installed, from its archive."""
    folder = tmp_path_factory.mktemp("node")
    with alone("page", tmp_path_factory, testrun_uid):
        build_page()
        archive = pack(PACKAGE, folder)
    with tarfile.open(archive) as packed:
        packed.extractall(folder, filter="data")
    (folder / "node_modules").mkdir()
    (folder / "package").rename(folder / "node_modules" / "geodesic-client")
    return folder


@pytest.fixture(scope="module")
def node(folder: Path) -> Callable[..., str]:
    return node_runner(folder)


def compile_program(node: Callable[..., str], *programs: Path | str) -> None:
    """Compile programs against the types of the package."""
    options = "--noEmit --strict --exactOptionalPropertyTypes --module nodenext --target es2022"
    libraries = ("--lib", "esnext,dom,dom.iterable")
    compiler = PACKAGES / "typescript" / "bin" / "tsc"
    node(compiler, *options.split(), *libraries, *map(str, programs))


def test_it_asks_everything(server: Server, node: Callable[..., str], folder: Path) -> None:
    (folder / "node.d.ts").write_text(NODE_TYPES)
    program = folder / PROGRAM.name
    program.write_text(PROGRAM.read_text())
    compile_program(node, program, "node.d.ts")
    assert node(program, server.url).strip() == "all is well"


def test_the_example_of_its_readme_runs(
    server: Server, node: Callable[..., str], folder: Path
) -> None:
    (example,) = re.findall(r"```ts\n(.*?)```", (PACKAGE / "README.md").read_text(), re.DOTALL)
    program = folder / "example.mts"
    shown = "console.log(JSON.stringify([length, points?.length]));\n"
    program.write_text(example.replace("http://127.0.0.1:8000", server.url) + shown)
    compile_program(node, program)
    length, points = json.loads(node(program))
    assert length > 0
    assert points > 2


def test_the_archive_has_what_was_built_and_nothing_else(folder: Path) -> None:
    files = {path.name for path in folder.glob("node_modules/geodesic-client/*")}
    assert files == {"package.json", "README.md", "dist"}
    built = {path.name for path in folder.glob("node_modules/geodesic-client/dist/*")}
    sources = {path.stem for path in (PACKAGE / "src").glob("*.ts")}
    assert built == {f"{name}{suffix}" for name in sources for suffix in (".js", ".d.ts")}
