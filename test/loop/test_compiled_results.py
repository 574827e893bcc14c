# SPDX-License-Identifier: Apache-2.0
"""What a controller computes must not depend, to the last bit, on what was compiled where and what was kept on disk."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from runs import CART

import skydiver_utc
from skydiver_utc.parameters.loading import config_folder

PACKAGE = Path(skydiver_utc.__file__).parent
pytestmark = pytest.mark.long

# A jitted plant of a user's, which stands in a file of its own.
PLANT = """
import numpy as np
from numba import njit

@njit(cache=True)
def plant(x, u, dt):
    return np.array([x[0] + dt * x[1], x[1] + dt * (u[0] - 9.0 * np.sin(x[0]) - 0.1 * x[1])])

@njit
def output(x):
    return x[0] + 0.1 * x[1]
"""
# Prints the bits of some controls, and the names of the functions that were compiled rather than loaded.
RUN = """
import sys
import numpy as np
from numba.core import event
from my_plant import output, plant
from skydiver_utc import UnscentedTransformController
from skydiver_utc.jit import on_first_compilation

on_first_compilation(lambda sentence: print("sentence", sentence, file=sys.stderr))
events = []
class Recorded(event.Listener):
    def on_start(self, started): events.append(started.data["dispatcher"].py_func)
    def on_end(self, ended): pass
event.register("numba:compile", Recorded())

def controller():
    return UnscentedTransformController.of(
        plant, output, state=[0.3, 0.0], control=0.0, dt=0.02, horizon=12, minimum=-15.0, maximum=15.0, rate=500.0
    )
if len(sys.argv) > 1: controller()
made, x = controller(), np.array([0.3, 0.0])
bits = b""
for k in range(200):
    result = made.step(x, 0.5)
    bits += result.control.tobytes() + result.covariance.tobytes()
    x = plant(x, result.control, 0.02)
print(bits.hex())
print(*sorted({f"{f.__module__}.{f.__name__}" for f in events}))
"""


def run(package, folder, *arguments, **variables):
    """Bits, functions compiled, and how often it was said, of a process that has the plant's module in a folder."""
    environment = {**os.environ, "PYTHONPATH": f"{package}{os.pathsep}{folder}"} | variables
    finished = subprocess.run(
        [sys.executable, "-c", RUN, *arguments], env=environment, cwd=folder, check=True, capture_output=True, text=True
    )  # fmt: skip
    bits, compiled = finished.stdout.splitlines()
    assert len(bits) > 1000
    return bits, set(compiled.split()), finished.stderr.count("sentence")


def own_folder(place, module=PLANT):
    place.mkdir()
    (place / "my_plant.py").write_text(module, encoding="utf-8")
    return place


def test_fresh_and_cached_kernels_give_the_same_bits_and_a_compilation_is_said_once(tmp_path):
    """All that is kept lies in NUMBA_CACHE_DIR; a process that finds it there compiles nothing and says nothing."""
    cache, folder = tmp_path / "cache", own_folder(tmp_path / "own")
    fresh, compiled, said = run(PACKAGE.parent, folder, NUMBA_CACHE_DIR=str(cache))
    assert {"skydiver_utc.controllers.roll_out.roll_out", "my_plant.plant"} <= compiled
    assert said == 1
    kept = " ".join(path.name for path in cache.rglob("*.nbi"))
    assert "roll_out.roll_out" in kept
    assert "plant.step" in kept
    assert not list(folder.rglob("*.nbi"))
    cached = run(PACKAGE.parent, folder, NUMBA_CACHE_DIR=str(cache))
    assert cached == (fresh, set(), 0)
    with_another_before = run(PACKAGE.parent, folder, "another", NUMBA_CACHE_DIR=str(cache))
    assert with_another_before == cached


def test_where_nothing_can_be_written_it_runs_uncached(tmp_path):
    """A file in the place of every folder for compiled code keeps root out, too."""
    scenario = tmp_path / "cart.yaml"
    scenario.write_text(CART.replace("{place: 2.0, speed: 0.0}", "{force: 1.0}"))  # open loop
    package = tmp_path / "package" / "skydiver_utc"
    shutil.copytree(PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    (package.parent / "config").symlink_to(config_folder())
    for place in (path for path in package.rglob("") if path.is_dir()):
        (place / "__pycache__").touch()
    nowhere = dict.fromkeys(("HOME", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR", "IPYTHONDIR"), "/dev/null/cache")
    command = [sys.executable, "-m", "skydiver_utc", "simulate", str(scenario)]
    environment = {**os.environ, "PYTHONPATH": str(package.parent)} | nowhere
    done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("compiling") == 1
    assert not list(tmp_path.rglob("*.nb?"))
