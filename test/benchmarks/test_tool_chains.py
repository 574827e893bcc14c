# SPDX-License-Identifier: Apache-2.0
"""The tool chains of benchmarks/ minimise the cost of the package's Gauss-Newton controller, under its limits."""

import numpy as np
import pytest

pytest.importorskip("casadi", reason="the tool chains are an extra: pip install '.[bench]'")
pytest.importorskip("do_mpc", reason="the tool chains are an extra: pip install '.[bench]'")
pytest.importorskip("osqp", reason="the tool chains are an extra: pip install '.[bench]'")

import tool_chains.chains
from c_transcription import compiler
from tool_chains.chains import CHAINS, controller_by, controller_of, tuned
from tool_chains.ipopt import TOLERANCE, solve_by_ipopt, solve_by_opti
from tool_chains.program import program
from tool_chains.real_time import solve_by_osqp
from tool_chains.with_do_mpc import solve_by_do_mpc
from tune import TASK

from skydiver_utc.controllers.protocol import Status
from skydiver_utc.loop.build import build_controller, build_plant, build_reference
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.parameters import ParameterError, load_scenario

pytestmark = pytest.mark.skipif(compiler() is None, reason="they are compiled: needs a C compiler")

# Model steps of two control periods, so that nothing of the grid is one by chance.
CHANGES = {
    "controller.horizon_steps": 6,
    "controller.blocks": 3,
    "controller.step_periods": 2,
    "duration_s": 2.0,
}
SCENARIO = load_scenario("fast_turn_gauss_newton", CHANGES)
PLANT, REFERENCE = build_plant(SCENARIO), build_reference(SCENARIO)
PROGRAM = program(SCENARIO, PLANT, REFERENCE)
# In the run-up, near the peak of the turn, and where it goes back through zero.
STEPS = (20, 150, 290, 450)
CONVERGED = {
    "ipopt": solve_by_ipopt,
    "opti": solve_by_opti,
    "do_mpc": lambda program: solve_by_do_mpc(program, compiled=False),
}
# An interior-point method leaves its tolerance at each of the 24 bounds and 6 rate limits.
GAP = {"ipopt": 30 * TOLERANCE, "opti": 30 * 1e-8, "do_mpc": 30 * 1e-8}


@pytest.fixture(scope="module")
def flight():
    return simulate(SCENARIO)


def preview(k):
    """The reference at a step and over the horizon, by control periods."""
    return REFERENCE.preview(k, PROGRAM.horizon.preview_steps + 1)


def question(flight, k):
    """What is given at a step of the flight: state, control applied last, reference, sequence to start from."""
    reference = PROGRAM.horizon.reference(preview(k)).ravel()
    applied = flight.applied[k - 1]
    return flight.states[k], applied, reference, np.tile(applied, (3, 1))


def cost(flight, k, sequence):
    """J by the package's own roll-out."""
    state, applied, reference, _ = question(flight, k)
    PROGRAM.horizon.sequences[0] = sequence
    outputs = PROGRAM.horizon.outputs(state, applied, preview(k))
    return PROGRAM.cost.of(PROGRAM.horizon.sequences, applied, outputs, reference)[0]


def solved(flight, k, solve, times=1):
    """The sequence after asking `times` over, each time from the answer before."""
    state, applied, reference, sequence = question(flight, k)
    for _ in range(times):
        answer = solve(state[3:], applied, reference, sequence)
        assert answer.found
        sequence = answer.sequence
    return sequence


def package_s_minimum(flight, k):
    """The sequence after many Gauss-Newton steps of the package."""
    scenario = load_scenario("fast_turn_gauss_newton", CHANGES | {"controller.iterations": 50})
    controller = build_controller(scenario, PLANT, REFERENCE)
    state, applied, _, _ = question(flight, k)
    controller.resume(applied)
    decision = controller.decide(state, preview(k))
    return decision.telemetry[controller.telemetry_names.index("cost")]


@pytest.mark.parametrize("chain", CONVERGED)
def test_the_solution_costs_no_more_than_the_package_s_minimum(flight, chain):
    solve, gained = CONVERGED[chain](PROGRAM), 0.0
    for k in STEPS:
        at_start, least = cost(flight, k, question(flight, k)[3]), package_s_minimum(flight, k)
        found = cost(flight, k, solved(flight, k, solve))
        assert found - least < GAP[chain]
        gained = max(gained, at_start - found)
    assert gained > 100 * GAP[chain]


def test_the_real_time_iteration_repeated_is_the_converged_solution(flight):
    iterate, converge = solve_by_osqp(PROGRAM), solve_by_opti(PROGRAM)
    width = PROGRAM.maximum - PROGRAM.minimum
    for k in STEPS:
        repeated, converged = solved(flight, k, iterate, times=30), solved(flight, k, converge)
        np.testing.assert_allclose(repeated / width, converged / width, atol=1e-3)
        assert cost(flight, k, repeated) == pytest.approx(cost(flight, k, converged), abs=GAP["opti"])


def test_solutions_keep_bounds_and_rates(flight):
    """A reference out of reach to the other side, so that alpha moves as fast as it may."""
    for make in (*CONVERGED.values(), solve_by_osqp):
        state, applied, reference, start = question(flight, 290)
        sequence = make(PROGRAM)(state[3:], applied, reference - 20.0, start).sequence
        change = np.diff(np.append(applied[3], sequence[:, 3]))
        np.testing.assert_allclose(change, -PROGRAM.change, atol=1e-4)
        assert (sequence > PROGRAM.minimum - 1e-4).all()
        assert (sequence < PROGRAM.maximum + 1e-4).all()


@pytest.mark.parametrize("chain", ["ipopt", "osqp"])
def test_a_flight_repeats_bit_for_bit_and_keeps_the_limits(chain):
    scenario = load_scenario("fast_turn_gauss_newton", CHANGES | {"duration_s": 0.5})
    first, again = (simulate(scenario, build=controller_of(chain)) for _ in range(2))
    assert first.commands.tobytes() == again.commands.tobytes()
    assert (first.status == Status.SOLVED).all()
    assert (first.commands >= PROGRAM.minimum).all()
    assert (first.commands <= PROGRAM.maximum).all()
    assert np.abs(np.diff(first.commands[:, 3])).max() <= PROGRAM.horizon.limits[2, 3] + 1e-15


@pytest.mark.parametrize(
    "make", [solve_by_ipopt, solve_by_osqp, CONVERGED["do_mpc"]], ids=["ipopt", "osqp", "do_mpc"]
)
def test_without_a_solution_the_control_is_kept_and_the_next_decision_is_sound(flight, make):
    controller = controller_by(make)(SCENARIO, PLANT, REFERENCE)
    state, applied, _, _ = question(flight, 150)
    controller.resume(applied)
    before = controller.decide(state, preview(150))
    kept = controller.decide(np.full(13, np.nan), preview(150))
    assert kept.status is Status.KEPT_PREVIOUS
    np.testing.assert_array_equal(kept.control, before.control)
    after = controller.decide(state, preview(150))
    assert after.status is Status.SOLVED
    assert np.isfinite(after.control).all()


def test_tuned_costs_are_of_the_chains_that_fly():
    found = tuned({"duration_s": 0.1})
    assert {one.chain for one in found.values()} == set(CHAINS)
    assert all(one.scenario.duration_s == 0.1 for one in found.values())


def test_tuned_costs_of_an_unknown_chain_are_refused(monkeypatch, tmp_path):
    file = tmp_path / "tuned.yaml"
    file.write_text("acados: {chain: acados, controller: {blocks: 1}}\n")
    monkeypatch.setattr(tool_chains.chains, "_TUNED", file)
    with pytest.raises(ParameterError, match=r"acados .* must hold a chain, one of ipopt, do_mpc, osqp"):
        tuned()


def test_another_controller_s_scenario_is_refused():
    with pytest.raises(ParameterError, match="gauss_newton"):
        program(load_scenario(TASK), PLANT, REFERENCE)
