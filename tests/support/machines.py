"""Machines in network namespaces of their own, which a bridge connects: cables can be pulled.

Needs root and iproute2. Machines share files, memory and the table of processes with this one;
their Python programs see only their own processes.
"""

import os
import shutil
import signal
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path

import psutil

from tests.support.paths import ROOT

_OWN_PROCESSES = ROOT / "tests" / "support" / "own_processes"
OURS = 1
"""The last byte of our own address in a network; those of machines follow"""


def _ip(*arguments: str) -> str:
    command = ["ip", *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout  # noqa: S603 - of the system


@cache
def obstacle() -> str | None:
    """Return what keeps this process from making machines; None where nothing does."""
    if shutil.which("ip") is None:
        return "needs iproute2: apt-get install iproute2"
    name = f"g{os.getpid()}try"
    try:
        _ip("netns", "add", name)
        _ip("netns", "del", name)
    except subprocess.CalledProcessError as error:
        return f"needs root, to make network namespaces: {error.stderr.strip()}"
    return None


class Machine:
    """A machine with an address of its own; what runs there hears nobody once it is cut off."""

    def __init__(self, name: str, address: str, bridge: str) -> None:
        self.name, self.address = name, address
        self._cable = f"{name}c"
        _ip("netns", "add", name)
        _ip("link", "add", self._cable, "type", "veth", "peer", "name", "eth0", "netns", name)
        _ip("link", "set", self._cable, "master", bridge, "up")
        for command in (
            ("addr", "add", f"{address}/24", "dev", "eth0"),
            ("link", "set", "lo", "up"),
            ("link", "set", "eth0", "up"),
        ):
            _ip("-n", name, *command)

    @property
    def inside(self) -> Sequence[str]:
        """What goes before a command that is to run there."""
        return ("ip", "netns", "exec", self.name)

    def run(
        self, arguments: Sequence[str], log: Path, settings: Mapping[str, str]
    ) -> "subprocess.Popen[bytes]":
        """Start a command there."""
        with log.open("ab") as output:
            return subprocess.Popen(  # noqa: S603 - ours
                [*self.inside, *arguments],
                env=os.environ | settings | {"PYTHONPATH": str(_OWN_PROCESSES)},
                cwd=ROOT,
                stdout=output,
                stderr=subprocess.STDOUT,
            )

    def processes(self) -> list[psutil.Process]:
        """Return all processes that run there."""
        found = []
        for pid in map(int, _ip("netns", "pids", self.name).split()):
            with suppress(psutil.NoSuchProcess):
                found.append(psutil.Process(pid))
        return found

    def kill(self) -> None:
        """End all processes at once, as when the power fails."""
        for number in (signal.SIGSTOP, signal.SIGKILL):  # none sees another one end
            for process in self.processes():
                with suppress(psutil.NoSuchProcess):
                    process.send_signal(number)
        psutil.wait_procs(self.processes())

    @contextmanager
    def cut_off(self) -> Iterator[None]:
        """Pull the cable inside the block."""
        _ip("link", "set", self._cable, "down")
        try:
            yield
        finally:
            _ip("link", "set", self._cable, "up")

    def remove(self) -> None:
        self.kill()
        _ip("link", "del", self._cable)
        _ip("netns", "del", self.name)


class Network:
    """A bridge, and the machines at it."""

    def __init__(self, stack: ExitStack) -> None:
        self._stack = stack
        self._bridge = f"g{os.getpid()}"
        self._number = OURS
        taken = _ip("-o", "-4", "addr")
        self._prefix = next(
            prefix for n in range(40, 250) if (prefix := f"10.213.{n}.") not in taken
        )
        _ip("link", "add", self._bridge, "type", "bridge")
        stack.callback(_ip, "link", "del", self._bridge)
        _ip("addr", "add", f"{self._prefix}{OURS}/24", "dev", self._bridge)
        _ip("link", "set", self._bridge, "up")

    @property
    def addresses(self) -> str:
        """All its addresses, as a network with a mask."""
        return f"{self._prefix}0/24"

    def add(self) -> Machine:
        """Return a new machine, which goes when the network does."""
        self._number += 1
        name = f"{self._bridge}m{self._number}"
        machine = Machine(name, f"{self._prefix}{self._number}", self._bridge)
        self._stack.callback(machine.remove)
        return machine


@contextmanager
def network() -> Iterator[Network]:
    """Have a network inside the block."""
    with ExitStack() as stack:
        yield Network(stack)
