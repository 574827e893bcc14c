# SPDX-License-Identifier: Apache-2.0
"""A virtual skydiver, the Unscented Transform Controller that flies it, and slots for plants of your own.

`load_scenario` and `simulate` run a scenario in process. Your own plant is a `Plant` with a `Model` of two kernels;
its settings, like those of every slot, are a `SlotSettings`. `UnscentedTransformController.of`
controls a plant that is a Python function; `UnscentedTransformController(UtcSettings(...), plant)` any `Plant`.
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_MODULES = {
    "Controller": "controllers.protocol",
    "Decision": "controllers.protocol",
    "FunctionPlant": "plants.function",
    "Disturbance": "disturbances.protocol",
    "Estimator": "estimators.protocol",
    "Model": "plants.protocol",
    "ParameterError": "errors",
    "Plant": "plants.protocol",
    "Reference": "references.protocol",
    "Run": "loop.run",
    "Scenario": "parameters.scenario",
    "Shape": "plants.protocol",
    "SlotSettings": "parameters.fields",
    "Status": "controllers.protocol",
    "UnscentedTransformController": "controllers.utc.unscented_transform_controller",
    "UtcResult": "controllers.utc.result",
    "UtcSettings": "controllers.utc.settings",
    "kernel": "jit",
    "load_scenario": "parameters.loading",
    "program": "jit",
    "quantity": "parameters.fields",
    "rk4": "plants.integration",
    "runge_kutta": "plants.integration",
    "simulate": "loop.closed_loop",
}
__all__ = list(_MODULES)


def __getattr__(name: str) -> Any:
    """The public names, loaded when they are used: the command line starts without numba."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
