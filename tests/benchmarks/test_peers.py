"""The report on peers, whose errors are those against our exact distances."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.inputs import Inputs
from benchmarks.peers import report
from benchmarks.peers.trial import Trial
from geodesic_core.arrays import Floats


def test_no_other_method_stands_in_for_exact_distances(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def try_out(method: report.Method, vertices: Floats, *_: object) -> Trial:
        if method.name == "exact":
            return Trial(None, np.nan, np.nan, np.nan, "none after 120 s")
        return Trial(np.ones(len(vertices)), 1.0, 1.0, 1.0, "")

    monkeypatch.setattr(report, "try_out", try_out)
    monkeypatch.setattr(report, "MESHES", ("icosphere 0",))
    monkeypatch.setattr(report, "RESULTS", tmp_path)
    monkeypatch.setattr(report, "write_report", lambda *_: "")
    with pytest.raises(RuntimeError, match="no exact distances on icosphere 0: none after 120 s"):
        report.run(Inputs(tmp_path), {})
