"""UTC bound to the skydiver: the paper's controller behind the controller protocol."""

import numpy as np
from numpy.typing import NDArray

from skydiver_utc.control.coupling import CouplingSchedule
from skydiver_utc.control.limits import ControlLimits
from skydiver_utc.control.protocol import Decision, Status
from skydiver_utc.control.utc import UtcLaw
from skydiver_utc.control.utc_step import Recovery
from skydiver_utc.parameters import ParameterError, UtcParameters
from skydiver_utc.plant.model import PlantModel
from skydiver_utc.plant.skydiver import CONTROL_NAMES
from skydiver_utc.simulation.prediction import SkydiverPrediction

Array = NDArray[np.float64]
# How fast alpha goes to rest, so that the limbs do not jerk the body.
_SHARE_OF_SLEW_AT_REST = 0.1


class SkydiverUtc:
    """Tracks a body rate, `tracked` in the state, with yaw damping, two hands and the turning pattern."""

    telemetry_names: tuple[str, ...] = (
        "predicted_rate",
        "innovation",
        *(f"std_{name}" for name in CONTROL_NAMES),
        "repaired_covariance",
        "recovery",
    )

    def __init__(
        self,
        parameters: UtcParameters,
        model: PlantModel,
        limits: ControlLimits,
        initial: Array,
        tracked: int,
        initial_fall_rate: float,
    ) -> None:
        self._initial = initial
        self._limits = limits
        self._tracked = tracked
        self._alpha_at_rest = parameters.alpha_at_rest
        self._horizon = parameters.horizon_steps
        self._tangent = parameters.aim == "tangent"
        self._prediction = SkydiverPrediction(model, parameters, tracked)
        self._coupling = CouplingSchedule(parameters, parameters.k_hyst(model.dt), model.dt)
        further = [(0.0, parameters.P_err_roll_rate), (initial_fall_rate, parameters.P_err_fall_rate)]
        further += zip(parameters.rest, parameters.P_rest, strict=True)
        kept, variances = zip(
            (0.0, parameters.P_err),
            *((kept, variance) for kept, variance in further if variance > 0.0),
            strict=True,
        )
        self._reference = np.array(kept)
        m = len(CONTROL_NAMES)
        printed = np.full(2 * m + 1, (1.0 - parameters.W0) / (2 * m))
        self._utc = UtcLaw(
            self._prediction,
            limits,
            P_err=np.diag(variances),
            W0=parameters.W0,
            covariance_floor=parameters.covariance_floor,
            keep_indefinite=parameters.covariance_reading == "printed",
            move_unclipped=parameters.move_reading == "unclipped",
            output_weights=printed if parameters.weights_reading == "printed" else None,
            leak=parameters.covariance_leak,
            square_root=parameters.square_root,
            iterations=_iterations(parameters),
        )
        self.preview_steps = parameters.preview_steps(model.dt)
        self.reset()

    def reset(self) -> None:
        """Start again; Pu is set at the first decision, because its signs need the reference."""
        self.resume(self._initial)
        self._moved = False

    def resume(self, control: Array) -> None:
        """Start from this control (4,), the one applied last, with Pu as at a flight's first decision.

        Whether the reference has moved the body is not known then; an alpha nearer to that at rest says so.
        """
        self._prediction.reset()
        self._coupling.reset()
        self._utc.reset(control, np.zeros((len(CONTROL_NAMES), len(CONTROL_NAMES))))
        self._started = False
        at_rest = self._alpha_at_rest
        self._moved = at_rest is not None and bool(
            abs(control[3] - at_rest) < abs(control[3] - self._initial[3])
        )

    def decide(self, state: Array, preview: Array) -> Decision:
        """One UTC step; after the reference has ended, where the parameters ask for it, the posture at rest."""
        self._moved = self._moved or bool(preview[0])
        if self._alpha_at_rest is not None and self._moved and not preview.any():
            return self._rest(state, self._alpha_at_rest)
        if not self._started:
            self._utc.reset(self._utc.control, self._coupling.initial_covariance(preview))
            self._started = True
        Qu = self._coupling.process_noise(preview)
        reference = self._reference
        reference[0] = preview[self._horizon]
        if self._tangent:
            reference[0] = preview[0] + self._horizon * (preview[1] - preview[0])
        step = self._utc.step(state, preview, reference, Qu)
        if step.recovery is Recovery.RESTARTED:
            # The law went back to the Pu of the flight's first decision, whose signs may be those of another turn.
            self._utc.begin_from(self._coupling.initial_covariance(preview))
        predicted, innovation = float(step.predicted[0]), float(step.innovation[0])
        return Decision(
            step.control, self._telemetry(predicted, innovation, step.repaired, step.recovery), step.status
        )

    def _rest(self, state: Array, alpha: float) -> Decision:
        """The control that the flight began with, at another pattern angle [rad]; no feedback."""
        wanted = self._initial.copy()
        wanted[3] = alpha
        slew = self._limits.slew.copy()
        slew[3] *= _SHARE_OF_SLEW_AT_REST
        control = self._limits._replace(slew=slew).apply(wanted, self._utc.control)
        self._utc.hold(control)
        rate = float(state[self._tracked])
        return Decision(control, self._telemetry(rate, -rate, 0.0, Recovery.NONE), Status.SOLVED)

    def _telemetry(self, predicted: float, innovation: float, repaired: float, recovery: float) -> Array:
        values = np.empty(len(self.telemetry_names))
        values[0], values[1], values[-2], values[-1] = predicted, innovation, repaired, recovery
        values[2:-2] = self._utc.deviations
        return values


def _iterations(p: UtcParameters) -> int:
    if p.iterations > 1 and (p.W0 < 0.0 or p.square_root or p.first_increment_reading == "measured"):
        raise ParameterError(
            f"controller.iterations is {p.iterations}: more than one needs W0 of zero or more, square_root=false"
            " and first_increment_reading=unchanged"
        )
    return p.iterations


def rescued_steps(names: tuple[str, ...], telemetry: Array) -> int:
    """Steps of a flight (steps, names) where only covariances about the central point gave UTC an answer."""
    if "recovery" not in names:
        return 0
    return int(np.count_nonzero(telemetry[:, names.index("recovery")] == Recovery.ABOUT_CENTRE))
