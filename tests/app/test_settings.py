import os

import pytest
from pydantic import ValidationError

from app.settings import Settings, variable_of


def test_every_setting_is_an_environment_variable(monkeypatch: pytest.MonkeyPatch) -> None:
    given = dict.fromkeys(Settings.model_fields, "7")
    for name, value in given.items():
        monkeypatch.setenv(variable_of(name), value)

    settings = Settings()

    assert {name: str(getattr(settings, name)).removesuffix(".0") for name in given} == given


def test_defaults_are_those_of_the_contract() -> None:
    settings = Settings()

    assert settings.max_upload_bytes == 512 * 2**20
    assert settings.max_faces == 5_000_000
    assert settings.max_json_values == 2_000_000
    assert settings.max_sources == 10_000
    assert settings.queue_size == 64
    assert settings.deadline_s == 120
    assert settings.workers == len(os.sched_getaffinity(0))


def test_unknown_variable_stops_the_start(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEODESIC_WORKER", "2")

    with pytest.raises(ValidationError, match=r"unknown setting GEODESIC_WORKER; there are"):
        Settings()


@pytest.mark.parametrize("value", ["0", "-1", "many"])
def test_senseless_value_stops_the_start(monkeypatch: pytest.MonkeyPatch, value: str) -> None:
    monkeypatch.setenv("GEODESIC_WORKERS", value)

    with pytest.raises(ValidationError, match="workers"):
        Settings()
