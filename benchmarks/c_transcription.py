# SPDX-License-Identifier: Apache-2.0
"""The C transcription of one UTC step (c/utc_step.c), compiled here and called through ctypes."""

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from skydiver_utc.arrays import Array
from skydiver_utc.controllers.utc.coupling import CouplingSchedule
from skydiver_utc.controllers.utc.settings import UtcSettings, matrix
from skydiver_utc.parameters import Scenario
from skydiver_utc.plants.skydiver.model import PlantModel
from skydiver_utc.plants.skydiver.skydiver import SkydiverPlant

Address = ctypes.c_void_p

SOURCE = Path(__file__).parent / "c" / "utc_step.c"
# The relaxations of skydiver_utc.jit: contraction, reassociation, unsigned zeros. The last two flags give up what
# numba does not have: floating-point traps and errno.
FLAGS = (
    "-O3",
    "-march=native",
    "-ffp-contract=fast",
    "-fassociative-math",
    "-fno-signed-zeros",
    "-fno-trapping-math",
    "-fno-math-errno",
)
_FOUR = ctypes.c_double * 4
_POINTER = ctypes.POINTER(ctypes.c_double)


class _Plant(ctypes.Structure):
    _fields_ = (
        ("table", _POINTER),
        ("nodes", ctypes.c_long),
        *(
            (name, ctypes.c_double)
            for name in (
                "alpha_first",
                "nodes_per_rad",
                "mass",
                "gravity",
                "half_density",
                "damping_roll",
                "damping_pitch",
                "damping_volume",
                "hand_force",
                "hand_arm",
            )
        ),
        ("minimum", _FOUR),
        ("maximum", _FOUR),
        ("alpha_slew", ctypes.c_double),
        ("dt", ctypes.c_double),
    )


class _Utc(ctypes.Structure):
    _fields_ = (("U", _FOUR), ("Pu", _FOUR * 4), ("predicted", ctypes.c_double))


def compiler() -> str | None:
    """Path of the C compiler, or None."""
    return shutil.which("cc")


def compile_library(source: Path, library: Path, flags: tuple[str, ...] = FLAGS) -> None:
    """A shared library from one file of C."""
    subprocess.run(["cc", *flags, "-shared", "-fPIC", "-o", library, source, "-lm"], check=True)


@contextmanager
def library(flags: tuple[str, ...] = FLAGS) -> Iterator[ctypes.CDLL]:
    """utc_step.c compiled by cc, loaded, and removed at the end."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "utc_step.so"
        compile_library(SOURCE, path, flags)
        yield _declared(ctypes.CDLL(str(path)))


def _declared(loaded: ctypes.CDLL) -> ctypes.CDLL:
    double, pointer = ctypes.c_double, ctypes.c_void_p
    loaded.utc_step.argtypes = [pointer] * 3 + [double, pointer] + [double] * 3 + [ctypes.c_long]
    loaded.utc_step.restype = None
    return loaded


def address(array: Array) -> Address:
    """Where C finds an array in C order; holds the array as long as it is held itself."""
    return array.ctypes.data_as(Address)


class CUtc:
    """UTC of a scenario in C, with the coupling schedule of the package prepared beforehand.

    `prepare(profile, steps)` lays out Qu and the reference of every step; `step` is one call of C, with
    addresses made beforehand (`address`).
    """

    def __init__(self, loaded: ctypes.CDLL, scenario: Scenario) -> None:
        parameters = scenario.controller
        if (
            not isinstance(parameters, UtcSettings)
            or parameters.dynamics is not None
            or parameters.coupling is None
            or parameters.coupling.alpha_sign != "reference"
        ):
            raise ValueError("c/utc_step.c transcribes UTC with unknown dynamics of alpha and eq:s14 only")
        self._library, self._parameters = loaded, parameters
        plant = SkydiverPlant(scenario.plant, scenario.dt_s)
        self._model = plant.constants
        self._plant = _plant(self._model)
        self._utc = _Utc()
        self._start = plant.initial_control()
        self._dt = self._model.dt
        self._addresses = (ctypes.addressof(self._plant), ctypes.addressof(self._utc))

    def prepare(self, profile: Array, steps: int) -> None:
        """Start at step 0 of a reference profile [rad/s] that reaches beyond the last step by the preview."""
        parameters = self._parameters
        names = SkydiverPlant.control_names
        schedule = CouplingSchedule(
            parameters.coupling, matrix("Pu", parameters.Pu, names), names, parameters.Qu_ratio, self._dt
        )
        reach = parameters.preview_steps(self._dt) + 1
        profile = np.ascontiguousarray(profile.reshape(len(profile)))
        covariance = schedule.initial_covariance(profile[:reach])
        Qu = np.array([schedule.process_noise(profile[k : k + reach], self._start) for k in range(steps)])
        self._references = profile[parameters.horizon_steps :].tolist()
        self._utc.U = _FOUR(*self._start)
        for row, values in zip(self._utc.Pu, covariance, strict=True):
            row[:] = list(values)
        self._Qu = [address(matrix) for matrix in Qu]

    def step(self, k: int, state: Address) -> None:
        """Step k at a state (13,)."""
        p = self._parameters
        plant, utc = self._addresses
        self._library.utc_step(
            plant, utc, state, self._references[k], self._Qu[k], p.P_err, p.W0, p.covariance_floor,
            p.horizon_steps,
        )  # fmt: skip

    @property
    def control(self) -> Array:
        """U (4,)."""
        return np.array(self._utc.U)

    @property
    def covariance(self) -> Array:
        """Pu (4, 4)."""
        return np.array([list(row) for row in self._utc.Pu])

    @property
    def predicted(self) -> float:
        """Yaw rate predicted for the horizon [rad/s]."""
        return float(self._utc.predicted)


def _plant(model: PlantModel) -> _Plant:
    values: dict[str, Any] = {
        name: getattr(model, name) for name, _ in _Plant._fields_ if hasattr(model, name)
    }
    return _Plant(
        table=model.geometry.ctypes.data_as(_POINTER),
        nodes=len(model.geometry),
        minimum=_FOUR(*model.control_min),
        maximum=_FOUR(*model.control_max),
        **values,
    )
