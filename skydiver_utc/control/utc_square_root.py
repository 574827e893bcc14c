"""The UTC step of control/utc_step.py in square-root form: a factor S of Pu = S S' is kept and moved on.

Apart from the plain form, so that nobody waits for the compilation of what he does not use.
"""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.control.utc_memory import Memory, Rules
from skydiver_utc.control.utc_step import (
    ABOUT_CENTRE,
    FACTORED,
    KEPT_PREVIOUS,
    NONE,
    conclude,
    means,
    place,
)
from skydiver_utc.jit import kernel
from skydiver_utc.unscented.covariance import eigen_symmetric
from skydiver_utc.unscented.sigma_points import weighted_mean
from skydiver_utc.unscented.square_root import lower_triangular, root_of_factor, take_away

Array = NDArray[np.float64]


@kernel
def draw(rules: Rules, x: Memory) -> float:
    """As `utc_step.draw`."""
    repaired = root_of_factor(x.factor, rules.floor, x.root, x.values, x.vectors, x.rows)
    place(rules, x)
    return repaired


@kernel
def move(
    rules: Rules, x: Memory, reference: Array, Qu: Array, drawing_repaired: float
) -> tuple[int, int, int, float]:
    """As `utc_step.move`."""
    lost = means(x)
    recovery, refused = NONE, -1.0
    if lost < x.points.shape[0]:
        recovery, refused = about_mean_or_centre(x, Qu)
    told = conclude(rules, x, reference, refused >= 0.0, recovery, lost, drawing_repaired + max(refused, 0.0))
    if told[0] != KEPT_PREVIOUS:
        first = x.outputs.shape[1]
        for a in range(x.factor.shape[0]):
            for b in range(x.factor.shape[1]):
                x.factor[a, b] = np.sqrt(rules.kept_share) * x.array[first + a, first + b]
    return told


@kernel
def factor_instead(
    rules: Rules, x: Memory, reference: Array, Qu: Array, lost: int, repaired: float
) -> tuple[int, int, int, float]:
    """For the plain form, after a `utc_step.move` that lost the definiteness of C_y to rounding: the same update.

    C_y is not formed but factored from the deviations, whose numbers are only half as far apart.
    """
    weighted_mean(x.saved, x.left, x.next_control)
    weighted_mean(x.outputs, x.output_left, x.next_predicted)
    reading, refused = about_mean_or_centre(x, Qu)
    recovery = FACTORED if reading == NONE else reading
    return conclude(rules, x, reference, refused >= 0.0, recovery, lost, repaired + max(refused, 0.0))


@kernel
def about_mean_or_centre(x: Memory, Qu: Array) -> tuple[int, float]:
    """`covariances` about the mean or, where C_y is then not definite, the centre: which of them, its answer."""
    recovery, refused = NONE, -1.0
    for reading in (NONE, ABOUT_CENTRE):
        recovery = reading
        control = x.next_control if reading == NONE else x.saved[0]
        output = x.next_predicted if reading == NONE else x.outputs[0]
        refused = covariances(x, Qu, control, output)
        if refused >= 0.0:
            break
    return recovery, refused


@kernel
def covariances(x: Memory, Qu: Array, control: Array, predicted: Array) -> float:
    """As `utc_step.covariances`; returns what could not be taken away from Pu, or -1 where C_y is not definite.

    The weighted deviations of outputs and controls beside the roots of P_err and Qu are an array A with
    A A' = (C_y, C_uy'; C_uy, Pu). Its lower triangle is (L, 0; C_uy L^-T, S) where S S' is Pu less K C_y K'.
    What has a negative sign, the central point if W0 < 0 and negative eigenvalues of Qu, is taken away afterwards.
    """
    array, vector = x.array, x.vector
    count, outputs = x.outputs.shape
    m = x.saved.shape[1]
    size = outputs + m
    array[:, :] = 0.0
    for i in range(count):
        if x.left[i] > 0.0:
            _deviation(x, i, control, predicted, np.sqrt(x.left[i]), array[:, i])
    array[:outputs, count : count + outputs] = x.P_err_factor
    x.rows[:, :] = Qu
    eigen_symmetric(x.rows, x.values, x.vectors)
    for k in range(m):
        for a in range(m):
            array[outputs + a, count + outputs + k] = np.sqrt(max(x.values[k], 0.0)) * x.vectors[a, k]
    lower_triangular(array)
    refused = 0.0
    for i in range(count):
        if x.left[i] < 0.0:
            _deviation(x, i, control, predicted, np.sqrt(-x.left[i]), vector)
            taken = take_away(array, size, outputs, vector)
            if taken < 0.0:
                return -1.0
            refused += taken
    for k in range(m):
        if x.values[k] < 0.0:
            vector[:outputs] = 0.0
            for a in range(m):
                vector[outputs + a] = np.sqrt(-x.values[k]) * x.vectors[a, k]
            refused += take_away(array, size, outputs, vector)
    x.output_factor[:, :] = array[:outputs, :outputs]
    x.gain[:, :] = array[outputs:, :outputs]
    for a in range(m):
        for b in range(m):
            total = 0.0
            for k in range(min(a, b) + 1):
                total += array[outputs + a, outputs + k] * array[outputs + b, outputs + k]
            x.next_covariance[a, b] = total
    return refused


@kernel
def _deviation(x: Memory, i: int, control: Array, predicted: Array, scale: float, out: Array) -> None:
    """How far outputs and control of point i are from their means, (l + m,), times a scale."""
    outputs = predicted.shape[0]
    for k in range(outputs):
        out[k] = scale * (x.outputs[i, k] - predicted[k])
    for a in range(control.shape[0]):
        out[outputs + a] = scale * (x.saved[i, a] - control[a])
