# SPDX-License-Identifier: Apache-2.0
"""Movement patterns of recorded postures: principal component analysis, as the paper describes."""

from dataclasses import dataclass

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.body.posture import ANGLES
from skydiver_utc.body.segments import JOINTS

# Singular values below this share of the largest are rounding.
_NEGLIGIBLE = 1e-9


@dataclass(frozen=True, eq=False)
class PrincipalComponents:
    """mean (15, 3) [rad]; directions (r, 15, 3) of unit norm, by falling share of the variance (r,)."""

    mean: Array
    directions: Array
    shares: Array


def principal_components(angles: Array) -> PrincipalComponents:
    """Of postures (n, 45) [rad], all of equal weight: eigenvectors of their covariance, without those of rank zero.

    By singular values of the deviations from the mean, whose squares are the variances.
    """
    mean = angles.mean(axis=0)
    _, sizes, directions = np.linalg.svd(angles - mean, full_matrices=False)
    rounding = np.finfo(float).eps * np.abs(angles).max(initial=0.0) * len(angles)
    rank = int((sizes > max(_NEGLIGIBLE * sizes[0], rounding)).sum())
    shape = (len(JOINTS), len(ANGLES))
    return PrincipalComponents(
        mean=mean.reshape(shape),
        directions=directions[:rank].reshape(rank, *shape),
        shares=sizes[:rank] ** 2 / (sizes**2).sum() if rank else np.empty(0),
    )
