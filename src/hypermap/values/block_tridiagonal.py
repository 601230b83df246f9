"""Factors of a symmetric positive definite matrix that is made of blocks along its diagonal.

A field on a grid of R rows couples each row with its two neighbors. With two rows in a block, its
precision matrix is block tridiagonal, and all operations take R / 2 small dense steps:
the block Cholesky factorization (Golub and Van Loan, Matrix Computations, 4th ed., section 4.5.1)
and, backwards along it, the blocks of the inverse on the diagonal (Takahashi et al. 1973; Meurant,
SIAM J. Matrix Anal. Appl. 13, 1992).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dpotrs, dtrtrs
from scipy.sparse import csr_array

Matrix = NDArray[np.float64]

_NOTHING = 1e-6


@dataclass(frozen=True, eq=False)
class BlockCholesky:
    """The lower Cholesky factor of a matrix of shape (N, N).

    Attributes:
        size: of the blocks; the last one may be smaller.
        diagonal: lower triangular blocks, each (size, size).
        below: the block under each diagonal one but the last.
    """

    size: int
    diagonal: list[Matrix]
    below: list[Matrix]

    @staticmethod
    def of(matrix: csr_array, size: int) -> BlockCholesky:
        """Return the factor of a matrix whose entries lie within neighboring blocks.

        Raises:
            numpy.linalg.LinAlgError: If the matrix is not positive definite.
        """
        diagonal: list[Matrix] = []
        below: list[Matrix] = []
        for here, coupling in _blocks(matrix, size):
            rest = here - below[-1] @ below[-1].T if below else here
            factor, failed = dpotrf(rest, lower=True)
            if failed:
                raise np.linalg.LinAlgError("the matrix is not positive definite")
            diagonal.append(factor)
            if coupling.size:
                below.append(_forward(factor, coupling).T)
        return BlockCholesky(size, diagonal, below)

    def log_determinant(self) -> float:
        """Return the logarithm of the matrix' determinant."""
        return 2 * float(sum(np.log(np.diagonal(block)).sum() for block in self.diagonal))

    def solve(self, right: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return x of matrix @ x = right, both of shape (N,) or (N, K)."""
        parts = [right[at : at + self.size] for at in range(0, len(right), self.size)]
        for block, factor in enumerate(self.diagonal):
            known = parts[block - 1] if block else None
            rest = parts[block] if known is None else parts[block] - self.below[block - 1] @ known
            parts[block] = _forward(factor, rest)
        for block in reversed(range(len(parts))):
            rest = parts[block]
            if block + 1 < len(parts):
                rest = rest - self.below[block].T @ parts[block + 1]
            parts[block] = _backward(self.diagonal[block], rest)
        return np.concatenate(parts)

    def solve_near(self, right: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return x of matrix @ x = right, (N,) both, for a right that is 0 but at few neighbors.

        Blocks far away, where x is below `_NOTHING` of its largest entry, are left at 0.
        """
        solved = np.zeros_like(right)
        first, last = (np.flatnonzero(right)[[0, -1]] // self.size).tolist()
        count = len(self.diagonal)
        parts: dict[int, NDArray[np.float64]] = {}
        largest = 0.0
        for block in range(first, count):
            rest = right[block * self.size : (block + 1) * self.size]
            if block > first:
                rest = rest - self.below[block - 1] @ parts[block - 1]
            parts[block] = _forward(self.diagonal[block], rest)
            size = float(np.abs(parts[block]).max())
            largest = max(largest, size)
            if block > last and size < _NOTHING * largest:
                break
        after: NDArray[np.float64] | None = None
        largest = 0.0
        for block in reversed(range(max(parts) + 1)):
            rest = parts.get(block, np.zeros(len(self.diagonal[block])))
            if after is not None:
                rest = rest - self.below[block].T @ after
            after = _backward(self.diagonal[block], rest)
            solved[block * self.size : (block + 1) * self.size] = after
            size = float(np.abs(after).max())
            largest = max(largest, size)
            if block < first and size < _NOTHING * largest:
                break
        return solved

    def inverse_diagonal(self) -> NDArray[np.float64]:
        """Return the diagonal of the matrix' inverse, shape (N,)."""
        found: list[NDArray[np.float64]] = []
        after: Matrix | None = None  # the block of the inverse after this one
        for block in reversed(range(len(self.diagonal))):
            factor = self.diagonal[block]
            here = dpotrs(factor, np.eye(len(factor)), lower=True)[0]
            if after is not None:
                gain = _backward(factor, self.below[block].T)
                here += gain @ after @ gain.T
            found.append(np.diagonal(here).copy())
            after = here
        return np.concatenate(found[::-1])


def _blocks(matrix: csr_array, size: int) -> Iterator[tuple[Matrix, Matrix]]:
    """Yield each block on the diagonal, and the one to its right; the last has none there."""
    matrix.sum_duplicates()
    count = matrix.shape[0]
    rows = np.repeat(np.arange(count), np.diff(matrix.indptr))
    for start in range(0, count, size):
        width, both = min(size, count - start), min(2 * size, count - start)
        entries = slice(matrix.indptr[start], matrix.indptr[start + width])
        cols = matrix.indices[entries] - start
        is_there = cols >= 0  # those to the left are the same as to the right of the block before
        dense = np.zeros((width, both))
        dense[rows[entries][is_there] - start, cols[is_there]] = matrix.data[entries][is_there]
        yield dense[:, :width], dense[:, width:]


# LAPACK itself: scipy's functions around it take several times as long with small blocks.


def _forward(factor: Matrix, right: NDArray[np.float64]) -> NDArray[np.float64]:
    solved: NDArray[np.float64] = dtrtrs(factor, right, lower=True)[0]
    return solved


def _backward(factor: Matrix, right: NDArray[np.float64]) -> NDArray[np.float64]:
    solved: NDArray[np.float64] = dtrtrs(factor, right, lower=True, trans=True)[0]
    return solved
