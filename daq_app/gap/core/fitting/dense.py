"""Cholesky factors of small positive definite matrices, straight from LAPACK: they are asked for thousands of
times, and the checks around them would cost more than they do."""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotrs, dtrtri

from daq_app.gap.core.features import FloatArray


def factor(matrix: FloatArray) -> FloatArray:
    """Lower Cholesky factor, (p, p). Raises `numpy.linalg.LinAlgError` for a matrix not positive definite."""
    if not matrix.size:
        return matrix.copy()
    factored, info = dpotrf(matrix, lower=1, clean=1)
    if info:
        raise np.linalg.LinAlgError("the matrix is not positive definite")
    lower: FloatArray = factored
    return lower


def solve(lower: FloatArray, right: FloatArray) -> FloatArray:
    """A⁻¹ B for B of shape (p,) or (p, m), with the Cholesky factor (p, p) of A."""
    if not lower.size:
        return right.copy()
    solution: FloatArray = dpotrs(lower, right, lower=1)[0]
    return solution


def inverse_factor(lower: FloatArray) -> FloatArray:
    """The inverse, (p, p), of a lower triangular matrix."""
    if not lower.size:
        return lower.copy()
    inverse: FloatArray = dtrtri(lower, lower=1)[0]
    return inverse
