"""The server: it bounds what clients may send, and drains the service before it stops."""

import asyncio
import math
from functools import partial
from types import FrameType
from typing import Any, cast

import uvicorn
from fastapi import FastAPI

from app.access import is_loopback
from app.http.connections import Connections
from app.http.protocol import BoundedHttpProtocol
from app.service.service import Service
from app.settings import Settings

_NOTICE_S = 5.0
"""Seconds in which a load balancer notices that a service is about to stop"""


class DrainingServer(uvicorn.Server):
    """A server that drains its service as soon as it is to stop, where uvicorn does so last.

    For some seconds before, only `/readyz` says so. A second signal ends this time.
    """

    def __init__(self, config: uvicorn.Config, service: Service, delay_s: float) -> None:
        super().__init__(config)
        self._service = service
        self._delay_s = delay_s

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """Announce the end at a signal, and drain after the delay; at once at the second one."""
        is_first = not self._service.is_leaving
        self._service.announce_end()
        if is_first and self._delay_s > 0:
            loop = asyncio.get_running_loop()
            drain = partial(self._drain, sig, frame)
            loop.call_soon_threadsafe(partial(loop.call_later, self._delay_s, drain))
        else:
            self._drain(sig, frame)

    def _drain(self, sig: int, frame: FrameType | None) -> None:
        self._service.drain()
        super().handle_exit(sig, frame)


def server_of(app: FastAPI, host: str, port: int, settings: Settings) -> DrainingServer:
    """Return the server of an application, which listens once it runs."""
    connect = partial(BoundedHttpProtocol, connections=Connections(settings))
    config = uvicorn.Config(
        app,
        host,
        port,
        http=cast(Any, connect),
        root_path=settings.root_path,
        ws="none",
        timeout_graceful_shutdown=math.ceil(settings.drain_s),  # uvicorn takes whole seconds
        log_config=None,
        access_log=False,  # the application has its own
        proxy_headers=bool(settings.trusted_proxies),
        forwarded_allow_ips=list(settings.trusted_proxies),
    )
    usual_s = 0.0 if is_loopback(host) else _NOTICE_S
    delay_s = usual_s if settings.drain_delay_s is None else settings.drain_delay_s
    return DrainingServer(config, app.state.service, delay_s)
