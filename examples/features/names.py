# SPDX-License-Identifier: Apache-2.0
"""`FunctionPlant` and `UtcSettings`: names of states, controls and outputs, and settings by these names.

`outputs` gives a further output a constant reference of its own: here the speed is held near 0.
"""

import numpy as np

from skydiver_utc import FunctionPlant, UnscentedTransformController, UtcSettings


def cart(state, control, dt):
    return np.array([state[0] + dt * state[1], state[1] + dt * control[0]])


plant = FunctionPlant(
    cart, lambda state: state, state=[0.0, 0.0], control=[0.0], dt=0.05, minimum=-5.0, maximum=5.0,
    state_names=("place", "speed"), control_names=("force",), output_names=("place", "speed"),
)  # fmt: skip
settings = UtcSettings(
    horizon_steps=10,
    Pu={"force": 0.5},
    P_err={"place": 1e-4},
    outputs={"speed": {"reference": 0.0, "P_err": 0.1}},
)
controller = UnscentedTransformController(settings, plant, outputs=("place",))
state = plant.initial_state()
for _ in range(200):
    state = plant.step(state, controller.control, controller.step(state, 1.0).control)
print(f"place {state[0]:.4f}, speed {state[1]:.4f}; telemetry {', '.join(controller.telemetry_names[:3])}")
