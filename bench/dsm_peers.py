"""Competitors of bench_dsm.py: finite beam elements with scipy, and ROSS."""

from __future__ import annotations

import contextlib
import importlib
import os
import sys
from collections.abc import Iterator
from types import ModuleType

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.optimize import brentq
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import eigsh

from dsm import Spindle

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]
BRACKET = (1e8, 1e10)
"""Bearing stiffnesses (N/m) between which the root is looked for."""


class FiniteElements:
    """Hermite beam elements with consistent mass, `parts` a segment, on bearings of one stiffness k (N/m)."""

    def __init__(self, spindle: Spindle, parts: int = 1) -> None:
        ends = np.cumsum([0.0, *(s.length / parts for s in spindle.segments for _ in range(parts))])
        self.stiffness, self.mass = np.zeros((2, 2 * ends.size, 2 * ends.size))
        for node, segment in enumerate(s for s in spindle.segments for _ in range(parts)):
            dofs = slice(2 * node, 2 * node + 4)
            length = segment.length / parts
            bending = spindle.youngs_modulus * segment.second_moment / length**3
            inertia = spindle.density * segment.area * length / 420
            scale = np.outer(lever := np.array([1, length, 1, length]), lever)
            self.stiffness[dofs, dofs] += bending * scale * STIFFNESS
            self.mass[dofs, dofs] += inertia * scale * MASS
        self.bearings = [2 * int(np.argmin(np.abs(ends - bearing.position))) for bearing in spindle.bearings]

    def supported(self, k: float) -> Float:
        """Stiffness matrix on its bearings."""
        matrix = self.stiffness.copy()
        matrix[self.bearings, self.bearings] += k
        return matrix

    def frequencies(self, k: float, count: int) -> Float:
        """The lowest natural frequencies (Hz)."""
        values = eigh(self.supported(k), self.mass, eigvals_only=True, subset_by_index=[0, count - 1])
        return np.asarray(np.sqrt(values) / (2 * np.pi))

    def calibrate(self, frequency: float) -> float:
        """Stiffness k that gives the first natural frequency (Hz), by a root search."""
        return float(brentq(lambda k: self.frequencies(k, 1)[0] - frequency, *BRACKET, rtol=1e-8))

    def calibrate_sparse(self, frequency: float) -> float:
        """Calibrate with sparse matrices and a shift-invert search near the wanted eigenvalue."""
        mass, springs = csc_matrix(self.mass), np.zeros(self.mass.shape[0])
        springs[self.bearings] = 1.0
        free, ground = csc_matrix(self.stiffness), csc_matrix(np.diag(springs))
        wanted = (2 * np.pi * frequency) ** 2

        def excess(k: float) -> float:
            value = eigsh(free + k * ground, 1, mass, sigma=0.0, return_eigenvectors=False)[0]
            return float(value - wanted)

        return float(brentq(excess, *BRACKET, rtol=1e-8))

    def calibrate_by_eigenproblem(self, frequency: float) -> float:
        """Calibrate without a root search: -1/k is an eigenvalue of the free shaft's compliance at the bearings."""
        forces = np.eye(self.mass.shape[0])[:, self.bearings]
        dynamic = self.stiffness - (2 * np.pi * frequency) ** 2 * self.mass
        values = np.linalg.eigvalsh(np.linalg.solve(dynamic, forces)[self.bearings])
        return float(np.max(-1 / values))

    def tip_receptance(self, k: float, frequency: Float, loss_factor: float) -> Complex:
        """Deflection over force at the tip (m/N), with structural damping."""
        w2 = ((2 * np.pi * frequency) ** 2)[:, np.newaxis, np.newaxis]
        force = np.eye(self.mass.shape[0])[:, :1]
        response = np.linalg.solve((1 + 1j * loss_factor) * self.supported(k) - w2 * self.mass, force)
        return np.asarray(response[:, 0, 0])


STIFFNESS = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]])
"""Stiffness matrix of a Hermite element with EI = L = 1; dofs are deflection and slope of both ends."""
MASS = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]])
"""Mass matrix of the Hermite element times 420."""


def refine(spindle: Spindle, frequency: float, exact: float, within: float) -> tuple[FiniteElements, int]:
    """The coarsest elements that calibrate k within a relative error; with their number a segment."""
    parts = 1
    while abs(FiniteElements(spindle, parts).calibrate_by_eigenproblem(frequency) / exact - 1) > within:
        parts += 1
    return FiniteElements(spindle, parts), parts


def import_ross() -> ModuleType | None:
    """ROSS, the open rotordynamic package; None where it is not installed."""
    with _silence():
        try:
            return importlib.import_module("ross")
        except ImportError:
            return None


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """No output, not of libraries written in C either."""
    sys.stdout.flush()
    kept = [os.dup(1), os.dup(2)]
    with open(os.devnull, "wb") as nowhere:  # noqa: PTH123
        try:
            os.dup2(nowhere.fileno(), 1)
            os.dup2(nowhere.fileno(), 2)
            yield
        finally:
            for target, saved in enumerate(kept, 1):
                os.dup2(saved, target)
                os.close(saved)


class RossRotor:
    """The spindle in ROSS: one element a segment, six degrees of freedom a node."""

    def __init__(self, ross: ModuleType, spindle: Spindle) -> None:
        shear = spindle.theory == "timoshenko"
        material = ross.Material(
            "shaft", rho=spindle.density, E=spindle.youngs_modulus, G_s=spindle.material.shear_modulus
        )
        shaft = [
            ross.ShaftElement(
                L=s.length,
                idl=s.bore_diameter,
                odl=s.outer_diameter,
                material=material,
                shear_effects=shear,
                rotary_inertia=shear,
                gyroscopic=shear,
            )
            for s in spindle.segments
        ]
        ends = np.cumsum([0.0, *(s.length for s in spindle.segments)])
        bearings = [
            ross.BearingElement(n=int(np.argmin(np.abs(ends - b.position))), kxx=b.stiffness, cxx=0.0, kzz=1e9)
            for b in spindle.bearings
        ]
        self.rotor = ross.Rotor(shaft, bearing_elements=bearings)
        self.runs = 0

    def frequencies(self) -> Float:
        """Natural frequencies (Hz) of bending, stretching and twisting, by its dense solver, the faster one here."""
        self.runs += (
            1  # another speed (rad/s), as good as zero: the result of the same one would be remembered, as below
        )
        found = self.rotor.run_modal(1e-9 * self.runs, num_modes=48, sparse=False).wn
        return np.asarray(np.sort(found) / (2 * np.pi))

    def tip_receptance(self, frequency: Float) -> Complex:
        """Undamped deflection over force at the tip (m/N); ROSS works out that between all degrees of freedom."""
        self.runs += 1
        response = self.rotor.run_freq_response(speed_range=2 * np.pi * frequency * (1 + 1e-12 * self.runs))
        return np.asarray(response.freq_resp[0, 0])
