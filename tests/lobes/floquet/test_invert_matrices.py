"""Inverses of many matrices at once are those of LAPACK, one by one."""

from __future__ import annotations

import numpy as np
import pytest

from lobes.floquet.piece_response import invert_matrices

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("size", [1, 8, 16])
@pytest.mark.parametrize("shape", [(), (1,), (40, 3)])
def test_they_are_those_of_lapack(size: int, shape: tuple[int, ...]) -> None:
    matrices = np.eye(size) + 0.3 / size * np.random.default_rng(size).normal(size=(*shape, size, size))
    last = np.moveaxis(matrices, (-2, -1), (0, 1))
    before = last.copy()
    inverse = np.moveaxis(invert_matrices(last), (0, 1), (-2, -1))
    assert inverse == pytest.approx(np.linalg.inv(matrices), rel=1e-12, abs=1e-12)
    assert np.array_equal(last, before)


def test_they_do_not_depend_on_how_many_there_are() -> None:
    matrices = np.eye(16)[..., np.newaxis] + 0.1 * np.random.default_rng(1).normal(size=(16, 16, 50))
    matrices = matrices.astype(np.float32)
    assert invert_matrices(matrices).dtype == np.float32
    assert np.array_equal(invert_matrices(matrices)[..., 7], invert_matrices(matrices[..., 7]))


def test_a_singular_one_is_not_finite() -> None:
    assert not np.all(np.isfinite(invert_matrices(np.zeros((8, 8, 2)))))
