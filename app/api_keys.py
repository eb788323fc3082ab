"""API keys, as an operator writes them: ``name:secret``, several separated by commas."""

import hashlib
import hmac
import re
from collections.abc import Sequence
from dataclasses import dataclass, field

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,63}")  # never like an address, nor a header's syntax
_SECRET = re.compile(r"[A-Za-z0-9._~+/-]+=*")  # the characters of a bearer token (RFC 6750)
_SHORTEST_SECRET = 16


@dataclass(frozen=True)
class ApiKey:
    """A key by its name; of its secret only the digest is kept, which nothing can print."""

    name: str
    digest: bytes = field(repr=False)


def parse_keys(text: str) -> tuple[ApiKey, ...]:
    """Return the keys in ``text``; one name may have several secrets, so that they can be changed.

    Raises
    ------
    ValueError
        An entry is no key, or two have one secret. The message shows no secret.
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
            f"key {number} is not name:secret; a name has at most 64 letters, digits, - and _, the "
            f"first a letter, and a secret letters, digits and -._~+/, with = at its end"
        )
    if len(secret) < _SHORTEST_SECRET:
        raise ValueError(f"the secret of key {name} is shorter than {_SHORTEST_SECRET} characters")
    return ApiKey(name, _digest(secret.encode()))


def name_of_secret(keys: Sequence[ApiKey], secret: bytes) -> str | None:
    """Return whose ``secret`` it is, in a time that does not depend on it."""
    digest = _digest(secret)
    names = [key.name for key in keys if hmac.compare_digest(key.digest, digest)]
    return names[0] if names else None


def _digest(secret: bytes) -> bytes:
    return hashlib.sha256(secret).digest()
