# SPDX-License-Identifier: Apache-2.0
"""The kinds of each slot of a scenario: one line a kind.

A kind is made by a class, as `Class(settings, ...)`. A class of the user's own is named as `module:Class`; its
settings are the nested class `Class.Settings`. The module is looked for on the Python path, in the folder of the
scenario file and in the current folder. A text of a topic or a recording names only modules that import this package.
"""

import importlib
import sys
from collections.abc import Mapping
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any, NamedTuple

from skydiver_utc.errors import OwnClassError, ParameterError, hint
from skydiver_utc.parameters.fields import SlotSettings


class Kind(NamedTuple):
    """The class of a kind, and its settings where not nested in it; loaded when needed, from below skydiver_utc."""

    factory: str
    settings: str = ""


# References that are functions of time: the settings hold the formula.
_CURVE = "references.curve:CurveReference"
_CURVES = {
    "step": "profiles:Step",
    "ramp": "profiles:Ramp",
    "trapezoid": "profiles:Trapezoid",
    "doublet": "profiles:Doublet",
    "sine": "profiles:Sine",
    "multi_sine": "profiles:MultiSine",
    "chirp": "profiles:Chirp",
    "random": "profiles:Random",
    "rotation": "profiles:Rotation",
    "constant": "tables:Constant",
    "points": "tables:Points",
    "csv": "tables:Csv",
}

KINDS: Mapping[str, Mapping[str, Kind]] = {
    "plant": {
        "skydiver": Kind("plants.skydiver.skydiver:SkydiverPlant", "parameters.skydiver:SkydiverSettings"),
        "linear": Kind("plants.linear:LinearPlant"),
    },
    "reference": {
        **{kind: Kind(_CURVE, f"references.{place}") for kind, place in _CURVES.items()},
        "combined": Kind("references.combined:Combined"),
        "live": Kind("references.live:Live"),
    },
    "controller": {
        "open_loop": Kind("controllers.open_loop:OpenLoop", "controllers.settings:OpenLoopSettings"),
        "pose": Kind("controllers.pose:PoseController", "controllers.settings:PoseSettings"),
        "utc": Kind(
            "controllers.utc.unscented_transform_controller:UnscentedTransformController",
            "controllers.utc.settings:UtcSettings",
        ),
        "lqr": Kind(
            "controllers.linear_quadratic:LinearQuadraticController", "controllers.settings:LqrSettings"
        ),
        "gauss_newton": Kind(
            "controllers.gauss_newton:GaussNewtonController", "controllers.settings:GaussNewtonSettings"
        ),
        "mppi": Kind("controllers.path_integral:PathIntegralController", "controllers.settings:MppiSettings"),
    },
    "estimator": {
        "true_state": Kind("estimators.true_state:TrueState"),
        "unscented_kalman_filter": Kind(
            "estimators.unscented_kalman_filter:UnscentedKalmanFilter",
            "estimators.settings:UnscentedKalmanFilterSettings",
        ),
    },
    "disturbance": {
        "steady_wind": Kind("disturbances.wind:SteadyWind"),
        "gust": Kind("disturbances.wind:Gust"),
        "dryden": Kind("disturbances.dryden:DrydenTurbulence"),
        "measurement_error": Kind("disturbances.measurement_error:MeasurementError"),
        "transmission": Kind("disturbances.transmission:Transmission"),
    },
}


def settings_class(slot: str, kind: str) -> type[SlotSettings]:
    """The class of a kind's settings; `ParameterError` for an unknown kind, as in `factory`."""
    known = KINDS[slot].get(kind)
    own = known.settings if known else ""
    found = _load(f"skydiver_utc.{own}") if own else getattr(factory(slot, kind), "Settings", None)
    if not (isinstance(found, type) and issubclass(found, SlotSettings)):
        raise ParameterError(f"{kind} has no settings: write a class Settings(SlotSettings) inside it")
    return found


def factory(slot: str, kind: str) -> Any:
    """The class, or function, that makes what stands in a slot."""
    if kind in KINDS[slot]:
        return _load(f"skydiver_utc.{KINDS[slot][kind].factory}")
    module, colon, name = kind.partition(":")
    if not colon:
        known = list(KINDS[slot])
        advice = hint(kind, known, f"choose one of {', '.join(known) or 'none'}")
        raise ParameterError(
            f"there is no {slot} {kind!r}, {advice}, or name a class of your own as module:Class"
        )
    search_modules_in(Path.cwd())
    try:
        return _load(kind)
    except ModuleNotFoundError as error:
        raise _missing(error.name or module) from error
    except SyntaxError as error:
        raise OwnClassError(f"the module {module} has a syntax error: {error}") from error
    except AttributeError as error:
        raise OwnClassError(
            f"the module {module} in {getattr(sys.modules.get(module), '__file__', None)} has no {name}: write the name"
            " of its class, or let Python find the module that has it first"
        ) from error


def search_modules_in(folder: Path) -> None:
    """Let `module:Class` be found in a folder, after the Python path."""
    if (place := str(folder.resolve())) not in sys.path:
        sys.path.append(place)


def refuse_other_code(kind: str) -> None:
    """Refuse a `module:Class` whose module is neither imported nor written for this package; nothing is run."""
    module = kind.partition(":")[0]
    if module in sys.modules:
        return
    search_modules_in(Path.cwd())
    folders: list[str] | None = None
    origin = ""
    for part in module.split("."):
        spec = PathFinder.find_spec(part, folders)
        if spec is None:
            raise _missing(module)
        folders, origin = spec.submodule_search_locations or [], str(spec.origin)
    # A folder without any module has no file.
    if not Path(origin).is_file() or b"skydiver_utc" not in Path(origin).read_bytes():
        raise OwnClassError(
            f"the class {kind} is not imported, because its module in {origin} does not import skydiver_utc, and a"
            " topic or a recording names no other code: import skydiver_utc there, if it is the module that is meant"
        )


def _missing(module: str) -> OwnClassError:
    return OwnClassError(
        f"there is no module {module}: put {module}.py into the current folder, beside the scenario file that is given,"
        " or on the PYTHONPATH"
    )


def _load(place: str) -> Any:
    """The object at `module:Name.Nested`."""
    module, _, name = place.partition(":")
    found = importlib.import_module(module)
    for part in name.split("."):
        found = getattr(found, part)
    return found
