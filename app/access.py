"""Callers and their API keys: the name by which limits, places in the queue and jobs are counted.

All keys of a service are those of one tenant, who shares meshes, names and jobs among them.
"""

import hashlib
import hmac
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from ipaddress import IPv6Address, ip_address, ip_network

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,63}")  # neither an address nor header syntax
_SECRET = re.compile(r"[A-Za-z0-9._~+/-]+=*")  # the characters of a bearer token (RFC 6750)
_SHORTEST_SECRET = 16


@dataclass(frozen=True)
class Caller:
    """The party behind a request: the name of an API key, or an address where no keys are set."""

    name: str
    has_key: bool


@lru_cache(maxsize=1024)
def caller_at(host: str | None) -> Caller:
    """Return the caller at an address; all addresses of one IPv6 network (/64) are one caller."""
    try:
        address = ip_address(host or "")
    except ValueError:
        return Caller("unknown", has_key=False)  # a Unix socket, or an address a proxy made up
    if isinstance(address, IPv6Address):
        mapped = address.ipv4_mapped
        address = mapped or ip_network((int(address), 64), strict=False).network_address
    return Caller(str(address), has_key=False)


@lru_cache(maxsize=1024)
def is_loopback(host: str) -> bool:
    """Tell whether a name or address, such as ``localhost`` or ``[::1]``, is this machine's."""
    try:
        return ip_address(host.removeprefix("[").removesuffix("]")).is_loopback
    except ValueError:
        return host == "localhost" or host.endswith(".localhost")


@dataclass(frozen=True)
class ApiKey:
    """A named key. Only the digest of its secret is stored, and no representation shows it."""

    name: str
    digest: bytes = field(repr=False)


def parse_keys(text: str) -> tuple[ApiKey, ...]:
    """Return the keys in ``text``, written as ``name:secret`` and separated by commas.

    One name may have several secrets, so that an operator can replace one without an outage.

    Raises
    ------
    ValueError
        An entry is not a key, or two keys share a secret. The message shows no secret.
    """
    if not text.strip():
        return ()
    keys = tuple(_parse(entry.strip(), n) for n, entry in enumerate(text.split(","), start=1))
    if len({key.digest for key in keys}) < len(keys):
        raise ValueError("two keys have the same secret")
    return keys


def _parse(entry: str, number: int) -> ApiKey:
    name, _, secret = entry.partition(":")
    if not _NAME.fullmatch(name) or not _SECRET.fullmatch(secret):
        raise ValueError(
            f"key {number} is not name:secret. A name has at most 64 letters, digits, - and _, and "
            "begins with a letter. A secret has letters, digits and -._~+/, and may end with ="
        )
    if len(secret) < _SHORTEST_SECRET:
        raise ValueError(f"the secret of key {name} is shorter than {_SHORTEST_SECRET} characters")
    return ApiKey(name, _digest(secret.encode()))


def name_of_secret(keys: Sequence[ApiKey], secret: bytes) -> str | None:
    """Return the name of the key with this ``secret``, in constant time."""
    digest = _digest(secret)
    names = [key.name for key in keys if hmac.compare_digest(key.digest, digest)]
    return names[0] if names else None


def _digest(secret: bytes) -> bytes:
    return hashlib.sha256(secret).digest()
