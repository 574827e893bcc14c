# SPDX-License-Identifier: Apache-2.0
"""`innovation`: which prediction the reference is compared with.

Where the output is curved, the mean of the sigma points lies beside the output of the control, and leaves an offset.
"""

import numpy as np

from skydiver_utc import UnscentedTransformController


def plant(state, control, dt):
    return state + dt * (control**2 - state)


def end(innovation):
    """Where the plant comes to rest, and the last result."""
    state = np.array([0.1])
    controller = UnscentedTransformController.of(
        plant, state=state, control=0.3, dt=0.1, horizon=8, minimum=0.0, maximum=1.0, innovation=innovation
    )
    for _ in range(300):
        result = controller.step(state, 0.25)
        state = plant(state, result.control, 0.1)
    return state[0], result


(mean, _), (exact, result) = end("mean"), end("control")
print(f"wanted 0.25: {mean:.4f} with the mean, {exact:.4f} with the output of the control")
print(f"at the end the mean is {result.mean_output[0]:.4f}, the control's output {result.of_control[0]:.4f}")
