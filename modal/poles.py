"""Least-squares complex frequency domain (LSCF) poles and their stabilisation chart."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from modal.arrays import Complexes, Flags, Floats, Integers


@dataclass(frozen=True, eq=False)
class OrthogonalBasis:
    """Polynomials p_0 .. p_n of x that are orthonormal with a weight over the lines, by the Arnoldi process.

    x p_k(x) = sum of recurrence[j, k] p_j(x) over j <= k + 1. No power of x is ever formed, so that order 60 is as
    exact as order 2. Source: Brubeck, Nakatsukasa & Trefethen (2021), Vandermonde with Arnoldi, SIAM Review 63, 405.
    """

    values: Complexes
    """Weight times p_k on each line, shape (lines, n + 1)."""
    recurrence: Complexes
    """Recurrence coefficients, shape (n + 1, n)."""

    def roots(self, coefficients: Complexes) -> Complexes:
        """Return the zeros of sum of coefficients[k] p_k, k = 0 .. m, by the comrade matrix, shape (m,)."""
        m = coefficients.size - 1
        comrade = self.recurrence[:m, :m].copy()
        comrade[:, -1] -= self.recurrence[m, m - 1] * coefficients[:m] / coefficients[m]
        return np.asarray(np.linalg.eigvals(comrade))


def orthogonal_basis(x: Floats, weight: Complexes, order: int) -> OrthogonalBasis:
    """Build the basis up to this order at x, shape (lines,), with these weights, shape (lines,)."""
    rows = np.empty((order + 1, x.size), dtype=np.complex128)
    recurrence = np.zeros((order + 1, order), dtype=np.complex128)
    rows[0] = weight / np.linalg.norm(weight)
    for k in range(order):
        new = x * rows[k]
        for _ in range(2):
            part = (rows[: k + 1] @ new.conj()).conj()
            new -= part @ rows[: k + 1]
            recurrence[: k + 1, k] += part
        recurrence[k + 1, k] = np.linalg.norm(new)
        rows[k + 1] = new / recurrence[k + 1, k]
    return OrthogonalBasis(rows.T, recurrence)


_OrderPoles = tuple[Complexes, Complexes]

EXTRA_POLYNOMIAL_DEGREE = 2
"""Degree of the polynomial for all poles outside the band, negative frequencies included."""
MAX_LSCF_LINES = 600
"""Most lines that poles are computed from; longer axes are thinned."""
LSCF_RIDGE = 1e-12
"""Ridge added to the unit diagonal of the normal equations for the residues, for coinciding poles."""
POLE_TOLERANCE = 0.25
"""Largest distance of a stable pole from one of the order below (half-power half-widths)."""
FLEXIBILITY_TOLERANCE = 0.35
"""Largest relative change of the modal flexibility of a stable pole."""


@dataclass(frozen=True, eq=False)
class StabilisationChart:
    """Poles of all model orders that decay and are inside the band, lower orders first."""

    order: Integers
    """Order of the model: its number of poles, shape (k,)."""
    frequency: Floats
    """Undamped natural frequency (Hz), shape (k,)."""
    damping_ratio: Floats
    """Damping ratio (-), shape (k,)."""
    flexibility: Complexes
    """Modal flexibility 1/K, complex (m/N), in each of p FRFs, shape (k, p)."""
    previous: Integers
    """Index of the same pole at the order below, -1 if there is none (the pole is not stable), shape (k,)."""

    @property
    def stable(self) -> Flags:
        """True for each pole that the order below has, too, shape (k,)."""
        return self.previous >= 0


def fit_lscf_poles(frequency: Floats, receptance: Complexes, weight: Floats, orders: int) -> StabilisationChart:
    """Fit poles of the models of order 1 .. orders by LSCF: H = B/A with complex polynomials of the frequency.

    The weighted error w (A H - B) is linear in the coefficients. B, whose degree is two higher than that of A, is
    eliminated first; the rest gives A of every order from one matrix. Several FRFs share their poles. Both bases are
    orthonormal over the lines, which may be spaced unevenly and begin anywhere.

    Parameters
    ----------
    frequency : ndarray, shape (n,)
        Frequencies (Hz).
    receptance : ndarray, shape (p, n)
        Receptances of p FRFs (m/N).
    weight : ndarray, shape (p, n)
        Weights of the lines.
    orders : int
        Highest order.

    Returns
    -------
    StabilisationChart
        Poles of all orders.

    References
    ----------
    Peeters et al. (2004), The PolyMAX frequency-domain method, Shock and Vibration 11, 395; Richardson &
    Formenti (1982), Parameter estimation from FRF measurements using rational fraction polynomials, IMAC 1.

    Examples
    --------
    >>> line = np.linspace(400.0, 600.0, 201)  # Hz
    >>> receptance = Mode(500.0, 0.02, 2e7).receptance(line)[np.newaxis]  # m/N, (1, 201)
    >>> chart = fit_lscf_poles(line, receptance, np.ones((1, 201)), orders=1)
    >>> chart.order.tolist(), chart.frequency.round(2).tolist(), chart.damping_ratio.round(4).tolist()  # -, Hz, -
    ([1], [500.0], [0.02])
    """
    orders = min(orders, (2 * frequency.size - 2 * EXTRA_POLYNOMIAL_DEGREE) // 6)
    thinned = slice(None, None, -(-frequency.size // MAX_LSCF_LINES))
    model = _LscfModel(frequency[thinned], receptance[:, thinned], weight[:, thinned])
    return _build_chart(list(_poles_by_order(model, orders)), receptance.shape[0])


@dataclass(frozen=True, eq=False)
class _LscfModel:
    frequency: Floats
    receptance: Complexes
    weight: Floats


def _poles_by_order(model: _LscfModel, orders: int) -> Iterator[_OrderPoles]:
    """Yield the poles inside the band (complex frequencies, Hz) and their flexibilities (k, p), order by order."""
    p, n = model.receptance.shape
    if orders < 1:
        return
    lowest, highest = float(model.frequency[0]), float(model.frequency[-1])
    middle, half = (lowest + highest) / 2, (highest - lowest) / 2
    x = (model.frequency - middle) / half
    below = orthogonal_basis(np.tile(x, p), (model.weight * model.receptance).ravel(), orders)
    shared = model.weight[:1] if np.all(model.weight == model.weight[0]) else model.weight
    above = [orthogonal_basis(x, w.astype(complex), orders + EXTRA_POLYNOMIAL_DEGREE) for w in shared]
    overlap = [
        b.values.conj().T @ part
        for b, part in zip(above * (p // len(above)), below.values.reshape(p, n, orders + 1), strict=True)
    ]
    for order in range(1, orders + 1):
        parts = (full[: order + EXTRA_POLYNOMIAL_DEGREE + 1, : order + 1] for full in overlap)
        left = np.eye(order + 1) - sum(part.conj().T @ part for part in parts)
        poles = below.roots(np.linalg.eigh(left)[1][:, 0]) * half + middle
        poles = poles[(poles.imag > 0) & (np.abs(poles) > lowest) & (np.abs(poles) < highest)]
        yield poles, _flexibilities(model, above, poles)


def _flexibilities(model: _LscfModel, above: list[OrthogonalBasis], poles: Complexes) -> Complexes:
    """Return the complex 1/K of every pole by linear least squares, shape (k, p)."""
    fractions = 1 / (model.frequency[:, None] - poles)
    values = model.weight * model.receptance
    residues = np.empty((poles.size, len(values)), dtype=np.complex128)
    for i, basis in enumerate(above):  # one for each FRF, or one for all
        alike = slice(i, i + 1) if len(above) > 1 else slice(None)
        columns = np.hstack([model.weight[i][:, None] * fractions, basis.values[:, : EXTRA_POLYNOMIAL_DEGREE + 1]])
        size = np.linalg.norm(columns, axis=0)
        columns /= size
        gram = columns.conj().T @ columns + LSCF_RIDGE * np.eye(columns.shape[1])
        fit = np.linalg.solve(gram, columns.conj().T @ values[alike].T)[: poles.size]
        residues[:, alike] = fit / size[: poles.size, None]
    return np.asarray(residues * (-2 * poles.real / np.abs(poles) ** 2)[:, None])


def _match_lower_order(below: _OrderPoles, here: _OrderPoles) -> Integers:
    """Return for each pole its index among the poles of the order below, -1 if it is not there."""
    if not below[0].size:
        return np.full(here[0].size, -1)
    distance = np.abs(here[0][:, None] - below[0])
    nearest = np.argmin(distance, axis=1)
    change = np.linalg.norm(here[1] - below[1][nearest], axis=1)
    is_near = distance.min(axis=1) < POLE_TOLERANCE * here[0].imag
    is_alike = change < FLEXIBILITY_TOLERANCE * np.linalg.norm(here[1], axis=1)
    return np.where(is_near & is_alike, nearest, -1)


def _build_chart(orders: list[_OrderPoles], p: int) -> StabilisationChart:
    orders = [(np.empty(0, complex), np.empty((0, p), complex)), *orders]  # order 0 has no poles
    sizes = np.array([poles.size for poles, _ in orders], dtype=np.int64)
    previous = [np.empty(0, np.int64)]
    for (below, here), start in zip(pairwise(orders), np.cumsum(sizes) - sizes, strict=False):
        same = _match_lower_order(below, here)
        previous.append(np.where(same < 0, -1, same + start))
    poles, flexibility = (np.concatenate(parts) for parts in zip(*orders, strict=True))
    order, size = np.repeat(np.arange(sizes.size), sizes), np.abs(poles)
    return StabilisationChart(order, size, poles.imag / size, flexibility, np.concatenate(previous))


MIN_STABLE_ORDERS = 4
"""Fewest consecutive orders in which a mode is stable."""


@dataclass(frozen=True, eq=False)
class PhysicalPoles:
    """Poles that stay in place as the order grows, m of them, by rising frequency."""

    frequency: Floats
    """Undamped natural frequencies (Hz), shape (m,)."""
    damping_ratio: Floats
    """Damping ratios (-), shape (m,)."""
    flexibility: Complexes
    """Modal flexibilities 1/K, complex (m/N), in each of p FRFs, shape (m, p)."""
    n_orders: Integers
    """Number of orders in which each pole is stable, shape (m,)."""

    @property
    def largest(self) -> Floats:
        """Size of each flexibility in the FRF with the largest (m/N), shape (m,)."""
        return np.asarray(np.abs(self.flexibility).max(axis=1))


def select_physical_poles(chart: StabilisationChart) -> PhysicalPoles:
    """Select the poles of a stabilisation chart that are stable over at least four orders.

    Poles form chains, each pole the same as one of the order below (by frequency, damping and flexibility).
    Of chains that share a pole the longest counts. A mode is the median of the upper half of its chain.

    Parameters
    ----------
    chart : StabilisationChart
        Poles of all orders.

    Returns
    -------
    PhysicalPoles
        Stable poles.

    Examples
    --------
    >>> line = np.linspace(400.0, 600.0, 201)  # Hz
    >>> noise = np.random.default_rng(1).normal(0.0, 2e-9, (2, 201))  # m/N, a peak has 1.25e-6
    >>> measured = Mode(500.0, 0.02, 2e7).receptance(line) + noise[0] + 1j * noise[1]
    >>> chart = fit_lscf_poles(line, measured[np.newaxis], np.ones((1, 201)), orders=10)
    >>> poles = select_physical_poles(chart)  # of all 55 those that stay in place
    >>> poles.frequency.round(1).tolist(), poles.damping_ratio.round(3).tolist()  # Hz, -
    ([500.0], [0.02])
    """
    taken, rows = np.zeros(chart.order.size, bool), []
    chains: list[list[int]] = []  # the last pole of each comes first
    for i, previous in enumerate(chart.previous.tolist()):
        chains.append([i, *(chains[previous] if previous >= 0 else ())])
    for chain in sorted(chains, key=len, reverse=True):
        if len(chain) > MIN_STABLE_ORDERS and not taken[chain].any():
            rows.append(_median_flexibility(chart, chain))
        taken[chain] = True
    rows.sort(key=lambda row: float(row[0].real))
    table = np.array(rows).reshape(len(rows), 3 + chart.flexibility.shape[1])
    return PhysicalPoles(table[:, 0].real, table[:, 1].real, table[:, 3:], table[:, 2].real.astype(np.int64))


def _median_flexibility(chart: StabilisationChart, chain: list[int]) -> Complexes:
    upper = chain[: (len(chain) + 1) // 2]
    a = chart.flexibility[upper]
    poles = [np.median(chart.frequency[upper]), np.median(chart.damping_ratio[upper]), len(chain) - 1]
    return np.concatenate([poles, np.median(a.real, axis=0) + 1j * np.median(a.imag, axis=0)])
