"""Run benchmarks, print their tables and write them to ``RESULTS.md``."""

import argparse
import os
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

from benchmarks import (
    approximate,
    attacks,
    certificates,
    cluster,
    cortex,
    costs,
    cuts,
    efforts,
    exact,
    fast,
    first_colours,
    gate,
    large_matrix,
    load,
    maps,
    matrix,
    page,
    path,
    sampling,
    service,
    sharing,
    topology,
    virtual_sources,
)
from benchmarks.failures import hours
from benchmarks.failures import measurement as failures
from benchmarks.inputs import Inputs
from benchmarks.paper import experiments as paper
from benchmarks.peers import report as peers
from benchmarks.scaling import measurement as scaling
from benchmarks.soak import measurement as soak
from benchmarks.tables import Section, write

BENCHMARKS: dict[str, Callable[[Inputs, int], Section | Iterable[Section]]] = {
    "topology": topology.run,
    "exact": exact.run,
    "approximate": approximate.run,
    "merging": approximate.run_merging,
    "growth": approximate.run_growth,
    "fast": fast.run,
    "efforts": efforts.run,
    "virtual-sources": virtual_sources.run,
    "path": path.run,
    "path-peers": path.run_peers,
    "fast-path": path.run_fast,
    "landmarks": path.run_landmarks,
    "maps": maps.run,
    "samples": sampling.run,
    "cuts": cuts.run,
    "certificates": certificates.run,
    "costs": costs.run,
    "matrix": matrix.run,
    "cortex": cortex.run,
    "large-matrix": large_matrix.run,
    "sharing": sharing.run,
    "service": service.run,
    "load": load.run,
    "attacks": attacks.run,
    "cluster": cluster.run,
    "large-answers": service.run_large,
    "page": page.run,
    "first-colours": first_colours.run,
}
SOAK, SCALING, FAILURES, HOURS = "soak", "scaling", "failures", "hours"
PAPER, PEERS, GATE = "paper", "peers", "gate"
"""Run only where they are named, and write reports of their own"""
NAMES = (*BENCHMARKS, SOAK, SCALING, FAILURES, HOURS, PAPER, PEERS, GATE)
ROOT = Path(__file__).parents[1]


def main() -> None:
    """Run the benchmarks that the arguments name, by default all of them."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="name", help=f"any of {', '.join(NAMES)}")
    parser.add_argument("--runs", type=int, default=5, help="runs of which the median counts")
    parser.add_argument("--minutes", type=float, default=10.0, help="minutes of soak and hours")
    parser.add_argument(
        "--meshes",
        type=Path,
        default=Path(os.environ.get("MESHES", ROOT / "../shared/meshes")),
        help="folder of real meshes, by default $MESHES; those it lacks are left out",
    )
    parser.add_argument("--new", action="store_true", help="commit the ratios of the gate anew")
    parser.add_argument(
        "--peer",
        action="append",
        default=[],
        metavar="NAME=COMMAND",
        help="another peer: COMMAND mesh.obj SOURCE prints a distance for each vertex",
    )
    arguments = parser.parse_args()
    unknown = set(arguments.names) - set(NAMES)
    if unknown:
        parser.error(f"unknown benchmark: {', '.join(sorted(unknown))}")
    inputs = Inputs(arguments.meshes)
    for name in arguments.names or BENCHMARKS:
        if name == SOAK:
            print(soak.run(arguments.minutes, Path(__file__).with_name("results") / "soak.md"))
            continue
        if name == SCALING:
            print(scaling.run(Path(__file__).with_name("results") / "scaling.md"))
            continue
        if name == FAILURES:
            print(failures.run(Path(__file__).with_name("results") / "failures.md"))
            continue
        if name == HOURS:
            print(hours.run(arguments.minutes, Path(__file__).with_name("results") / "hours.md"))
            continue
        if name == GATE:
            text, is_good = gate.run(is_new=arguments.new)
            print(text)
            if not is_good:
                sys.exit(1)
            continue
        if name == PEERS:
            executables = dict(each.split("=", 1) for each in arguments.peer)
            print(peers.run(inputs, executables))
            continue
        if name == PAPER:
            for text in paper.run(inputs, arguments.runs):
                print(text, flush=True)
            continue
        sections = BENCHMARKS[name](inputs, arguments.runs)
        for section in [sections] if isinstance(sections, Section) else sections:
            print(section.text())
            write(section, Path(__file__).with_name("RESULTS.md"))


if __name__ == "__main__":
    main()
