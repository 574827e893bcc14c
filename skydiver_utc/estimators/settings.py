# SPDX-License-Identifier: Apache-2.0
"""Settings of the sensors and of the unscented Kalman filter: the block `estimator` of a scenario."""

from typing import Annotated, Literal

from pydantic import model_validator
from typing_extensions import Self

from skydiver_utc.parameters.fields import Parameters, SlotSettings, quantity, text

Deviation = Annotated[float, quantity("state", "standard deviation, in the unit of the state", ge=0, le=1e9)]
Walk = Annotated[
    float, quantity("state/sqrt(s)", "standard deviation of a random walk after one second", ge=0, le=1e9)
]
Bias = Annotated[float, quantity("sensor", "constant error, in the unit of the sensor", ge=-1e9, le=1e9)]


class SensorSettings(Parameters):
    """A sensor: its errors, which the plant's side draws, and what the filter assumes of them."""

    of: Annotated[
        tuple[str, ...],
        text("states or outputs of the plant that it measures; without, it is the plant's own of its name"),
    ] = ()
    rate_Hz: Annotated[float, quantity("Hz", "measurements per second, at most one a step", gt=0, le=1e4)]
    noise: Annotated[
        float,
        quantity("sensor", "standard deviation of each number, in the unit of the sensor", gt=0, le=1e9),
    ]
    bias: Annotated[Bias | tuple[Bias, ...], text("constant error of all numbers, or of each")] = 0.0
    drift: Annotated[
        float, quantity("sensor/sqrt(s)", "random walk of the bias, deviation after one second", ge=0, le=1e9)
    ] = 0.0
    bias_deviation: Annotated[
        float, quantity("sensor", "deviation of the bias before the run; 0: none is estimated", ge=0, le=1e9)
    ] = 0.0
    delay_s: Annotated[float, quantity("s", "from the measurement to its arrival", ge=0, le=10)] = 0.0
    loss: Annotated[float, quantity("1", "share of the measurements that never arrive", ge=0, lt=1)] = 0.0


class UnscentedKalmanFilterSettings(SlotSettings):
    """An unscented Kalman filter on a plant's model, and the sensors that it has."""

    kind: Literal["unscented_kalman_filter"] = "unscented_kalman_filter"
    sensors: Annotated[dict[str, SensorSettings], text("sensors by name")]
    initial_deviation: Annotated[
        dict[str, Deviation], text("of the initial state, by state; of an attitude x y z in body axes [rad]")
    ] = {}
    process_noise: Annotated[dict[str, Walk], text("what the model does not know, by state")] = {}
    W0: Annotated[float, quantity("1", "weight of the central sigma point", ge=0, lt=1)] = 0.25
    angles: Annotated[
        tuple[str, ...], text("states and outputs that are angles [rad]: 2 pi further they are the same")
    ] = ()
    history_s: Annotated[
        float, quantity("s", "age up to which a late measurement is filtered again", ge=0, le=10)
    ] = 0.5

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not self.sensors:
            raise ValueError("sensors is empty: name one at least")
        return self
