"""The model held against nodes that run here: it has to predict how many questions, how fast.

It is told when questions come, what those near them take of a worker and beside it, and which host
prefers which mesh. It is not told how long they wait.
"""

import itertools
from collections import defaultdict
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from statistics import median

import numpy as np

from benchmarks.scaling.model import Model, Question
from benchmarks.scaling.nodes import Exchange, Nodes, cluster, one_machine

NODES = 2
"""Of the cluster"""
TURNS, TURN_S = 8, 8.0
LOADS = (0.4, 0.6)
"""Questions a second, as shares of what the nodes answer when they are kept busy"""
CLIENTS = 6
"""Clients that keep them busy"""
NEAR = 10
"""Among so many questions, one after the other, what they take is shuffled"""
RUNS = 8
"""Of the model, for each turn"""


@dataclass
class Seen:
    """A load on some nodes: by turn, what was measured, and what was predicted of all runs."""

    measured: list[Sequence[float]] = field(default_factory=list)
    """Latencies, seconds"""
    predicted: list[Sequence[float]] = field(default_factory=list)
    measured_rates: list[float] = field(default_factory=list)
    """Questions a second"""
    predicted_rates: list[float] = field(default_factory=list)

    @property
    def rates(self) -> tuple[float, float]:
        """Questions a second, the median of the turns: measured, predicted."""
        return median(self.measured_rates), median(self.predicted_rates)

    def percentiles(self, percent: float) -> tuple[float, float]:
        """Seconds that a share of the questions takes at most: measured, predicted.

        Of all turns together: in one turn only four questions in 400 are slower than p99.
        """
        measured, predicted = (
            float(np.percentile(np.concatenate(turns), percent))
            for turns in (self.measured, self.predicted)
        )
        return measured, predicted


@dataclass(frozen=True)
class ReplicaSeconds:
    """Processor seconds of the process of the API."""

    question_s: float
    """For each new question"""
    stored_s: float
    """For each question whose answer it has"""


@dataclass
class Validation:
    """What was seen, by nodes and load, and what the process of the API was busy with."""

    seen: dict[tuple[str, str], Seen] = field(default_factory=lambda: defaultdict(Seen))
    handing: dict[str, float] = field(default_factory=dict)
    """By load: seconds beside the work that a question keeps a worker of one service waiting"""
    replicas: list[ReplicaSeconds] = field(default_factory=list)
    """Of one service, of one with two workers, of a replica of a cluster"""


def validate() -> Validation:
    """Load all nodes by turns, and have the model predict each turn."""
    found = Validation()
    with ExitStack() as stack:
        all_nodes = (one_machine(1), one_machine(2), cluster(NODES))
        some = [stack.enter_context(each) for each in all_nodes]
        preferred = [nodes.preferred_hosts() for nodes in some]
        spent = [defaultdict[str, float](float) for _ in some]
        for turn in range(TURNS):
            for nodes, its_hosts, its in zip(some, preferred, spent, strict=True):
                before = nodes.spent_s()
                its["questions"] += _take_turn(nodes, its_hosts, found, turn)
                its["seconds"] += nodes.spent_s() - before
        for nodes, its in zip(some, spent, strict=True):
            question_s = its["seconds"] / its["questions"]
            found.replicas.append(ReplicaSeconds(question_s, nodes.stored_s()))
    return found


def _take_turn(nodes: Nodes, preferred: Sequence[int], found: Validation, turn: int) -> int:
    busy = _load(
        nodes, preferred, found, "kept busy", turn, lambda: nodes.keep_busy(CLIENTS, TURN_S, turn)
    )
    count, rate = len(busy), len(busy) / TURN_S
    for load in LOADS:
        ask = partial(nodes.load_openly, load * rate, TURN_S, turn)
        count += len(_load(nodes, preferred, found, f"{load:.0%}", turn, ask))
    return count


def _load(
    nodes: Nodes,
    preferred: Sequence[int],
    found: Validation,
    name: str,
    turn: int,
    ask: Callable[[], Sequence[Exchange]],
) -> Sequence[Exchange]:
    """Load nodes; add what was seen to what is found, and what the model predicts."""
    before = nodes.occupied_s()
    exchanges = sorted(ask())
    if nodes.shape.hosts == 1:  # the metrics of a replica count the way to its hosts as well
        worked_s = sum(each.worker_s for each in exchanges)
        handing_s = nodes.occupied_s() - before - worked_s
        found.handing[name] = max(0.0, handing_s / len(exchanges))
    predicted: list[float] = []
    seconds = 0.0
    for run in range(RUNS):
        model = Model(nodes.shape, seed=run)
        meshes = [
            next(itertools.islice(model.meshes_of(host), number, None))
            for number, host in enumerate(preferred)
        ]
        questions = _shuffled(exchanges, meshes, found.handing[name], RUNS * turn + run)
        if name == "kept busy":
            model.keep_busy(CLIENTS, questions)
        else:
            model.answer_all(questions)
        predicted += [each.seconds for each in model.answers]
        seconds += max(each.arrival + each.seconds for each in model.answers)
    seen = found.seen[nodes.name, name]
    seen.measured.append([each.seconds for each in exchanges])
    seen.measured_rates.append(len(exchanges) / max(each.at + each.seconds for each in exchanges))
    seen.predicted.append(predicted)
    seen.predicted_rates.append(len(predicted) / seconds)
    return exchanges


def _shuffled(
    exchanges: Sequence[Exchange], meshes: Sequence[int], handing_s: float, seed: int
) -> Sequence[Question]:
    """Return questions at the same times, which are what those near them were.

    ``meshes`` has their meshes in the model. To be handed a question, and to hand its answer back,
    keeps a worker for ``handing_s`` beside its work.
    """
    moved = np.random.default_rng(seed).uniform(0, NEAR, len(exchanges))
    order = np.argsort(np.arange(len(exchanges)) + moved)
    return [
        Question(
            each.at,
            like.worker_s + min(handing_s, like.outside_s),
            mesh=meshes[like.mesh],
            is_small=True,
            outside_s=max(0.0, like.outside_s - handing_s),
        )
        for each, i in zip(exchanges, order.tolist(), strict=True)
        for like in [exchanges[i]]
    ]
