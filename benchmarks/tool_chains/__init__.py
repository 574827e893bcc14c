# SPDX-License-Identifier: Apache-2.0
"""Model predictive control of the same skydiver by well-known tool chains (extra `bench`)."""

NAMES = ("ipopt", "do_mpc", "osqp")
