"""Principal directions of the modes of a tool, and their lowest zero-order lobes.

Direct taps show of a mode its residues Rx and Ry; of its cross residue they leave the sign open, and whether two peaks
at one frequency, one in x and one in y, are one mode (+-sqrt(Rx Ry)) or the two of a round spindle (0).
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lobes import Cut, StabilityLobes, lower_envelope, project_modes, zero_order_lobes
from lobewatch.arrays import Flags, Floats
from lobewatch.tool.hidden_residues import CLAMPING_FREQUENCY_TOLERANCE
from modal import Mode

TipModes = Sequence[Mode] | None
"""Modes of one direction at the tool tip; None if no direction is known."""
MAX_PAIR_FREQUENCY_DISTANCE = 0.05
"""Relative distance up to which frequencies in x and y may be of one mode."""
MAX_SIBLING_FREQUENCY_DISTANCE = 0.2
"""Relative distance of two modes that may be a pair with perpendicular directions."""
MAX_SIBLING_STIFFNESS_RATIO = 3.0
"""Largest ratio of the stiffnesses of such a pair."""
HIDDEN_PEAK_RATIO = 0.03
"""Share of the tallest peak that a fit overlooks in another direction; chosen from fits of synthetic FRFs. It
grows with the square of the damping ratio over the distance of the frequencies, once these are nearer than
that."""
MAX_TWO_MODE_SHARE = 0.5
"""Share of a peak that a mode of the other direction may have in it, up to which they are two modes; chosen."""
MAX_OPEN_SIGNS = 3
"""Largest number of unknown signs whose combinations are all computed; the others are positive."""


class ModePair(NamedTuple):
    """Mode of x with the mode of y that belongs to it."""

    x: int
    """Index of the mode of x."""
    y: int
    """Index of the mode of y, after those of x."""
    correlation: float
    """Cross residue over sqrt(Rx Ry): 1 or -1 for one mode in a rotated direction, 0 for two modes."""
    sign: int
    """Index of the unknown sign of that residue; -1 without one."""
    max_rotation: float
    """Largest rotation of both in the plane (rad)."""


@dataclass(frozen=True, eq=False)
class PrincipalDirections:
    """Principal directions of n modes, those of x before those of y, with their uncertainty."""

    stiffness: Floats
    """Measured stiffness (N/m), shape (n,)."""
    is_y: Flags
    """True for each mode measured in y, shape (n,)."""
    pairs: tuple[ModePair, ...]
    """Modes of x with those of y that belong to them."""
    max_cross_share: Floats
    """Largest share of a mode without partner in the other direction, shape (n,)."""

    @property
    def sign_count(self) -> int:
        """Number of unknown signs."""
        return 1 + max((pair.sign for pair in self.pairs), default=-1)

    @property
    def are_uncertain(self) -> bool:
        """True if the directions are uncertain."""
        return bool(np.any(self.max_cross_share)) or any(pair.max_rotation or pair.sign >= 0 for pair in self.pairs)

    @property
    def sign_patterns(self) -> list[Floats | None]:
        """Mode vectors (n, 2) for each combination of unknown signs; None if all are along x and y."""
        if not any(pair.correlation for pair in self.pairs):
            return [None]
        open_ones = min(self.sign_count, MAX_OPEN_SIGNS)
        signs = np.ones((2**open_ones, self.sign_count))
        signs[:, :open_ones] = list(itertools.product((1.0, -1.0), repeat=open_ones))
        nothing = np.zeros((len(signs), self.stiffness.size))
        return list(self._vectors(signs, nothing[:, : len(self.pairs)], nothing))

    @property
    def possible_vectors(self) -> list[Floats]:
        """Mode vectors (n, 2) for each combination of unknown signs, and along x and y if a sign is unknown."""
        along = np.eye(2)[self.is_y.astype(int)]
        patterns = [along if vectors is None else vectors for vectors in self.sign_patterns]
        return [*patterns, along] if self.sign_count else patterns

    def sample(self, count: int, seed: int) -> Floats:
        """Return random mode vectors within the uncertainty, shape (count, n, 2), reproducible by the seed."""
        random = np.random.default_rng((seed, 2))
        signs = random.choice([-1.0, 0.0, 1.0], (count, self.sign_count))
        turn = random.uniform(-1, 1, (count, len(self.pairs))) * [pair.max_rotation for pair in self.pairs]
        lean = random.uniform(-1, 1, (count, self.max_cross_share.size)) * self.max_cross_share
        return self._vectors(signs, turn, lean)

    def _vectors(self, signs: Floats, turn: Floats, lean: Floats) -> Floats:
        """Return vectors (c, n, 2) for signs (c, signs), rotations (c, pairs) in rad and cross shares (c, n)."""
        own = np.eye(2)[self.is_y.astype(int)]
        vectors = own + lean[..., np.newaxis] * own[:, ::-1]
        for k, pair in enumerate(self.pairs):
            correlation = pair.correlation * (signs[:, pair.sign] if pair.sign >= 0 else np.ones(len(turn)))
            both = _pair_vectors(self.stiffness[pair.x], self.stiffness[pair.y], correlation, turn[:, k])
            vectors[:, pair.x], vectors[:, pair.y] = both[..., 0], both[..., 1]
        return np.asarray(vectors)


def _pair_vectors(stiff_x: float, stiff_y: float, correlation: Floats, turn: Floats) -> Floats:
    """Return the vectors (c, 2, 2) of two modes, in columns, with residues Rx and Ry and a correlation.

    They are the rotated root of the residue matrix: a rotation does not change what the taps at one frequency measure.
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
    x: Sequence[Mode], y: Sequence[Mode], cross: TipModes = None, hidden: Floats | None = None
) -> PrincipalDirections:
    """Find the principal directions of the modes measured in x and in y.

    cross: signed modes hit in x and measured in y. hidden: largest residue (m/N) of each mode in the FRF of the other
    direction (`find_hidden_residues`), None if unknown. Peaks of x and y are matched in the order of their frequencies.
    With a neighbouring pair of similar stiffness, each match that the FRFs do not tell apart is one mode in a rotated
    direction, perpendicular to the other. Any other match is the two modes of a round spindle, rotated as far as the
    taps would not show it. A cross FRF decides.
    """
    modes = [*x, *y]
    stiffness = np.array([mode.stiffness for mode in modes])
    across = np.arange(len(modes)) >= len(x)
    matched = [(i, len(x) + j) for i, j in _match_modes(x, y)]
    lean = np.zeros(len(modes))
    if cross is not None:
        pairs = [ModePair(*pair, _cross_correlation(pair, modes, matched, cross), -1, 0.0) for pair in matched]
    else:
        limits = np.full(len(modes), np.inf) if hidden is None else hidden
        pairs = _pair_without_cross_tap(modes, matched, limits)
        for i in np.setdiff1d(np.arange(len(modes)), np.ravel(matched)).astype(int):
            residue = min(HIDDEN_PEAK_RATIO / np.min(stiffness[across != across[i]]), limits[i])
            lean[i] = min(np.sqrt(residue * stiffness[i]), 1.0)
    return PrincipalDirections(stiffness, across, tuple(pairs), lean)


def _match_modes(x: Sequence[Mode], y: Sequence[Mode]) -> list[tuple[int, int]]:
    """Match modes of x and y with the smallest total distance and without crossing."""
    order_x, order_y = (np.argsort([mode.frequency for mode in modes]) for modes in (x, y))
    at_x, at_y = (np.log([mode.frequency for mode in modes]) for modes in (x, y))
    distance = np.abs(at_x[order_x, np.newaxis] - at_y[order_y])
    gain = np.zeros((len(x) + 1, len(y) + 1))
    for i, j in np.ndindex(len(x), len(y)):
        paired = gain[i, j] + max(MAX_PAIR_FREQUENCY_DISTANCE - distance[i, j], 0.0)
        gain[i + 1, j + 1] = max(gain[i, j + 1], gain[i + 1, j], paired)
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


def _pair_without_cross_tap(
    modes: Sequence[Mode], matched: Sequence[tuple[int, int]], hidden: Floats
) -> list[ModePair]:
    """Return the pairs that direct taps imply; hidden: largest residues in the other direction (m/N), shape (n,)."""
    pairs, sign = list[ModePair](), itertools.count()
    number, direction = -1, 1.0
    for k, (i, j) in enumerate(matched):
        share = min(hidden[i] * modes[j].stiffness, hidden[j] * modes[i].stiffness)
        has_sibling = any(_are_siblings(modes, (i, j), other) for other in _other_modes(len(modes), matched, (i, j)))
        if not has_sibling or share < MAX_TWO_MODE_SHARE:
            turn = float(np.arcsin(np.sqrt(min(share, 1.0))))
            pairs.append(ModePair(i, j, 0.0, -1, min(_max_rotation(modes[i], modes[j]), turn)))
            continue
        follows = k > 0 and pairs[-1].sign == number and direction > 0 and _are_siblings(modes, (i, j), matched[k - 1])
        number, direction = (number, -1.0) if follows else (next(sign), 1.0)
        pairs.append(ModePair(i, j, direction, number, 0.0))
    return pairs


def _other_modes(count: int, matched: Sequence[tuple[int, int]], own: tuple[int, int]) -> Iterator[tuple[int, ...]]:
    """Yield all other modes, matched pairs and single ones."""
    yield from (pair for pair in matched if pair != own)
    with_partner = {number for pair in matched for number in pair}
    yield from ((number,) for number in range(count) if number not in with_partner)


def _are_siblings(modes: Sequence[Mode], first: tuple[int, ...], second: tuple[int, ...]) -> bool:
    """Tell whether two modes may be a pair with perpendicular directions."""
    frequency = [np.mean([modes[i].frequency for i in numbers]) for numbers in (first, second)]
    stiffness = [1 / sum(1 / modes[i].stiffness for i in numbers) for numbers in (first, second)]
    is_near = max(frequency) < (1 + MAX_SIBLING_FREQUENCY_DISTANCE) * min(frequency)
    return bool(is_near and max(stiffness) < MAX_SIBLING_STIFFNESS_RATIO * min(stiffness))


def _max_rotation(x: Mode, y: Mode) -> float:
    """Return the largest rotation of two modes that the other tap would not show (rad)."""
    apart = max(abs(np.log(x.frequency / y.frequency)) - CLAMPING_FREQUENCY_TOLERANCE, 1e-9)
    share = HIDDEN_PEAK_RATIO * max(1.0, (np.sqrt(x.damping_ratio * y.damping_ratio) / apart) ** 2)
    return float(np.arctan(np.sqrt(share))) if share < 1 else np.pi / 2


def _cross_correlation(
    own: tuple[int, int], modes: Sequence[Mode], matched: Sequence[tuple[int, int]], cross: Sequence[Mode]
) -> float:
    """Return the cross residue of a pair over sqrt(Rx Ry), from the nearest cross modes."""
    middle = {pair: np.mean([np.log(modes[i].frequency) for i in pair]) for pair in matched}
    total = 0.0
    for mode in cross:
        at = np.log(mode.frequency)
        nearest = min(matched, key=lambda pair: abs(middle[pair] - at))
        total += 1 / mode.stiffness if nearest == own and abs(middle[own] - at) < MAX_PAIR_FREQUENCY_DISTANCE else 0.0
    return float(np.clip(total * np.sqrt(modes[own[0]].stiffness * modes[own[1]].stiffness), -1, 1))


def lowest_zero_order_lobes(
    x: TipModes, y: TipModes, cuts: Sequence[Cut], speed_rpm: ArrayLike, cross: TipModes = None
) -> StabilityLobes:
    """Return the lowest limits of a cut over feed directions and possible principal directions."""
    tips: list[tuple[TipModes, TipModes, TipModes]] = [(x, y, None)]
    if x and y:
        patterns = find_principal_directions(x, y, cross).sign_patterns
        tips = [(x, y, None) if axes is None else project_modes([*x, *y], axes) for axes in patterns]
    return lower_envelope([zero_order_lobes(x, y, cut, speed_rpm, across) for x, y, across in tips for cut in cuts])
