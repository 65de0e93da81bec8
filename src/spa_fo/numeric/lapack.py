"""Small systems by LAPACK itself: what SciPy checks beside it takes several times as long."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from spa_fo.arrays import Floats

Numbers = NDArray[np.floating[Any]]


def forward(root: Numbers, right: Numbers, transposed: bool = False) -> Floats:
    """Solve for a lower-triangular root, (n, n), or for what it is transposed."""
    if right.size == 0:
        return np.zeros(right.shape)
    solved, status = lapack.dtrtrs(root.T, right, lower=0, trans=not transposed)
    if status != 0:
        raise np.linalg.LinAlgError("a triangular matrix is singular")
    return np.asarray(solved)


def definite(matrix: Numbers, right: Numbers) -> Floats:
    """Solve for a positive definite matrix, (n, n)."""
    _, solved, status = lapack.dposv(matrix, right, lower=1)
    if status != 0:
        raise np.linalg.LinAlgError("a matrix is not positive definite")
    return np.asarray(solved)


def is_definite(matrix: Numbers) -> bool:
    """Say whether a symmetric matrix, (n, n), is positive definite."""
    _, status = lapack.dpotrf(matrix, lower=1)
    return bool(status == 0)
