"""A flight's bits must not depend on what was compiled where, in which order, and what came from the cache."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import skydiver_utc

FLY = """
import hashlib
from skydiver_utc.parameters import load_scenario
from skydiver_utc.simulation.build import build_plant
from skydiver_utc.simulation.closed_loop import simulate
if {plant_first}:
    plant = build_plant(load_scenario("fast_turn_unknown_dynamics"))
    held = plant.initial_applied()
    plant.step(plant.initial_state(), held, plant.actuate(held[:4], held))
if {fly}:
    flight = simulate(load_scenario("fast_turn_unknown_dynamics", {{"duration_s": 2.0}}))
    print(hashlib.sha256(flight.states.tobytes() + flight.commands.tobytes()).hexdigest())
"""


def flown_bits(package_parent, plant_first=False, fly=True):
    environment = {**os.environ, "PYTHONPATH": str(package_parent)}
    finished = subprocess.run(
        [sys.executable, "-c", FLY.format(plant_first=plant_first, fly=fly)],
        env=environment,
        cwd=package_parent,
        check=True,
        capture_output=True,
        text=True,
    )
    return finished.stdout


def copied_package(folder):
    """The package with its configuration and without any compiled kernel."""
    source = Path(skydiver_utc.__file__).parent
    shutil.copytree(source, folder / "skydiver_utc", ignore=shutil.ignore_patterns("__pycache__"))
    from skydiver_utc.parameters.loading import config_folder

    shutil.copytree(config_folder(), folder / "config")
    return folder


def test_fresh_cached_and_partly_cached_kernels_give_the_same_bits(tmp_path):
    whole = copied_package(tmp_path / "whole")
    fresh = flown_bits(whole)
    cached = flown_bits(whole)
    # As over ROS: one process has compiled the plant, another then compiles the controller around it.
    parts = copied_package(tmp_path / "parts")
    flown_bits(parts, plant_first=True, fly=False)
    partly = flown_bits(parts)
    assert fresh == cached == partly
    assert len(fresh.strip()) == 64
