"""Protection against cross-site requests, which pages of other sites make a browser send."""

from collections.abc import Iterable
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from app.access import is_loopback
from app.errors import ProblemError, problem
from app.http.middleware.probes import PROBES
from app.http.prefix import path_in
from app.settings import Settings, variable_of

_SAFE = frozenset({"GET", "HEAD", "OPTIONS"})


class CrossSiteMiddleware:
    """Middleware that refuses foreign names in `Host`, and changes by pages of other sites.

    A site can point its own name at the address of this service (DNS rebinding). The browser then
    takes the service for that site, and only `Host` shows it. This matters where no keys protect
    the service, above all on a loopback address, which other machines cannot reach otherwise.
    """

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self.app = app
        self.has_keys = bool(settings.api_keys)
        self.hosts = settings.allowed_hosts
        self.origins = settings.cors_origins

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request."""
        # Probes reveal nothing, and are asked for under any name.
        if scope["type"] == "http" and path_in(scope) not in PROBES:
            self._check_host(scope)
            if scope["method"] not in _SAFE:
                self._check_origin(scope)
        await self.app(scope, receive, send)

    def _check_host(self, scope: Scope) -> None:
        local = bool(scope["server"]) and is_loopback(scope["server"][0])
        if not self.hosts and (self.has_keys or not local):
            return
        given = Headers(scope=scope).getlist("host")
        name = _name(given[0]) if len(given) == 1 else ""
        if not (_is_among(name, self.hosts) or (local and is_loopback(name))):
            raise _host_not_allowed(name)

    def _check_origin(self, scope: Scope) -> None:
        headers = Headers(scope=scope)
        # Browsers send it, and pages cannot forge it. It holds where a proxy changes `Host`.
        site = headers.get("sec-fetch-site")
        if site in ("same-origin", "none"):
            return
        origin = headers.get("origin")
        if "*" in self.origins or origin in self.origins:
            return
        if origin is None:
            if site is not None:
                raise _origin_not_allowed("another site")
            return  # no browser
        netloc = _netloc(origin)
        if netloc != headers.get("host", "").lower() and not _is_among(_name(netloc), self.hosts):
            raise _origin_not_allowed(origin)


def _is_among(name: str, hosts: Iterable[str]) -> bool:
    return any(
        name == host or (host.startswith("*.") and name.endswith(host[1:])) for host in hosts
    )


def _netloc(origin: str) -> str:
    try:
        return urlsplit(origin).netloc.lower()
    except ValueError:
        return ""


def _name(host: str) -> str:
    """Return the name in ``host``, in lower case and without the port."""
    name, _, port = host.lower().rpartition(":")
    return name if name and port.isascii() and port.isdigit() else host.lower()


def _host_not_allowed(name: str) -> ProblemError:
    detail = f"the service does not accept requests for the host name {name[:100]!r}"
    hint = f"an operator can allow it with {variable_of('allowed_hosts')}"
    return problem("host_not_allowed", detail, hint=hint, setting="allowed_hosts")


def _origin_not_allowed(origin: str) -> ProblemError:
    detail = f"a page from {origin[:100]!r} may not make changes here"
    hint = (
        f"an operator can allow it with {variable_of('cors_origins')}; a proxy must pass on `Host` "
        f"unchanged, or its name must be in {variable_of('allowed_hosts')}"
    )
    return problem("origin_not_allowed", detail, hint=hint, setting="cors_origins")
