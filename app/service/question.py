"""A question: a query together with all that decides how it is answered."""

from dataclasses import dataclass
from typing import Any

from app.encoding import Representation
from app.queries import MeshSize, Query


@dataclass(frozen=True)
class Question:
    """A query to a mesh, and the representation of its answer."""

    query: Query[Any]
    size: MeshSize
    """The size of the mesh"""
    representation: Representation
    client: str
    """The name of the caller, whose work the engine counts together"""
