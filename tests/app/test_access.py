import pickle

import pytest

from app.access import ApiKey, name_of_secret, parse_keys

ALICE, BOB = "alice-0123456789", "bob+/~._-0123456=="


def test_several_keys_and_several_secrets_of_one_name() -> None:
    keys = parse_keys(f"alice:{ALICE}, bob:{BOB},alice:{'n' * 16}")

    assert [key.name for key in keys] == ["alice", "bob", "alice"]
    assert name_of_secret(keys, ALICE.encode()) == "alice"
    assert name_of_secret(keys, BOB.encode()) == "bob"
    assert name_of_secret(keys, b"n" * 16) == "alice"


@pytest.mark.parametrize(
    "secret", [b"", ALICE[:-1].encode(), ALICE.upper().encode(), ALICE.encode() + b"=", b"\xff"]
)
def test_other_secrets_are_nobodys(secret: bytes) -> None:
    assert name_of_secret(parse_keys(f"alice:{ALICE}"), secret) is None


@pytest.mark.parametrize("text", ["", " "])
def test_no_keys(text: str) -> None:
    assert parse_keys(text) == ()


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (ALICE, "key 1 is not name:secret"),
        (f"alice:{ALICE},", "key 2 is not name:secret"),
        (f":{ALICE}", "key 1 is not name:secret"),
        (f"10.0.0.1:{ALICE}", "key 1 is not name:secret"),
        (f"alice:{ALICE}é", "key 1 is not name:secret"),
        (f"alice:{ALICE} x", "key 1 is not name:secret"),
        (f"alice:{ALICE}\nX", "key 1 is not name:secret"),
        (f"{'a' * 65}:{ALICE}", "key 1 is not name:secret"),
        ("alice:0123456789abcde", "the secret of key alice is shorter than 16"),
        (f"alice:{ALICE},bob:{ALICE}", "two keys have the same secret"),
    ],
)
def test_what_is_no_key_is_refused_without_showing_it(text: str, why: str) -> None:
    with pytest.raises(ValueError, match=why) as refusal:
        parse_keys(text)

    assert "0123456789" not in str(refusal.value)


def test_secrets_are_not_kept() -> None:
    keys = parse_keys(f"alice:{ALICE}")

    assert repr(keys) == "(ApiKey(name='alice'),)"
    assert ALICE.encode() not in pickle.dumps(keys)
    assert isinstance(keys[0], ApiKey)
