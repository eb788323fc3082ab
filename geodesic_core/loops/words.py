"""Words: how paths run on a surface, up to homotopy, as letters of its fundamental group.

A letter is a number above 0, and its inverse the negative number. On a surface with a boundary two
words are of one kind if they are the same once letters beside their inverses are left out. Without
a boundary the *relator* counts as empty as well. On a torus only the number of each letter matters.
Where the genus is higher, a word is of the empty kind if Dehn's algorithm shortens it to nothing:
it replaces more than half of the relator by the inverse of the rest. Pieces that a relator of a
surface shares with itself or its inverse are single letters, which is why that suffices (Lyndon and
Schupp, *Combinatorial Group Theory*, V.4).
"""

from collections import Counter
from collections.abc import Hashable

Word = tuple[int, ...]

_TORUS = 4
"""Letters of a torus's relator"""


def inverse(word: Word) -> Word:
    """Return the word of the same way back."""
    return tuple(-letter for letter in reversed(word))


def reduced(word: Word, *, cyclic: bool = False) -> Word:
    """Return a word without letters beside their inverses; also around its ends, if cyclic."""
    kept: list[int] = []
    for letter in word:
        if kept and kept[-1] == -letter:
            kept.pop()
        else:
            kept.append(letter)
    while cyclic and len(kept) > 1 and kept[0] == -kept[-1]:
        kept = kept[1:-1]
    return tuple(kept)


class Kinds:
    """The kinds of words that have come up on a surface, numbered; the empty one is 0."""

    def __init__(self, relator: Word) -> None:
        self.words: list[Word] = []
        self._relator = relator
        self._by_key: dict[Hashable, list[int]] = {}
        self.number(())

    def number(self, word: Word, *, add: bool = True) -> int:
        """Return the number of a word's kind, which may be a new one; -1 if it is not to be."""
        word = reduced(word)
        same = self._by_key.setdefault(self._key(word), [])
        for i in same:
            if len(self._relator) <= _TORUS or not self._shortened(word + inverse(self.words[i])):
                return i
        if not add:
            return -1
        same.append(len(self.words))
        self.words.append(word)
        return same[-1]

    def _key(self, word: Word) -> Hashable:
        """Return what all words of a kind have in common; without a boundary, how often letters."""
        if not self._relator:
            return word
        counts = Counter(map(abs, word))
        counts.subtract({letter: 2 * n for letter, n in Counter(-x for x in word if x < 0).items()})
        return frozenset((letter, n) for letter, n in counts.items() if n)

    def _shortened(self, word: Word) -> Word:
        """Return a word that Dehn's algorithm shortens no more: empty if it is of the empty kind.

        It ends, as each step makes the word shorter.
        """
        word, size, i = reduced(word), len(self._relator), 0
        while i < len(word):
            for turned in (self._relator, inverse(self._relator)):
                start = turned.index(word[i])
                cycle = turned[start:] + turned[:start]
                same = 0
                while same < min(size, len(word) - i) and word[i + same] == cycle[same]:
                    same += 1
                if 2 * same > size:
                    word = reduced(word[:i] + inverse(cycle[same:]) + word[i + same :])
                    i = -1
                    break
            i += 1
        return word
