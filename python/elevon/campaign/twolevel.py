"""Classical two-level designs: full and fractional factorials, Plackett-Burman; their aliases.

A word is a set of factors written as bits: bit i is factor i. The product of two words is their
exclusive or, since the square of a column of +1 and -1 is all ones.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from elevon.errors import InputError

Coded = npt.NDArray[np.float64]
_MOST_FACTORS, _MOST_TRIED = 20, 20_000


def letters(count: int) -> list[str]:
    """Return the usual names of factors: A, B, ... without I, which is the identity."""
    return list("ABCDEFGHJKLMNOPQRSTUVWXYZ")[:count]


@dataclass(frozen=True)
class Fraction:
    """A regular fraction of a two-level factorial design.

    Attributes
    ----------
    names : list of str
        The factors' letters.
    generators : list of (int, int, int)
        Factor, its word of other factors (bits), and sign.
    """

    names: list[str]
    generators: list[tuple[int, int, int]] = field(default_factory=list)

    @property
    def words(self) -> dict[int, int]:
        """Defining relation: word to sign, without the identity."""
        group = {0: 1}
        for factor, word, sign in self.generators:
            product = word | (1 << factor)
            group |= {old ^ product: s * sign for old, s in group.items()}
        return {word: sign for word, sign in group.items() if word}

    @property
    def resolution(self) -> int | None:
        """Length of the shortest word; None for a full design."""
        return min((word.bit_count() for word in self.words), default=None)

    @property
    def runs(self) -> int:
        """Number of points."""
        return 1 << (len(self.names) - len(self.generators))

    def coded(self) -> Coded:
        """Return the design, shape (runs, factors), of -1 and +1, first factor fastest."""
        base = [k for k in range(len(self.names)) if k not in {g[0] for g in self.generators}]
        design = np.empty((self.runs, len(self.names)))
        number = np.arange(self.runs)
        for place, factor in enumerate(base):
            design[:, factor] = 2.0 * ((number >> place) & 1) - 1.0
        for factor, word, sign in self.generators:
            design[:, factor] = sign * product(design, word)
        return design

    def aliases(self, order: int = 2) -> dict[str, list[str]]:
        """Return what each effect of up to `order` factors is aliased with, up to that order.

        A minus sign means that the other effect enters negatively.
        """
        table = {}
        for size in range(1, order + 1):
            for chosen in itertools.combinations(range(len(self.names)), size):
                product = sum(1 << k for k in chosen)
                others = [
                    ("-" if sign < 0 else "") + spelled(product ^ word, self.names)
                    for word, sign in self.words.items()
                    if 0 < (product ^ word).bit_count() <= order
                ]
                if others:
                    table[spelled(product, self.names)] = others
        return table


def full(names: Sequence[str]) -> Fraction:
    """Return a full two-level factorial design."""
    return Fraction(list(names))


def fraction(
    names: Sequence[str], place: str, generators: Iterable[str] = (), runs: int | None = None
) -> Fraction:
    """Return a fractional factorial design, by generators or by its number of runs.

    Parameters
    ----------
    names : sequence of str
        The factors' letters.
    place : str
        Named in errors.
    generators : iterable of str
        Such as ``E=ABCD`` or ``E=-ABC``.
    runs : int, optional
        A power of two, without generators: those of highest resolution and then fewest short
        words (minimum aberration) are searched for.

    Raises
    ------
    InputError
        A generator that cannot be, a number of runs that is no power of two or cannot hold the
        factors apart from each other; the place is named.
    """
    if len(names) > _MOST_FACTORS:
        raise InputError(f"{place}: {len(names)} factors are more than {_MOST_FACTORS}")
    written = list(generators)
    if bool(written) == (runs is not None):
        raise InputError(f"{place}: give either 'generators' or 'runs'")
    if runs is not None:
        return _search_generators(list(names), runs, place)
    read = [_read_generator(text, list(names), place) for text in written]
    made = {factor for factor, _, _ in read}
    for text, (_, word, _) in zip(written, read, strict=True):
        if any(word >> factor & 1 for factor in made):
            raise InputError(f"{place}: generator {text!r} is written with a generated factor")
    if len(made) != len(read):
        raise InputError(f"{place}: a factor is generated twice: {', '.join(written)}")
    design = Fraction(list(names), read)
    if (design.resolution or 3) < 3:
        short = next(w for w in design.words if w.bit_count() < 3)
        raise InputError(
            f"{place}: the generators make {spelled(short, names)} the same column "
            "(resolution below III)"
        )
    return design


def spelled(word: int, names: Sequence[str]) -> str:
    """Return a word in letters; names of several letters are joined by colons."""
    chosen = [name for k, name in enumerate(names) if word >> k & 1]
    return ("" if all(len(name) == 1 for name in names) else ":").join(chosen) or "I"


def product(design: Coded, word: int) -> Coded:
    """Return the product of the columns of a word, shape (runs,)."""
    columns = [k for k in range(design.shape[1]) if word >> k & 1]
    result: Coded = design[:, columns].prod(axis=1)
    return result


def plackett_burman_runs(factors: int, place: str) -> int:
    """Return the smallest number of runs of a Plackett-Burman design for so many factors."""
    for runs in range(4, 4 * _MOST_FACTORS, 4):
        if runs > factors and _constructible(runs):
            return runs
    raise InputError(f"{place}: {factors} factors are more than {_MOST_FACTORS}")


def plackett_burman(factors: int, runs: int, place: str) -> Coded:
    """Return a Plackett-Burman design, shape (runs, factors), of -1 and +1.

    Columns of a Hadamard matrix: doubling (Sylvester) where `runs` is a power of two, quadratic
    residues (Paley) where `runs` - 1 is a prime; the designs of 1946 up to order and sign.

    Raises
    ------
    InputError
        No such design; the nearest numbers of runs are named.
    """
    if runs <= factors or not _constructible(runs):
        near = [n for n in range(4, 64, 4) if n > factors and _constructible(n)][:4]
        raise InputError(
            f"{place}: there is no Plackett-Burman design of {runs} runs for {factors} factors; "
            f"runs: {', '.join(map(str, near))}, ..."
        )
    matrix = _sylvester_matrix(runs) if runs & (runs - 1) == 0 else _paley_matrix(runs)
    return matrix[:, 1 : factors + 1].copy()


def block_words(design: Fraction, count: int, place: str, words: Iterable[str] = ()) -> list[int]:
    """Return the words whose signs decide the block, for a power of two of blocks.

    Without `words` those are searched for that are confounded with interactions of the most
    factors.

    Raises
    ------
    InputError
        `count` is no power of two, or a word is confounded with a factor.
    """
    bits = count.bit_length() - 1
    if count != 1 << bits or count >= design.runs:
        raise InputError(
            f"{place}: {count} blocks of {design.runs} points: give a power of two below "
            f"{design.runs}, or as many replicates"
        )
    given = [_read_word(text, design.names, place) for text in words]
    if given and len(given) != bits:
        raise InputError(f"{place}: {count} blocks need {bits} block_generators, not {len(given)}")
    if given:
        chosen = given
    else:
        known = sorted(
            range(1, 1 << len(design.names)), key=lambda w: (-_lowest_effect_order(w, design), w)
        )
        known = list(dict.fromkeys(min(w ^ d for d in (0, *design.words)) for w in known))[:40]
        sets = itertools.islice(itertools.combinations(known, bits), _MOST_TRIED)
        chosen = list(
            max(sets, key=lambda s: min(_lowest_effect_order(w, design) for w in _products(s)))
        )
    worst = min(_lowest_effect_order(word, design) for word in _products(chosen))
    if worst < 2:
        raise InputError(f"{place}: the blocks would be confounded with a factor")
    return chosen


def blocks_of(design: Coded, words: Sequence[int]) -> npt.NDArray[np.int64]:
    """Return the block of each point."""
    number = np.zeros(len(design), dtype=np.int64)
    for place, word in enumerate(words):
        number += (product(design, word) > 0.0).astype(np.int64) << place
    return number


def _products(words: Iterable[int]) -> list[int]:
    """Return all products of words; the identity alone where they are not independent."""
    group, count = {0}, 0
    for word in words:
        group |= {old ^ word for old in group}
        count += 1
    return [word for word in group if word] if len(group) == 1 << count else [0]


def _lowest_effect_order(word: int, design: Fraction) -> int:
    """Return the order of the lowest effect that a word is aliased with."""
    return min((word ^ other).bit_count() for other in (0, *design.words))


def _read_generator(text: str, names: list[str], place: str) -> tuple[int, int, int]:
    left, equals, right = text.replace(" ", "").partition("=")
    sign = -1 if right.startswith("-") else 1
    right = right.lstrip("+-")
    if not equals or left not in names:
        raise InputError(
            f"{place}: generator {text!r} is not of the form E=ABCD; factors: {', '.join(names)}"
        )
    word = _read_word(right, names, place)
    if word >> names.index(left) & 1:
        raise InputError(f"{place}: generator {text!r} has its own factor on both sides")
    return names.index(left), word, sign


def _read_word(text: str, names: Sequence[str], place: str) -> int:
    parts = text.split(":") if ":" in text or not all(len(n) == 1 for n in names) else list(text)
    for part in parts:
        if part not in names:
            raise InputError(f"{place}: {part!r} in {text!r} is no factor; {', '.join(names)}")
    if len(set(parts)) != len(parts) or not parts:
        raise InputError(f"{place}: {text!r} is no word of different factors")
    return sum(1 << names.index(part) for part in parts)


def _search_generators(names: list[str], runs: int, place: str) -> Fraction:
    """Find generators of the highest resolution, then of the fewest words of each length."""
    base = runs.bit_length() - 1
    extra = len(names) - base
    if runs != 1 << base or base < 2 or extra < 1 or len(names) > runs - 1:
        raise InputError(
            f"{place}: {runs} runs of {len(names)} factors: give a power of two above the number "
            f"of factors and below {1 << len(names)}"
        )
    words = sorted(
        (w for w in range(1, 1 << base) if w.bit_count() > 1),
        key=lambda w: (-w.bit_count(), w),
    )
    while len(words) > extra and math.comb(len(words), extra) > _MOST_TRIED:
        words.pop()
    best = min(itertools.combinations(words, extra), key=lambda chosen: _word_lengths(chosen, base))
    generators = [(base + k, word, 1) for k, word in enumerate(sorted(best))]
    return Fraction(names, generators)


def _word_lengths(chosen: Sequence[int], base: int) -> tuple[int, ...]:
    """Return how many words of each length a choice of generators has, short ones first."""
    group = [0]
    for place, word in enumerate(chosen):
        product = word | 1 << (base + place)
        group += [old ^ product for old in group]
    counts = [0] * (base + len(chosen) + 1)
    for word in group[1:]:
        counts[word.bit_count()] += 1
    return tuple(counts)


def _constructible(runs: int) -> bool:
    if runs % 4:
        return False
    prime = runs - 1 > 2 and all((runs - 1) % k for k in range(2, math.isqrt(runs - 1) + 1))
    return runs & (runs - 1) == 0 or prime


def _sylvester_matrix(runs: int) -> Coded:
    matrix = np.ones((1, 1))
    while len(matrix) < runs:
        matrix = np.block([[matrix, matrix], [matrix, -matrix]])
    return matrix


def _paley_matrix(runs: int) -> Coded:
    """Return the Hadamard matrix of quadratic residues modulo the prime runs - 1 (3 modulo 4)."""
    prime = runs - 1
    residues = {k * k % prime for k in range(1, prime)}
    sign = np.array([0.0] + [1.0 if k in residues else -1.0 for k in range(1, prime)])
    jacobsthal = sign[(np.arange(prime)[None, :] - np.arange(prime)[:, None]) % prime]
    skew = np.zeros((runs, runs))
    skew[0, 1:], skew[1:, 0], skew[1:, 1:] = 1.0, -1.0, jacobsthal
    matrix = skew + np.eye(runs)
    # The first column becomes all ones: it is the mean.
    return matrix * matrix[:, :1]
