"""A release names its version in each place, and what has changed since the last one."""

import pytest

from app import __version__
from tests.support.new_version import PLACES, cut, renewed
from tests.support.paths import ROOT


@pytest.mark.parametrize("name", list(PLACES))
def test_the_version_is_renewed_in_each_place(name: str) -> None:
    text = (ROOT / name).read_text()
    new = renewed(text, PLACES[name], __version__, "9.8.7rc6")
    changed = [
        (before, after)
        for before, after in zip(text.splitlines(), new.splitlines(), strict=True)
        if before != after
    ]
    assert len(changed) == len(PLACES[name])
    assert all(after == before.replace(__version__, "9.8.7rc6") for before, after in changed)


def test_a_place_that_is_missing_is_told() -> None:
    with pytest.raises(ValueError, match="is there 0 times"):
        renewed('version = "1.2"', ('^version = "{}"',), "1.0", "1.1")


def test_what_was_unreleased_is_headed_by_the_version() -> None:
    changes = "# Changelog\n\n## [Unreleased]\n\n### Added\n\n- All.\n\n## [0.1.0]\n"
    assert cut(changes, "0.2.0", "2030-01-02") == (
        "# Changelog\n\n## [Unreleased]\n\n## [0.2.0] - 2030-01-02\n\n### Added\n\n- All.\n\n"
        "## [0.1.0]\n"
    )
    with pytest.raises(ValueError, match="no single"):
        cut("# Changelog\n", "0.2.0", "2030-01-02")
    assert cut((ROOT / "CHANGELOG.md").read_text(), "0.2.0", "2030-01-02")
