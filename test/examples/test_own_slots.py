# SPDX-License-Identifier: Apache-2.0
"""What stands in a slot may be the user's own: one module and one YAML file each, nothing in the package."""

import ast
import re
from pathlib import Path

import aerodynamics as oracle
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from skydiver_utc.loop.build import build_plant
from skydiver_utc.loop.closed_loop import simulate
from skydiver_utc.parameters import from_yaml, load_scenario, override, to_yaml

ROOT = Path(__file__).parents[2]
FOLDERS = {name: ROOT / "examples" / name for name in ("own_plant", "own_slots")}
SLOTS = {
    "triangle": "reference",
    "proportional": "controller",
    "smoothing": "estimator",
    "gusts": "disturbances",
}
PLANTS = ("pendulum", "quadrotor")


@pytest.fixture
def load(tmp_path, monkeypatch):
    """Load an example by its name, from another folder than its own."""
    monkeypatch.chdir(tmp_path)
    return lambda name: load_scenario(str(next(ROOT.glob(f"examples/own_*/{name}.yaml"))))


@pytest.mark.parametrize(("folder", "names"), [("own_plant", PLANTS), ("own_slots", SLOTS)])
def test_each_example_is_one_module_and_one_yaml_file(folder, names):
    files = {path.name for path in FOLDERS[folder].iterdir() if path.is_file()}
    assert files == {f"{name}.{suffix}" for name in names for suffix in ("py", "yaml")}
    package = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "skydiver_utc").rglob("*.py"))
    for name in names:
        assert not re.search(rf"\b{name}:\w", package)  # as a scenario names it
        tree = ast.parse((FOLDERS[folder] / f"{name}.py").read_text(encoding="utf-8"))
        modules = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
        assert modules <= {"skydiver_utc", "typing"}


@pytest.mark.parametrize("name", [*PLANTS, *SLOTS])
def test_its_scenario_comes_back_from_yaml(load, name):
    scenario = load(name)
    assert from_yaml(to_yaml(scenario)) == scenario


def test_the_reference_is_tracked(load):
    run = simulate(load("triangle"))
    wanted = np.interp(run.time_s, np.arange(13.0), np.deg2rad([0, 120, 0, -120] * 3 + [0]))
    np.testing.assert_allclose(run.reference[: len(wanted), 0], wanted, atol=1e-12)
    assert run.outcome.value == "completed"


def test_the_controller_decides(load):
    run = simulate(load("proportional"))
    assert run.telemetry_names == ("error",)
    np.testing.assert_array_equal(run.telemetry[:, 0], -run.error[:-1, 0])
    np.testing.assert_allclose(run.commands[:, 3], 1.5 * run.telemetry[:, 0], rtol=1e-12)


def test_the_controller_decides_on_the_estimate(load):
    scenario = load("smoothing")
    smoothed, true = simulate(scenario), simulate(override(scenario, {"estimator": {"kind": "true_state"}}))
    assert np.abs(smoothed.commands - true.commands).max() > 1e-3
    assert np.abs(smoothed.error).max() == pytest.approx(np.abs(true.error).max(), rel=0.5)


def test_a_disturbance_repeats_with_its_seed(load):
    scenario = load("gusts")
    run, again, other = simulate(scenario), simulate(scenario), simulate(scenario.replace(seed=2))
    assert np.abs(run.error).max() > 0.1
    np.testing.assert_array_equal(run.states, again.states)
    assert not np.array_equal(run.states, other.states)


def test_the_pendulum_against_scipy(load):
    start, torque = np.array([0.7, 1.0]), np.array([0.2])

    def derivative(_, x):
        return [x[1], -9.81 / 0.4 * np.sin(x[0]) - 0.1 * x[1] + 0.2 / (0.5 * 0.4**2)]

    expected = solve_ivp(derivative, (0.0, 0.01), start, rtol=1e-11, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(build_plant(load("pendulum")).step(start, torque, torque), expected, rtol=1e-7)


@pytest.mark.long
def test_utc_swings_the_pendulum(load):
    run = simulate(load("pendulum"))
    assert np.abs(run.error[len(run.error) // 2 :]).max() < 0.01
    assert np.abs(run.commands).max() <= 3.0


@pytest.mark.long
def test_utc_flies_the_quadrotor_to_its_place(load):
    run = simulate(load("quadrotor"))
    np.testing.assert_allclose(run.states[-1, :3], [1.0, -0.5, 2.0], atol=1e-5)
    assert np.abs(run.states[-1, 7:]).max() < 1e-5


@pytest.mark.long
def test_the_quadrotor_against_scipy(load):
    """Rotation and quaternion from the oracle, in world axes where the plant works in body axes."""
    plant, control = build_plant(load("quadrotor")), np.array([11.0, 0.05, -0.04, 0.03])
    inertia = np.array([0.2, 0.2, 0.3])

    def derivative(_, x):
        turned = oracle.rotation_matrix(x[3:7])
        force = turned @ [0.0, 0.0, control[0]] + [0.0, 0.0, -9.81]
        turning = (control[1:] - np.cross(x[10:], inertia * x[10:])) / inertia
        return np.concatenate([x[7:10], oracle.quaternion_derivative(x[3:7], x[10:]), force, turning])

    start = plant.initial_state()
    start[10:] = [0.3, -0.2, 0.5]
    expected = solve_ivp(derivative, (0.0, 2.0), start, rtol=1e-11, atol=1e-12).y[:, -1]
    end = start
    for _ in range(200):
        end = plant.step(end, control, control)
    end[7:10] = oracle.rotation_matrix(end[3:7]) @ end[7:10]
    np.testing.assert_allclose(end, expected, atol=1e-7)
