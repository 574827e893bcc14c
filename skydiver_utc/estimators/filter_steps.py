# SPDX-License-Identifier: Apache-2.0
"""Prediction and correction of the unscented Kalman filter, on states that may hold an attitude."""

from typing import Any, NamedTuple

import numpy as np

from skydiver_utc.arrays import Array, Integers
from skydiver_utc.estimators.manifold import distance, moved
from skydiver_utc.jit import call, kernel, program
from skydiver_utc.unscented.covariance import symmetric_root
from skydiver_utc.unscented.linear_algebra import gain
from skydiver_utc.unscented.sigma_points import TURN, add_cross_covariance, spread, unwrap, weighted_mean


class Estimate(NamedTuple):
    """The estimate and working arrays, for prediction and correction.

    mean (N,): states (n,) of the plant, then biases of sensors; P (e, e): covariance of its error
    attitude, angles: as in `skydiver_utc.estimators.manifold`
    points (2e+1, N), errors (2e+1, e) from the mean, root (e, e), vectors (e + 1, e), shift (e,), nothing (e,) of zeros
    """

    mean: Array
    P: Array
    attitude: int
    angles: Integers
    weights: Array
    W0: float
    points: Array
    errors: Array
    root: Array
    vectors: Array
    shift: Array
    nothing: Array


class Prediction(NamedTuple):
    """The model's step, a function or an address, and its numbers; state (n,): for the step; Q (e, e) of a step."""

    estimate: Estimate
    step: Any
    parameters: Any
    state: Array
    Q: Array


class Correction(NamedTuple):
    """A sensor: its function, if it is the plant's own, or `selected` states and outputs of the model.

    variance (l,): of its noise; bias: index in the mean of the first of its biases, -1: none is estimated
    angles: which of the l numbers are angles
    named (L,): for all outputs of the model; measured (2e+1, l), expected (l,), C_y (l, l), gain (e, l)
    alive (2e+1,): ones
    """

    estimate: Estimate
    own: int
    function: Any
    numbers: Any
    selected: Integers
    state: Array
    named: Array
    variance: Array
    bias: int
    angles: Integers
    measured: Array
    expected: Array
    C_y: Array
    gain: Array
    alive: Array


@kernel
def _draw(at: Estimate) -> None:
    """Sigma points about the mean."""
    symmetric_root(at.P, 0.0, at.root, at.vectors)
    spread(at.nothing, at.root, at.W0, at.errors)
    for i in range(at.points.shape[0]):
        moved(at.mean, at.errors[i], at.attitude, at.points[i])


@program
def predict(control: Array, given: Prediction, out: Array) -> None:
    """Mean and covariance one step later under a control (c,); out (1,) is not used.

    The mean of attitudes is that from which the rotations to all of them have the mean zero, found in three steps.
    """
    at, x = given.estimate, given.state
    points, errors, shift, mean = at.points, at.errors, at.shift, at.mean
    n = x.shape[0]
    _draw(at)
    for i in range(points.shape[0]):
        for a in range(n):
            x[a] = points[i, a]
        call(given.step, (x, control, given.parameters, x))
        for a in range(n):
            points[i, a] = x[a]
    for a in range(mean.shape[0]):
        mean[a] = points[0, a]
    for attempt in range(3 if at.attitude >= 0 else 1):
        if attempt > 0:
            moved(mean, shift, at.attitude, mean)
        for i in range(points.shape[0]):
            distance(mean, points[i], at.attitude, at.angles, errors[i])
        weighted_mean(errors, at.weights, shift)
    moved(mean, shift, at.attitude, mean)
    for a in range(shift.shape[0]):
        for b in range(shift.shape[0]):
            at.P[a, b] = given.Q[a, b]
    add_cross_covariance(errors, shift, errors, shift, at.weights, at.P)


@program
def correct(values: Array, control: Array, given: Correction, out: Array) -> None:
    """Mean and covariance after a measurement (l,); control (c,): of the step that led to the state.

    out (1 + l,): the normalised innovation squared, then the innovation in units of its own standard deviations, its
    numbers uncorrelated: L^-1 (values - expected), where L L' is the innovation's covariance; NaN: no correction
    """
    at, x, measured, expected, C_y = given.estimate, given.state, given.measured, given.expected, given.C_y
    points, n, l = at.points, x.shape[0], values.shape[0]
    _draw(at)
    for i in range(points.shape[0]):
        for a in range(n):
            x[a] = points[i, a]
        if given.own == 1:
            call(given.function, (x, control, given.numbers, measured[i]))
        else:
            call(given.function, (x, given.numbers, given.named))
            for k in range(l):
                j = given.selected[k]
                measured[i, k] = x[j] if j < n else given.named[j - n]
        for k in range(l if given.bias >= 0 else 0):
            measured[i, k] += points[i, given.bias + k]
    for a in range(given.angles.shape[0]):
        unwrap(measured, given.alive, given.angles[a])
    weighted_mean(measured, at.weights, expected)
    for k in range(l):
        for j in range(l):
            C_y[k, j] = given.variance[k] if k == j else 0.0
        for a in range(at.shift.shape[0]):
            given.gain[a, k] = 0.0
    add_cross_covariance(measured, expected, measured, expected, at.weights, C_y)
    add_cross_covariance(at.errors, at.nothing, measured, expected, at.weights, given.gain)
    for k in range(l + 1):
        out[k] = np.nan
    if not gain(C_y, given.gain, at.P):
        return
    for a in range(at.shift.shape[0]):
        at.shift[a] = 0.0
    out[0] = 0.0
    for k in range(l):
        innovation = values[k] - expected[k]
        for j in range(given.angles.shape[0]):
            if given.angles[j] == k:
                innovation -= TURN * np.rint(innovation / TURN)
        for a in range(at.shift.shape[0]):
            at.shift[a] += given.gain[a, k] * innovation
        for j in range(k):
            innovation -= C_y[k, j] * out[1 + j]
        out[1 + k] = innovation / C_y[k, k]
        out[0] += out[1 + k] * out[1 + k]
    moved(at.mean, at.shift, at.attitude, at.mean)
