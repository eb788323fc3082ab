"""The store at a URL: objects that all machines reach, and a folder of this one for copies.

The folder has the layout of a store in a folder. Distance fields stay there, and so do jobs, where
no database is shared.
"""

import shutil
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import AbstractAsyncContextManager, asynccontextmanager, contextmanager
from pathlib import Path

import orjson
from anyio import to_thread

from app.errors import StoreUnavailableError
from app.settings import variable_of
from app.store.atomic import remove_partial
from app.store.layout import FIELDS, RESULTS, TEMPORARY, StoreError, make_identity
from app.store.meshes import WrittenMesh
from app.store.object_meshes import ObjectMeshes
from app.store.object_results import ObjectResults
from app.store.objects import UPLOADS, Objects
from app.store.ownership import owned
from app.store.results import FolderResults, Result, body_path

VARIABLES = {
    "s3": ("AWS_ENDPOINT_URL", "AWS_ACCESS_KEY_ID"),
    "gs": ("GOOGLE_APPLICATION_CREDENTIALS",),
    "az": ("AZURE_STORAGE_ACCOUNT_NAME", "AZURE_STORAGE_ACCOUNT_KEY"),
}
"""Variables of the environment from which obstore takes endpoints and credentials, by scheme"""

_OWNER = "owner.json"


class ObjectStore:
    """The store in ``objects``, see ``Store`` and ``Supply``, with copies of meshes in ``folder``.

    The copies take ``capacity`` bytes.
    """

    def __init__(self, objects: Objects, folder: Path, capacity: int, name: str) -> None:
        self.folder = folder
        self.meshes = ObjectMeshes(objects, folder, capacity)
        self.results = ObjectResults(objects)
        self.supply = self
        self._local_results = FolderResults(folder / RESULTS)
        self._objects = objects
        self._name = name

    @contextmanager
    def owned(self, *, is_shared: bool = False) -> Iterator[None]:  # noqa: ARG002 - the folder is not
        """Lock the folder, which is this process's alone."""
        with owned(self.folder):
            self._remove_unfinished()
            self.meshes.prepare()
            yield

    def claim(self, service: str | None) -> None:
        """Mark the store by an object that is written once."""
        content = orjson.dumps({"service": service or make_identity(self.folder)})
        try:
            is_ours = self._objects.create(_OWNER, content)
        except FileNotFoundError:
            raise StoreError(
                f"the store {self._name} does not exist: create its bucket or container first"
            ) from None
        except StoreUnavailableError as error:
            raise self._unusable(error) from None
        if not is_ours:
            raise StoreError(
                f"the store {self._name} belongs to another service: give this one a prefix of its "
                f"own, see {variable_of('store')}, or the same {variable_of('state')}; if the "
                f"other service no longer exists, remove the object {_OWNER}"
            )

    def identity(self) -> str:
        """Return the URL, with the name of the service that has the store."""
        try:
            owner = self._objects.read(_OWNER)
        except StoreUnavailableError as error:
            raise self._unusable(error) from None
        if owner is None:
            raise StoreError(
                f"there is no store at {self._name}: start geodesic serve on it first, and give "
                f"all machines the same {variable_of('store')}"
            )
        return f"{self._name} of {orjson.loads(owner)['service']}"

    @asynccontextmanager
    async def lent(self, file: Path) -> AsyncIterator[None]:
        """Send a file for the block."""
        name = self._upload_name(file)
        await to_thread.run_sync(self._objects.write, name, file)
        try:
            yield
        finally:
            await to_thread.run_sync(self._objects.remove, name)

    def holding(self, mesh_id: str) -> AbstractAsyncContextManager[None]:
        """Hold a copy of a mesh."""
        return self.meshes.holding(mesh_id)

    @asynccontextmanager
    async def bringing(self, file: Path | None, folder: Path) -> AsyncIterator[None]:
        """Fetch a file that is not here."""
        parents = {folder.parent} if file is None else {folder.parent, file.parent}
        new = [each for each in parents if not each.is_dir()]
        for each in new:
            each.mkdir(parents=True)
        try:
            if file is not None and file.parent in new:
                await to_thread.run_sync(self._objects.fetch, self._upload_name(file), file)
            yield
        finally:
            for each in new:
                await to_thread.run_sync(_remove, each)

    @asynccontextmanager
    async def bringing_results(self, names: Sequence[str]) -> AsyncIterator[None]:
        """Fetch the bodies of some results, and remove them afterwards."""
        files = {name: body_path(self.folder / RESULTS, name) for name in names}
        try:
            if files:
                await to_thread.run_sync(self.results.fetch, files)
            yield
        finally:
            for name in names:
                self._local_results.remove(name)

    async def send_mesh(self, written: WrittenMesh) -> bool:
        """Send a mesh."""
        return await self.meshes.send(written)

    async def send_result(self, result: Result) -> None:
        """Send a result."""
        await self.results.send(result, self._local_results.body(result))

    def discard_result(self, name: str) -> None:
        """Remove the local files of a result."""
        self._local_results.remove(name)

    async def distrust(self, mesh_id: str) -> None:
        """Drop the copy of a mesh."""
        await self.meshes.distrust(mesh_id)

    def _remove_unfinished(self) -> None:
        """Remove what was under way when a former process died: answers, pulls, and fields."""
        for name in (RESULTS, TEMPORARY):
            _remove(self.folder / name)
        remove_partial(self.folder / FIELDS)

    def _upload_name(self, file: Path) -> str:
        return f"{UPLOADS}/{file.relative_to(self.folder).as_posix()}"

    def _unusable(self, error: StoreUnavailableError) -> StoreError:
        variables = " and ".join(VARIABLES[self._name.partition(":")[0]])
        return StoreError(
            f"the store {self._name} cannot be used: {error}; endpoint and credentials come from "
            f"environment variables, such as {variables}"
        )


def _remove(folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
