"""``geodesic cluster status``: the hosts of a cluster, and their load."""

import asyncio
import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING

import typer

from app.cli.cluster import Address, joined_if_asked
from app.cli.configuration import read_settings
from app.cli.output import AsJson
from app.cli.steps import Failure

if TYPE_CHECKING:
    from app.engine.cluster import HostReport

_SILENCE_S = 10.0
"""Seconds after which a host does not answer"""

cluster = typer.Typer(help="Inspect a cluster of machines.", no_args_is_help=True)


@cluster.callback()
def _group() -> None:
    """Inspect a cluster of machines."""


@cluster.command()
def status(address: Address = None, as_json: AsJson = False) -> None:
    """Show the hosts of a cluster: their workers, their load, and the code that they run.

    The exit code is 1 if a host does not answer, or if there is none.
    """
    settings = read_settings(address=address, engine="ray")
    with joined_if_asked(settings):
        reports = asyncio.run(_reports())
    if as_json:
        hosts = {name: None if each is None else _facts(each) for name, each in reports.items()}
        typer.echo(json.dumps({"address": settings.address, "hosts": hosts}, indent=1))
    else:
        typer.echo(f"head        {settings.address}, {len(reports)} hosts")
        for name, report in reports.items():
            typer.echo(f"{name}  {_in_words(report)}")
    if not reports:
        raise Failure("the cluster has no hosts: start `geodesic node` on each machine")
    silent = [name for name, report in reports.items() if report is None]
    if silent:
        raise Failure(f"no answer from {', '.join(silent)}: see the logs there")


async def _reports() -> Mapping[str, "HostReport | None"]:
    """Return what each host tells; None for one that does not answer."""
    from app.engine.cluster import HostLostError, HostReport
    from app.engine.ray_cluster import RayCluster
    from app.engine.wire import decode

    reached = RayCluster()

    async def ask(host: str) -> HostReport | None:
        try:
            told = await asyncio.wait_for(reached.beat(host, []), _SILENCE_S)
        except (HostLostError, TimeoutError):
            return None
        report: HostReport = decode(told, HostReport)
        return report

    names = sorted(await reached.hosts())
    return dict(zip(names, await asyncio.gather(*map(ask, names)), strict=True))


def _facts(report: "HostReport") -> Mapping[str, object]:
    """Return the members of a report that tell of the host itself."""
    load = asdict(report.load)
    return {
        "workers": report.workers,
        "busy": load["busy"],
        "waiting": load["waiting"],
        "missing": load["missing"],
        "lost": load["lost"],
        "is_ready": report.is_ready,
        "is_draining": report.is_draining,
        "code": report.code,
    }


def _in_words(report: "HostReport | None") -> str:
    if report is None:
        return "no answer"
    state = "draining" if report.is_draining else "ready" if report.is_ready else "starting"
    load = report.load
    return (
        f"{state}, {load.busy} of {report.workers} workers busy, {load.waiting} tasks waiting, "
        f"{load.lost} workers lost so far, code {report.code}"
    )
