# SPDX-License-Identifier: Apache-2.0
"""The Kalman filter of a linear plant, as textbooks print it, with constant or drifting errors of its sensors.

x+ = A x + B u + w, y = H x + b + v; the errors b are further states that keep their values.
"""

import numpy as np


class KalmanFilter:
    """Mean x (n,) and covariance P (n, n) of states and errors."""

    def __init__(self, A, B, x, P, Q):
        self.A, self.B, self.x, self.P, self.Q = A, B, x, P, Q

    def predict(self, u):
        self.x = self.A @ self.x + self.B @ u
        self.P = self.A @ self.P @ self.A.T + self.Q

    def correct(self, H, R, y):
        """Returns the normalised innovation squared."""
        innovation, S = y - H @ self.x, H @ self.P @ H.T + R
        K = self.P @ H.T @ np.linalg.inv(S)
        self.x = self.x + K @ innovation
        self.P = self.P - K @ S @ K.T
        return innovation @ np.linalg.inv(S) @ innovation
