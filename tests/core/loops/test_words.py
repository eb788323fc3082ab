"""Words that are of one kind, and of different kinds."""

import numpy as np
import pytest

from geodesic_core.loops.words import Kinds, inverse, reduced

TORUS = (1, 2, -1, -2)
DOUBLE = (1, 2, -1, -2, 3, 4, -3, -4)
CROSSED = (1, 2, 3, 4, -1, -2, -3, -4)
TRIPLE = (*DOUBLE, 5, 6, -5, -6)


def random_word(rng, letters, length):
    return tuple((rng.integers(1, letters + 1, length) * rng.choice([-1, 1], length)).tolist())


@pytest.mark.parametrize("relator", [(), TORUS, DOUBLE, CROSSED, TRIPLE])
def test_words_to_which_relators_are_added_are_of_one_kind(relator):
    rng = np.random.default_rng(0)
    for length in range(12):
        kinds, letters = Kinds(relator), max(relator, default=3)
        word = random_word(rng, letters, length)
        number = kinds.number(word)
        for _ in range(5):
            i, way = int(rng.integers(len(word) + 1)), random_word(rng, letters, 3)
            turn = int(rng.integers(len(relator) + 1))
            cycle = relator[turn:] + relator[:turn]
            if rng.integers(2):
                cycle = inverse(cycle)
            word = word[:i] + way + cycle + inverse(way) + word[i:]
            assert kinds.number(word, add=False) == number


@pytest.mark.parametrize("relator", [DOUBLE, CROSSED, TRIPLE])
def test_a_commutator_is_not_empty_unless_the_surface_is_a_torus(relator):
    kinds = Kinds(relator)
    assert kinds.number(TORUS) != 0
    assert kinds.number(TORUS) != kinds.number(inverse(TORUS))
    assert Kinds(TORUS).number(TORUS) == 0
    assert Kinds(()).number(TORUS) != 0


def test_a_neck_is_of_one_kind_seen_from_both_sides():
    kinds = Kinds(DOUBLE)
    assert kinds.number((1, 2, -1, -2)) == kinds.number((4, 3, -4, -3))


def test_powers_are_of_different_kinds():
    for relator in ((), TORUS, DOUBLE):
        kinds = Kinds(relator)
        assert len({kinds.number((1,) * n + (2,) * m) for n in range(4) for m in range(4)}) == 16


def test_reduced():
    assert reduced((1, 2, -2, -1, 3)) == (3,)
    assert reduced((1, 3, 2, -1), cyclic=True) == (3, 2)
