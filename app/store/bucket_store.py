"""The store at a URL: objects that all machines reach, and a folder of this one for copies.

The folder has the layout of a store in a folder. Distance fields stay there, and so do jobs, where
no database is shared.
"""

import shutil
from collections.abc import AsyncIterator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractAsyncContextManager, asynccontextmanager, contextmanager, suppress
from pathlib import Path

import orjson
from anyio import to_thread

from app.errors import StoreUnavailableError
from app.settings import variable_of
from app.store.atomic import remove_partial
from app.store.bucket import Bucket
from app.store.layout import FIELDS, RESULTS, TEMPORARY, StoreError, make_identity
from app.store.mesh_copies import CopiedMeshes
from app.store.meshes import WrittenMesh
from app.store.objects import UPLOADS
from app.store.ownership import Share
from app.store.results import Result, ResultFiles, body_path
from app.store.store import Store

VARIABLES = {
    "s3": ("AWS_ENDPOINT_URL", "AWS_ACCESS_KEY_ID"),
    "gs": ("GOOGLE_APPLICATION_CREDENTIALS",),
    "az": ("AZURE_STORAGE_ACCOUNT_NAME", "AZURE_STORAGE_ACCOUNT_KEY"),
}
"""Variables of the environment from which obstore takes endpoints and credentials, by scheme"""

_OWNER = "owner.json"
_FETCHED_AT_ONCE = 4


class BucketStore(Store):
    """The store in ``objects``, see ``Store``, with copies of meshes in ``folder``.

    The copies take ``capacity`` bytes. It brings what work needs to that folder, and takes away
    what it made.
    """

    def __init__(self, objects: Bucket, folder: Path, capacity: int, name: str) -> None:
        super().__init__(folder)
        self._copies = CopiedMeshes(objects, folder, capacity)
        self.meshes = self._copies
        self._local_results = self.results
        self.results = ResultFiles(objects)
        self.supply = self
        self._objects = objects
        self._name = name

    @contextmanager
    def owned(self, *, is_shared: bool = False) -> Iterator[Share]:  # noqa: ARG002 - the folder is not
        """Lock the folder, which is this process's alone; remove what a former one left there."""
        with super().owned() as share:
            for name in (RESULTS, TEMPORARY):
                _remove(self.folder / name)
            (self.folder / TEMPORARY).mkdir()
            remove_partial(self.folder / FIELDS)
            yield share

    def claim(self, service: str | None) -> None:
        """Mark the store by an object that is written once; remove what uploads have left."""
        content = orjson.dumps({"service": service or make_identity(self.folder)})
        try:
            is_ours = self._objects.create(_OWNER, content)
            uploads = self._objects.found(UPLOADS) if is_ours else ()
            self._objects.remove(*(each.name for each in uploads if each.is_abandoned))
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
        """Have a mesh in the folder inside the block."""
        return self._copies.holding(mesh_id)

    @asynccontextmanager
    async def bringing(self, file: Path | None, folder: Path) -> AsyncIterator[None]:
        """Have a lent file, if any, and the parent of a folder to come, inside the block."""
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
        """Have the bodies of some results in the folder inside the block.

        Raises ``StoreUnavailableError`` where one is gone or damaged.
        """
        try:
            await to_thread.run_sync(self._fetch_all, names)
            yield
        finally:
            for name in names:
                self._local_results.remove(name)

    async def send_mesh(self, written: WrittenMesh) -> bool:
        """Send the files of a mesh; False where it is to be written again."""
        return await self._copies.send(written)

    async def send_result(self, result: Result) -> None:
        """Send the files of a result."""
        path = body_path(self.folder / RESULTS, result.name)
        await self.results.write(result.name, path, result.manifest)

    def discard_result(self, name: str) -> None:
        """Remove the files of a result here, if there are any."""
        self._local_results.remove(name)

    async def drop_copy(self, mesh_id: str) -> None:
        """Pull a mesh again before it is used."""
        await self._copies.drop_copy(mesh_id)

    def _fetch_all(self, names: Sequence[str]) -> None:
        with ThreadPoolExecutor(_FETCHED_AT_ONCE) as pool:
            list(pool.map(self._fetch, names))

    def _fetch(self, name: str) -> None:
        manifest, path = self.results.manifest(name), body_path(self.folder / RESULTS, name)
        path.parent.mkdir(parents=True, exist_ok=True)
        with suppress(FileNotFoundError):
            if manifest is not None:
                fetched = self._objects.fetch(self.results.body_name(name, manifest), path)
                if fetched == manifest.crc32:
                    return
        self.results.remove(name)
        raise StoreUnavailableError(f"the stored result {name} is gone or damaged")

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
