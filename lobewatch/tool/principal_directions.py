"""Principal directions of the modes of a tool, and their lowest zero-order lobes.

Direct taps show of a mode its residues Rx and Ry; of its cross residue they leave the sign open, and whether two peaks
at one frequency, one in x and one in y, are one mode (+-sqrt(Rx Ry)) or the two of a round spindle (0).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobes import Cut, StabilityLobes, lower_envelope, project_modes, zero_order_lobes
from modal import Mode

MAX_PAIR_FREQUENCY_DISTANCE = 0.05
"""Relative distance of two frequencies in x and y up to which they may be those of one mode."""
MAX_SIBLING_FREQUENCY_DISTANCE = 0.2
"""Relative distance of two modes that may be a pair with axes square to each other ..."""
MAX_SIBLING_STIFFNESS_RATIO = 3.0
"""... and largest ratio of their stiffnesses."""
HIDDEN_PEAK_RATIO = 0.03
"""Share of the tallest peak that a fit overlooks in another direction; chosen, from fits of synthetic FRFs. It grows
with the square of the damping ratio over the distance of the frequencies, once these are nearer than that."""
CLAMPING_FREQUENCY_TOLERANCE = 0.003
"""Relative distance of two frequencies that counts for nothing."""
MAX_OPEN_SIGNS = 3
"""Open signs of which all combinations are looked at; the others are positive."""

Floats = NDArray[np.float64]


class ModePair(NamedTuple):
    """A mode tapped in x with the one tapped in y that belongs to it."""

    x: int
    """Number of the mode of x."""
    y: int
    """Number of the mode of y, after those of x."""
    correlation: float
    """Cross residue over sqrt(Rx Ry): 1 or -1 where both are one mode that lies askew, 0 where they are two."""
    sign: int
    """Number of the open sign of that residue; -1 where it is known, or there is none."""
    max_rotation: float
    """Angle up to which both may be turned in the plane (rad)."""


@dataclass(frozen=True, eq=False)
class PrincipalDirections:
    """Axes of n modes, those tapped in x before those tapped in y, and what is open of them."""

    stiffness: Floats
    """Stiffness of each as tapped (N/m), shape (n,)."""
    is_y: NDArray[np.bool_]
    """Whether each was tapped in y, shape (n,)."""
    pairs: tuple[ModePair, ...]
    """Modes of x with those of y that belong to them."""
    max_cross_share: Floats
    """Largest part in the other direction that a mode without partner may have, over its own, shape (n,)."""

    @property
    def sign_count(self) -> int:
        """Number of open signs."""
        return 1 + max((pair.sign for pair in self.pairs), default=-1)

    @property
    def are_uncertain(self) -> bool:
        """Whether anything is open of them."""
        return bool(np.any(self.max_cross_share)) or any(pair.max_rotation or pair.sign >= 0 for pair in self.pairs)

    @property
    def sign_patterns(self) -> list[Floats | None]:
        """Vectors (n, 2) of the modes for each combination of open signs; None where all lie along x and y."""
        if not any(pair.correlation for pair in self.pairs):
            return [None]
        open_ones = min(self.sign_count, MAX_OPEN_SIGNS)
        signs = np.ones((2**open_ones, self.sign_count))
        signs[:, :open_ones] = list(itertools.product((1.0, -1.0), repeat=open_ones))
        nothing = np.zeros((len(signs), self.stiffness.size))
        return list(self._vectors(signs, nothing[:, : len(self.pairs)], nothing))

    def sample(self, count: int, seed: int) -> Floats:
        """Vectors within what is open, shape (count, n, 2); the same for a seed."""
        random = np.random.default_rng((seed, 2))
        signs = random.choice([-1.0, 1.0], (count, self.sign_count))
        turn = random.uniform(-1, 1, (count, len(self.pairs))) * [pair.max_rotation for pair in self.pairs]
        return self._vectors(
            signs, turn, random.uniform(-1, 1, (count, self.max_cross_share.size)) * self.max_cross_share
        )

    def _vectors(self, signs: Floats, turn: Floats, lean: Floats) -> Floats:
        """Vectors (c, n, 2) for signs (c, signs), turns (c, pairs) in rad and leans (c, n)."""
        own = np.eye(2)[self.is_y.astype(int)]
        vectors = own + lean[..., np.newaxis] * own[:, ::-1]
        for k, pair in enumerate(self.pairs):
            correlation = pair.correlation * (signs[:, pair.sign] if pair.sign >= 0 else np.ones(len(turn)))
            both = _pair_vectors(self.stiffness[pair.x], self.stiffness[pair.y], correlation, turn[:, k])
            vectors[:, pair.x], vectors[:, pair.y] = both[..., 0], both[..., 1]
        return np.asarray(vectors)


def _pair_vectors(stiff_x: float, stiff_y: float, correlation: Floats, turn: Floats) -> Floats:
    """Vectors (c, 2, 2) of two modes, in columns, that show Rx and Ry directly, and their correlation across.

    The root of the matrix of residues, turned: what the taps at one frequency show does not change with the turn.
    """
    residues = np.array([1 / stiff_x, 1 / stiff_y])
    cross = correlation * np.sqrt(residues[0] * residues[1])
    matrix = np.zeros((correlation.size, 2, 2))
    matrix[:, 0, 0], matrix[:, 1, 1], matrix[:, 0, 1], matrix[:, 1, 0] = *residues, cross, cross
    least = np.sqrt(np.maximum(residues[0] * residues[1] - cross**2, 0.0))[:, np.newaxis, np.newaxis]
    root = (matrix + least * np.eye(2)) / np.sqrt(np.sum(residues) + 2 * least)
    c, s = np.cos(turn), np.sin(turn)
    turned = root @ np.stack((np.stack((c, -s), axis=-1), np.stack((s, c), axis=-1)), axis=-2)
    return np.asarray(turned * np.sqrt([stiff_x, stiff_y]))


def find_principal_directions(
    x: Sequence[Mode], y: Sequence[Mode], cross: Sequence[Mode] | None = None
) -> PrincipalDirections:
    """Axes of the modes tapped in x and in y; cross: those hit in x and seen in y, signed; None where not tapped.

    Peaks of x and y belong together in the order of their frequencies. Where another such pair of like stiffness is
    near, each is one mode that lies askew, the two square to each other; alone it is the two of a round spindle, which
    may be turned as far as the taps would not have shown it. A cross tap says which.
    """
    modes = [*x, *y]
    stiffness = np.array([mode.stiffness for mode in modes])
    across = np.arange(len(modes)) >= len(x)
    matched = [(i, len(x) + j) for i, j in _match_modes(x, y)]
    if cross is None:
        pairs = _pair_without_cross_tap(modes, matched)
    else:
        pairs = [
            ModePair(i, j, _cross_correlation(modes[i], modes[j], (i, j), modes, matched, cross), -1, 0.0)
            for i, j in matched
        ]
    alone = np.setdiff1d(np.arange(len(modes)), np.ravel(matched))
    lean = np.zeros(len(modes))
    if cross is None:
        for i in alone.astype(int):
            lean[i] = min(np.sqrt(HIDDEN_PEAK_RATIO * stiffness[i] / np.min(stiffness[across != across[i]])), 1.0)
    return PrincipalDirections(stiffness, across, tuple(pairs), lean)


def _match_modes(x: Sequence[Mode], y: Sequence[Mode]) -> list[tuple[int, int]]:
    """Modes of x and y, each in the order of its frequencies, that belong together: nearest in all, none crossing."""
    order_x, order_y = (np.argsort([mode.frequency for mode in modes]) for modes in (x, y))
    at_x, at_y = (np.log([mode.frequency for mode in modes]) for modes in (x, y))
    distance = np.abs(at_x[order_x, np.newaxis] - at_y[order_y])
    gain = np.zeros((len(x) + 1, len(y) + 1))
    for i, j in np.ndindex(len(x), len(y)):
        gain[i + 1, j + 1] = max(
            gain[i, j + 1], gain[i + 1, j], gain[i, j] + max(MAX_PAIR_FREQUENCY_DISTANCE - distance[i, j], 0.0)
        )
    i, j, matched = len(x), len(y), list[tuple[int, int]]()
    while i and j:
        if gain[i, j] == gain[i - 1, j]:
            i -= 1
        elif gain[i, j] == gain[i, j - 1]:
            j -= 1
        else:
            i, j = i - 1, j - 1
            matched.append((int(order_x[i]), int(order_y[j])))
    return matched[::-1]


def _pair_without_cross_tap(modes: Sequence[Mode], matched: Sequence[tuple[int, int]]) -> list[ModePair]:
    """What direct taps alone say of modes that belong together."""
    pairs, sign = list[ModePair](), itertools.count()
    number, direction = -1, 1.0
    for k, (i, j) in enumerate(matched):
        if not any(_are_siblings(modes, (i, j), other) for other in _other_modes(modes, matched, (i, j))):
            pairs.append(ModePair(i, j, 0.0, -1, _max_rotation(modes[i], modes[j])))
            continue
        follows = k > 0 and pairs[-1].sign == number and direction > 0 and _are_siblings(modes, (i, j), matched[k - 1])
        number, direction = (number, -1.0) if follows else (next(sign), 1.0)
        pairs.append(ModePair(i, j, direction, number, 0.0))
    return pairs


def _other_modes(
    modes: Sequence[Mode], matched: Sequence[tuple[int, int]], own: tuple[int, int]
) -> Iterator[tuple[int, ...]]:
    """All other modes: those that belong together, and those without partner."""
    yield from (pair for pair in matched if pair != own)
    with_partner = {number for pair in matched for number in pair}
    yield from ((number,) for number in range(len(modes)) if number not in with_partner)


def _are_siblings(modes: Sequence[Mode], first: tuple[int, ...], second: tuple[int, ...]) -> bool:
    """Whether two may be one pair of modes with axes square to each other."""
    frequency = [np.mean([modes[i].frequency for i in numbers]) for numbers in (first, second)]
    stiffness = [1 / sum(1 / modes[i].stiffness for i in numbers) for numbers in (first, second)]
    return bool(
        max(frequency) < (1 + MAX_SIBLING_FREQUENCY_DISTANCE) * min(frequency)
        and max(stiffness) < MAX_SIBLING_STIFFNESS_RATIO * min(stiffness)
    )


def _max_rotation(x: Mode, y: Mode) -> float:
    """Angle up to which two modes may be turned before the other tap would show it (rad)."""
    apart = max(abs(np.log(x.frequency / y.frequency)) - CLAMPING_FREQUENCY_TOLERANCE, 1e-9)
    share = HIDDEN_PEAK_RATIO * max(1.0, (np.sqrt(x.damping_ratio * y.damping_ratio) / apart) ** 2)
    return float(np.arctan(np.sqrt(share))) if share < 1 else np.pi / 2


def _cross_correlation(
    x: Mode,
    y: Mode,
    own: tuple[int, int],
    modes: Sequence[Mode],
    matched: Sequence[tuple[int, int]],
    cross: Sequence[Mode],
) -> float:
    """Cross residue of two modes that belong together over sqrt(Rx Ry), by the cross modes nearest to them."""
    middle = {pair: np.mean([np.log(modes[i].frequency) for i in pair]) for pair in matched}
    total = 0.0
    for mode in cross:
        at = np.log(mode.frequency)
        nearest = min(matched, key=lambda pair: abs(middle[pair] - at))
        total += 1 / mode.stiffness if nearest == own and abs(middle[own] - at) < MAX_PAIR_FREQUENCY_DISTANCE else 0.0
    return float(np.clip(total * np.sqrt(x.stiffness * y.stiffness), -1, 1))


TipModes = Sequence[Mode] | None
"""Modes of one direction at the tool tip; None where neither direction is known."""


def lowest_zero_order_lobes(
    x: TipModes, y: TipModes, cuts: Sequence[Cut], speed_rpm: ArrayLike, cross: TipModes = None
) -> StabilityLobes:
    """The lowest limits of a cut in its directions of feed, and over the axes that taps in x, in y and across leave."""
    tips: list[tuple[TipModes, TipModes, TipModes]] = [(x, y, None)]
    if x and y:
        patterns = find_principal_directions(x, y, cross).sign_patterns
        tips = [(x, y, None) if axes is None else project_modes([*x, *y], axes) for axes in patterns]
    return lower_envelope([zero_order_lobes(x, y, cut, speed_rpm, across) for x, y, across in tips for cut in cuts])
