"""A call of a host, and the hosts that this process can call."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from app.engine.work import Task, TaskResult
from app.errors import Problem

HOSTS: dict[str, Any] = {}
"""The hosts that this process knows, by name, as Ray's ``RunningReplica``"""


@dataclass
class Call:
    """A task on its way to a host."""

    task: Task
    log_fields: Mapping[str, Any]
    """Fields of log lines, such as the id of the request"""
    order: Sequence[str]
    """Names of hosts; it goes to the first that is there"""
    host: str
    """The name of that one"""


Message = float | TaskResult | Problem | None
"""From a host: the share of the work that is done, None before it begins, and at last its end"""
