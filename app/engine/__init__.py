"""Where work runs: in processes that can be stopped, killed and replaced.

``Engine`` is what the service sees; ``LocalEngine`` keeps worker processes on this machine.
"""

from app.engine.interface import Engine, Load, Told
from app.engine.local import LocalEngine
from app.engine.work import (
    Answering,
    Done,
    Estimating,
    MeshFromFile,
    MeshFromSample,
    MeshOrigin,
    Order,
    Storing,
    Work,
)

__all__ = [
    "Answering",
    "Done",
    "Engine",
    "Estimating",
    "Load",
    "LocalEngine",
    "MeshFromFile",
    "MeshFromSample",
    "MeshOrigin",
    "Order",
    "Storing",
    "Told",
    "Work",
]
