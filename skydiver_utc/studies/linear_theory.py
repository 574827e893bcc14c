# SPDX-License-Identifier: Apache-2.0
"""Linear theory of UTC around the skydiver's steady fall, or on a linear plant."""

from typing import Any, NamedTuple

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.utc.coupling import CouplingSchedule
from skydiver_utc.controllers.utc.settings import UtcSettings, matrix
from skydiver_utc.loop.build import build_reference
from skydiver_utc.loop.linear_loop import fly_linear, measured_decay
from skydiver_utc.parameters import ParameterError, Scenario
from skydiver_utc.parameters.linear_plant import load_linear_plant
from skydiver_utc.parameters.skydiver import CONTROLS
from skydiver_utc.plants.linear import LinearModel, linear_model, zero_order_hold
from skydiver_utc.plants.skydiver.linearise import control_effect, linearise, tilt_axes, velocity_axes
from skydiver_utc.plants.skydiver.model import build_model
from skydiver_utc.plants.skydiver.steady import HeldBody, SteadyFall, steady_turn, straight_falls
from skydiver_utc.theory.linear_plant import with_outputs_of_controls
from skydiver_utc.theory.stability import Stability, analyse

_TURN_STEPS = 12
_RATES = ("roll_rate", "pitch_rate", "yaw_rate")  # in the order of the state
_PUSHED_STEPS = 4000


class Tuned(NamedTuple):
    """A linear plant with UTC's tuning on it, and a sentence on what it is; Qu (m, m), P_err (l, l)."""

    plant: LinearModel
    horizon_steps: int
    dt_s: float
    Qu: Array
    P_err: Array
    nonlinearity: float
    what: str


def of_linear_plant(name_or_path: str) -> Tuned:
    """A plant from a YAML file."""
    given = load_linear_plant(name_or_path)
    return Tuned(
        linear_model(given, given.dt_s), given.horizon_steps, given.dt_s, given.process_noise, np.diag(given.P_err),
        given.nonlinearity, f"{given.name}: {given.description}",
    )  # fmt: skip


def of_skydiver(scenario: Scenario, alpha: float) -> Tuned:
    """The skydiver in its straight fall, or in the steady turn at a pattern angle [rad]."""
    parameters = scenario.controller
    if (
        not isinstance(parameters, UtcSettings)
        or parameters.dynamics is not None
        or parameters.coupling is None
    ):
        raise ParameterError(
            f"the controller of {scenario.name} is not UTC with held controls, the only one that the theory covers:"
            " take fast_turn_unknown_dynamics"
        )
    if alpha and "alpha" in parameters.nominal:
        raise ParameterError(
            f"{scenario.name} has a nominal alpha, so that no turn is steady: take it out of controller.nominal,"
            " or leave --alpha out"
        )
    drawn = [CONTROLS.index(name) for name in parameters.nominal]
    model = build_model(scenario.plant, scenario.dt_s)
    fall = straight_falls(model)[0]
    control = np.array([scenario.plant.initial.Cm_damp_yaw, 0.0, 0.0, 0.0])
    control[drawn] = [nominal.value for nominal in parameters.nominal.values()]
    for angle in np.linspace(0.0, alpha, _TURN_STEPS + 1)[1:]:
        control[3] = angle
        turn = steady_turn(HeldBody(model, control), fall)
        if turn is None:
            raise ParameterError(f"there is no steady turn at {angle:.2f} rad: take a smaller --alpha")
        fall = turn
    A, B = zero_order_hold(
        linearise(HeldBody(model, control), fall), control_effect(model, control, fall), scenario.dt_s
    )
    tracked = _RATES.index(build_reference(scenario).outputs[0])
    schedule = CouplingSchedule(
        parameters.coupling,
        matrix("Pu", parameters.Pu or 1.0, CONTROLS),
        CONTROLS,
        parameters.Qu_ratio,
        scenario.dt_s,
    )
    preview = np.full(parameters.preview_steps(scenario.dt_s) + 1, fall.rates[tracked])
    further = {"roll_rate": 1, "fall_rate": 2}
    used = [0, *(further[name] for name in parameters.outputs)]
    variances = [parameters.P_err, *(output.P_err for output in parameters.outputs.values())]
    variances += [nominal.variance for nominal in parameters.nominal.values()]
    return Tuned(
        with_outputs_of_controls(LinearModel(A, B, _outputs(fall, tracked)[used]), drawn),
        parameters.steps[-1],
        scenario.dt_s,
        _definite(schedule.process_noise(preview, control), parameters.covariance_floor or 0.0),
        np.diag(np.array(variances, dtype=float)),
        0.0,
        f"skydiver of {scenario.name}, {round(np.rad2deg(fall.yaw_rate), 1) + 0.0:.1f} deg/s at alpha = {alpha:g} rad,"
        f" Cm_damp_yaw = {control[0]:g}",
    )


def _outputs(fall: SteadyFall, tracked: int) -> Array:
    """The tracked body rate (0 roll, 1 pitch, 2 yaw), roll rate and fall rate (3, 8) of the deviations."""
    rows = np.zeros((3, 8))
    rows[0, 2 + tracked], rows[1, 2] = 1.0, 1.0
    # Fall rate is -up . velocity; a tilt by an axis turns up, seen from the body, by up x axis.
    rows[2, :2] = [-np.cross(fall.up, axis) @ fall.velocity for axis in tilt_axes(fall.up)]
    rows[2, 5:] = -velocity_axes(fall) @ fall.up
    return rows


def _definite(matrix: Array, floor: float) -> Array:
    """The nearest covariance, as UTC repairs Pu."""
    values, vectors = np.linalg.eigh(matrix)
    return (vectors * np.maximum(values, floor)) @ vectors.T


def report(tuned: Tuned) -> dict[str, Any]:
    """The result, plain data."""
    plant = tuned.plant
    try:
        found = analyse(plant, tuned.horizon_steps, tuned.Qu, tuned.P_err, tuned.nonlinearity)
    except np.linalg.LinAlgError as error:
        raise ParameterError(
            f"the numbers of {tuned.what.partition(':')[0]} are too far apart in size to be analysed ({error}):"
            " give states, controls and outputs units in which they are alike, or take fewer --steps"
        ) from error
    except ValueError as error:
        raise ParameterError(str(error)) from error
    logs = np.log(np.maximum(np.abs(found.eigenvalues), 1e-300))
    return {
        "plant": tuned.what,
        "states": len(plant.A),
        "controls": plant.B.shape[1],
        "outputs": len(plant.C),
        "dt_s": tuned.dt_s,
        "horizon_steps": tuned.horizon_steps,
        "open_loop_decay": float(np.abs(np.linalg.eigvals(plant.A)).max()),
        "gain": found.gain.K.tolist(),
        "control_memory": found.gain.memory.tolist(),
        "Pu_growth_per_step": float(np.linalg.eigvalsh(found.gain.growth)[-1]),
        "states_of_rest": found.Z.shape[0] - found.across.shape[1],
        "eigenvalues": [[value.real, value.imag] for value in found.eigenvalues],
        "time_constants_s": [None if log >= 0.0 else float(-tuned.dt_s / log) for log in logs],
        "decay": found.decay,
        "stable": found.stable,
        "measured_decay": measured_decay(plant, tuned.horizon_steps, tuned.Qu, tuned.P_err, found)
        if found.stable
        else None,
        "riccati_margin_one_step": found.riccati_one_step.margin,
        "riccati_margin": found.riccati.margin,
        "riccati_additional": float(np.linalg.norm(found.riccati.additional, 2)),
        "nonlinearity": tuned.nonlinearity,
        "ball": _of_ball(tuned, found),
    }


def _of_ball(tuned: Tuned, found: Stability) -> dict[str, float] | None:
    if found.ball is None or tuned.nonlinearity == 0.0:
        return None
    n = len(tuned.plant.A)

    def outwards(x: Array) -> Array:
        size = float(np.linalg.norm(x))
        return tuned.nonlinearity * (x / size if size > 0.0 else np.eye(n)[0])

    run = fly_linear(
        tuned.plant, tuned.horizon_steps, tuned.Qu, tuned.P_err, found, np.zeros(len(found.Z)), _PUSHED_STEPS,
        outwards,
    )  # fmt: skip
    return {
        "radius": found.ball.radius,
        "kept": found.ball.kept,
        "from_rest": found.ball.summed,
        "measured": float(np.linalg.norm(run @ found.across, axis=1).max()),
    }
