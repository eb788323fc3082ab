"""Proofs in answers: what they tell of a certificate, and in which formats they come."""

from typing import Any

import geodesic_core as gc
from app.encoding import NPZ, Representation
from app.queries.validation import invalid_fields


def check_proof_format(media_type: str, representation: Representation) -> None:
    """Refuse a proof that is rounded."""
    if media_type == NPZ and representation.dtype != Representation.dtype:
        raise invalid_fields(["/query/dtype"], "a proof is in float64")


def told(certificate: gc.Certificate, relative_gap: float) -> dict[str, Any]:
    """Return the member that tells what a certificate proves."""
    names = "holds", "worst_face", "worst_violation"
    rest = {name: getattr(certificate, name) for name in names}
    return {"certificate": {"relative_gap": relative_gap, **rest}}
