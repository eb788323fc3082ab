"""Mutations of bytes, of texts with numbers, and of JSON documents, by a seeded generator."""

import json
import re
import struct
from collections.abc import Callable, Iterator, Sequence
from random import Random
from typing import Any

Mutation = Callable[[Random, bytes], bytes]

INTEGERS = (0, 1, 2, 2**15, 2**31 - 1, 2**31, 2**32 - 1, 2**53, 2**63 - 1, 2**63, 2**64)
NUMBERS = (
    *(sign + str(number) for number in INTEGERS for sign in ("", "-")),
    *("1e308", "-1e308", "1e309", "1e-320", "1.5", "-0.0", "1e5000", "+1", ".5", "5."),
    *("9" * 5000, "0" * 5000 + "1", "0." + "0" * 5000 + "1", "-" + "9" * 25),
    *("nan", "inf", "-inf", "0x10", "1_0", "1,5", "1e", "--1", "", "x", "é", "\u0663"),
)
"""Numbers at and beyond what readers have room for, and what is none"""

WORDS = (
    b"\0",
    b"\n",
    b"\r",
    b" ",
    b"\\",
    b"#",
    b"/",
    b'"',
    b"\xff\xfe",
    b"\xed\xa0\x80",
    b"{",
    b"]",
)


# Bytes


def flip_bit(random: Random, data: bytes) -> bytes:
    at = random.randrange(len(data))
    return data[:at] + bytes([data[at] ^ 1 << random.randrange(8)]) + data[at + 1 :]


def truncate(random: Random, data: bytes) -> bytes:
    return data[: random.randrange(len(data))]


def insert(random: Random, data: bytes) -> bytes:
    at = random.randint(0, len(data))
    added = (
        random.choice(WORDS) if random.random() < 0.7 else random.randbytes(random.randint(1, 9))
    )
    return data[:at] + added * random.choice((1, 1, 2, 1000)) + data[at:]


def remove(random: Random, data: bytes) -> bytes:
    begin, end = _range(random, data)
    return data[:begin] + data[end:]


def repeat(random: Random, data: bytes) -> bytes:
    begin, end = _range(random, data)
    return data[:end] + data[begin:end] * random.choice((1, 1, 3)) + data[end:]


def swap(random: Random, data: bytes) -> bytes:
    a, b, c, d = sorted(random.randint(0, len(data)) for _ in range(4))
    return data[:a] + data[c:d] + data[b:c] + data[a:b] + data[d:]


def overwrite_integer(random: Random, data: bytes) -> bytes:
    """Write an extreme integer of four bytes, where one may stand."""
    at = random.randrange(0, max(1, len(data) - 3), random.choice((1, 4)))
    number = random.choice(INTEGERS) * random.choice((1, -1)) + random.choice((0, 0, 1, -1))
    return data[:at] + struct.pack(random.choice("<>") + "I", number % 2**32) + data[at + 4 :]


def overwrite_float(random: Random, data: bytes) -> bytes:
    at = random.randrange(0, max(1, len(data) - 3), random.choice((1, 4)))
    number = random.choice((float("nan"), float("inf"), -3e38, 1e-45, 1e30))
    return data[:at] + struct.pack(random.choice("<>") + "f", number) + data[at + 4 :]


def _range(random: Random, data: bytes) -> tuple[int, int]:
    begin = random.randrange(len(data))
    return begin, min(len(data), begin + random.choice((1, 4, 12, 50, len(data))))


# Texts

_NUMBER = re.compile(rb"[-+.\deE]*\d[-+.\deE]*")


def replace_number(random: Random, data: bytes) -> bytes:
    return _replace(random, data, list(_NUMBER.finditer(data)))


def replace_early_number(random: Random, data: bytes) -> bytes:
    """Replace a number of what may be a header."""
    return _replace(random, data, list(_NUMBER.finditer(data, 0, 400))[:8])


def _replace(random: Random, data: bytes, found: list[re.Match[bytes]]) -> bytes:
    if not found:
        return data
    place = random.choice(found)
    return data[: place.start()] + random.choice(NUMBERS).encode() + data[place.end() :]


def move_lines(random: Random, data: bytes) -> bytes:
    """Remove, repeat or exchange lines."""
    lines = data.splitlines(keepends=True)
    i, j = (random.randrange(len(lines)) for _ in range(2))
    match random.randrange(3):
        case 0:
            del lines[i]
        case 1:
            lines.insert(j, lines[i])
        case _:
            lines[i], lines[j] = lines[j], lines[i]
    return b"".join(lines)


def replace_word(random: Random, data: bytes) -> bytes:
    """Put a word of the file into another's place."""
    words = list(re.finditer(rb"[^\s,:]+", data))
    if not words:
        return data
    place, other = random.choice(words), random.choice(words)
    return data[: place.start()] + other[0] + data[place.end() :]


IN_PLACE: tuple[Mutation, ...] = (flip_bit, overwrite_integer, overwrite_float)
"""Those that keep all lengths"""
BYTES: tuple[Mutation, ...] = (*IN_PLACE, truncate, insert, remove, repeat, swap)
TEXT: tuple[Mutation, ...] = (
    *(replace_number, replace_number, replace_early_number, replace_early_number),
    *(move_lines, replace_word, flip_bit, truncate, insert, remove, repeat, swap),
)


def mutated(random: Random, data: bytes, mutations: Sequence[Mutation]) -> bytes:
    """Return the bytes after one to three mutations."""
    for _ in range(random.choice((1, 1, 1, 2, 3))):
        data = random.choice(mutations)(random, data) or data[:1]
    return data


# JSON

DEPTHS = (3, 200, 300, 20_000)
VALUES = (
    *(number for number in NUMBERS if re.fullmatch(r"-?(0|[1-9]\d*)(\.\d+)?(e\d+)?", number)),
    *("null", "true", "false", '""', '"x"', '"1"', '"1.5"', "[]", "{}", "[[]]", "[1, 2]"),
    *("NaN", "Infinity", "-Infinity", '"\\ud800"', '"\\u0000"', '"é"', "01", "+1", "'x'", "nul"),
    *('"' + "x" * 5000 + '"', "[" + "1, " * 5000 + "1]", "[" + "[], " * 500 + "[]]"),
    *("[" * depth + "]" * depth for depth in DEPTHS),
    *('{"a": ' * depth + "1" + "}" * depth for depth in DEPTHS),
    *("[" * 500, "{" + ", ".join(f'"{i}": 1' for i in range(300)) + "}"),
)
"""Texts of JSON values, also of some that are none"""

_PLACE = "~place {}~"
Tree = Any
Spot = tuple[Any, Any]
"""A container, and a key or an index of it"""


def mutated_json(random: Random, tree: Tree) -> bytes:
    """Return the text of a JSON document after one to three mutations of its tree."""
    whole = {"": json.loads(json.dumps(tree))}
    texts: list[str] = []
    for _ in range(random.choice((1, 1, 1, 2, 3))):
        _mutate(random, whole, texts)
    document = json.dumps(whole[""], ensure_ascii=random.random() < 0.5)
    for number, text in enumerate(texts):
        document = document.replace(json.dumps(_PLACE.format(number)), text)
    if random.random() < 0.1:
        document = re.sub(r'("\w+": )', r"\g<1>1, \g<1>", document, count=1)  # a member twice
    return document.encode("utf-8", "surrogatepass")


def _mutate(random: Random, whole: Tree, texts: list[str]) -> None:
    spots = list(_spots(whole))
    container, key = random.choice(spots)
    other, other_key = random.choice(spots)
    match random.randrange(10):
        case 0 | 1 | 2 | 3 | 4:
            container[key] = _PLACE.format(len(texts))
            texts.append(random.choice(VALUES))
        case 5 if container is not whole:
            del container[key]
        case 6 if isinstance(container, list):
            is_small = len(json.dumps(container[key])) < 100
            container[key:key] = [container[key]] * random.choice((1, 2, 500 if is_small else 3))
        case 7 if isinstance(container, dict) and container is not whole:
            container[random.choice((f"{key}s", "", "vertex", "\u0000", "x" * 300))] = container[
                key
            ]
        case 8:  # a copy, since a tree has no circles
            container[key] = json.loads(json.dumps(other[other_key]))
        case _:
            container[key] = random.choice(([container[key]], {"a": container[key]}))


def _spots(node: Tree) -> Iterator[Spot]:
    items: list[Any] = []
    if isinstance(node, dict):
        items = list(node)
    elif isinstance(node, list):
        items = list(range(len(node)))
    for key in items:
        yield node, key
        yield from _spots(node[key])
