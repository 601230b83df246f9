"""The factor of a block tridiagonal matrix answers as numpy does for the whole matrix."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import csr_array

from hypermap.values.block_tridiagonal import BlockCholesky


@given(st.integers(1, 4), st.integers(1, 17), st.integers(0, 2**32 - 1))
def test_answers_are_those_of_the_whole_matrix(size, count, seed):
    random = np.random.default_rng(seed)
    block = np.arange(count) // size
    near = np.abs(block[:, np.newaxis] - block) <= 1
    half = np.where(near, random.normal(size=(count, count)), 0)
    matrix = half + half.T
    matrix += np.diag(np.abs(matrix).sum(axis=1) + 1)  # diagonally dominant: positive definite
    right = random.normal(size=(count, 2))

    factor = BlockCholesky.of(csr_array(matrix), size)

    np.testing.assert_allclose(factor.solve(right), np.linalg.solve(matrix, right), atol=1e-10)
    np.testing.assert_allclose(
        factor.inverse_diagonal(), np.diagonal(np.linalg.inv(matrix)), atol=1e-10
    )
    np.testing.assert_allclose(factor.log_determinant(), np.linalg.slogdet(matrix)[1], atol=1e-10)
