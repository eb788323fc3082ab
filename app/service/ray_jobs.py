"""The runner of jobs of a cluster: one process, which Ray keeps somewhere in it."""

import asyncio
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager, AsyncExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Protocol

from app import logs
from app.jobs import Job, JobRunner
from app.settings import Settings


class _Service(Protocol):
    job_runner: JobRunner

    def running(self) -> AbstractAsyncContextManager[None]: ...


class JobsProcess:
    """A service that runs jobs, and that no request reaches. It starts with the first nudge."""

    def __init__(self, service_of: Callable[[Settings], _Service], settings: Settings) -> None:
        self._stack = AsyncExitStack()
        copies = Path(self._stack.enter_context(TemporaryDirectory(prefix="geodesic-jobs-")))
        self._settings = settings.model_copy(update={"copies": copies})
        self._service_of = service_of
        self._service: _Service | None = None
        self._starting = asyncio.Lock()

    async def nudge(self) -> None:
        """Look for jobs, see ``Runner``."""
        async with self._starting:
            if self._service is None:
                logs.install(self._settings.log_format)
                service = self._service_of(self._settings)
                await self._stack.enter_async_context(service.running())
                self._service = service
        self._service.job_runner.nudge()

    async def forget(self, job_id: str) -> None:
        """Forget a job, see ``Runner``."""
        if self._service is not None:
            self._service.job_runner.forget(job_id)


class RemoteRunner:
    """The runner of a cluster as its services see it, see ``Runner``."""

    def __init__(self, service_of: Callable[[Settings], _Service], settings: Settings) -> None:
        import ray

        from app.engine.ray_cluster import VARIABLES

        if isinstance(settings.store, Path):
            settings = settings.model_copy(update={"store": settings.store.resolve()})
        options: dict[str, Any] = {
            "name": "jobs",
            "get_if_exists": True,
            "lifetime": "detached",
            "max_restarts": -1,
            "num_cpus": 0,
            "runtime_env": {"env_vars": VARIABLES},
        }
        process: Any = ray.remote(JobsProcess)
        self._process = process.options(**options).remote(service_of, settings)

    def start(self, _job: Job, _query: bytes) -> None:
        """Have that process look for the job, see ``Runner``."""
        self.nudge()

    def nudge(self) -> None:
        """See ``Runner``."""
        self._process.nudge.remote()

    def forget(self, job_id: str) -> None:
        """See ``Runner``."""
        self._process.forget.remote(job_id)
