"""Small systems by LAPACK itself: what SciPy checks beside it takes several times as long."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

Floats = NDArray[np.float64]


def forward(root: Floats, right: Floats, transposed: bool = False) -> Floats:
    """Solve for a lower-triangular root, (n, n), or for what it is transposed."""
    solved, status = lapack.dtrtrs(root.T, right, lower=0, trans=not transposed)
    if status != 0:
        raise np.linalg.LinAlgError("a triangular matrix is singular")
    return np.asarray(solved)


def definite(matrix: Floats, right: Floats) -> Floats:
    """Solve for a positive definite matrix, (n, n)."""
    _, solved, status = lapack.dposv(matrix, right, lower=1)
    if status != 0:
        raise np.linalg.LinAlgError("a matrix is not positive definite")
    return np.asarray(solved)
