# SPDX-License-Identifier: Apache-2.0
"""`coupling` and `dynamics` of a scenario: the paper's covariances and its law of alpha inside the horizon."""

import numpy as np

from skydiver_utc import load_scenario, simulate

for name in ("fast_turn_unknown_dynamics", "fast_turn_pi_dynamics"):
    run = simulate(load_scenario(name, {"duration_s": 0.5}))
    settings = run.scenario.controller
    coupling = settings.coupling.alpha_sign if settings.coupling else "none"
    dynamics = settings.dynamics.control if settings.dynamics else "held"
    rmse = np.rad2deg(np.sqrt(np.mean(run.error**2)))
    print(f"{name}: coupling by {coupling}, dynamics {dynamics}, RMSE {rmse:.2f} deg/s in the first 0.5 s")
