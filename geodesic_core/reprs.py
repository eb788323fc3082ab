"""Tables of facts, as notebooks show meshes and results."""

from collections.abc import Mapping
from html import escape


def as_table(title: str, facts: Mapping[str, object]) -> str:
    """Return facts by name as a table in HTML."""
    rows = "".join(
        f"<tr><th style='text-align:left'>{escape(name)}</th>"
        f"<td style='text-align:left'>{escape(str(fact))}</td></tr>"
        for name, fact in facts.items()
    )
    return f"<table><caption>{escape(title)}</caption>{rows}</table>"
