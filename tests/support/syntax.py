"""Syntax trees of sources."""

import ast
import gc
from pathlib import Path


def syntax_tree(path: Path) -> ast.Module:
    """Parse a source, and collect no garbage meanwhile.

    A finalizer would let another thread run, and CPython 3.11 raises ``SystemError`` where two
    threads parse at once. Formatting a traceback parses as well.
    """
    collecting = gc.isenabled()
    gc.disable()
    try:
        return ast.parse(path.read_text())
    finally:
        if collecting:
            gc.enable()
