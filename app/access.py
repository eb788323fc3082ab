"""Who asks: the name of an API key, or an address where no keys are asked for."""

from dataclasses import dataclass
from functools import lru_cache
from ipaddress import IPv6Address, ip_address, ip_network


@dataclass(frozen=True)
class Caller:
    """Who is behind a request: limits, places in the queue and jobs are counted by ``name``."""

    name: str
    has_key: bool

    @property
    def owner(self) -> str | None:
        """The name by which the caller owns what it stores; without keys nobody owns anything."""
        return self.name if self.has_key else None

    def may_delete(self, owner: str | None) -> bool:
        """Whether what ``owner`` stored is the caller's to delete."""
        return not self.has_key or owner in (None, self.name)


@lru_cache(maxsize=1024)
def caller_at(host: str | None) -> Caller:
    """Return who asks from an address; those of one IPv6 network (/64) are one."""
    try:
        address = ip_address(host or "")
    except ValueError:
        return Caller("unknown", has_key=False)  # a Unix socket, or what a proxy made up
    if isinstance(address, IPv6Address):
        mapped = address.ipv4_mapped
        address = mapped or ip_network((int(address), 64), strict=False).network_address
    return Caller(str(address), has_key=False)
