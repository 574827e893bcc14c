"""A linear plant of the user's own, with the tuning of UTC on it, from a YAML file."""

from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np

from skydiver_utc.parameters.fields import Parameters, quantity, text
from skydiver_utc.parameters.loading import config_folder
from skydiver_utc.parameters.yaml_io import ParameterError, read_yaml

Matrix = tuple[tuple[float, ...], ...]
Variances = Annotated[tuple[Annotated[float, msgspec.Meta(gt=0)], ...], msgspec.Meta(min_length=1)]


class LinearPlantParameters(Parameters, frozen=True):
    """x' = A x + B u in continuous time, or x+ = A x + B u of one step; y = C x, the whole state without C."""

    name: str
    description: str
    source: str
    time: Annotated[str, msgspec.Meta(pattern="^(continuous|discrete)$"), text("continuous or discrete")]
    dt_s: Annotated[float, quantity("s", "time step; a continuous plant is held over it", gt=0, le=100)]
    A: Matrix
    B: Matrix
    Qu: Annotated[Variances, text("variance that each control gains per step")]
    P_err: Annotated[Variances, text("variance of each output's tracking error")]
    C: Matrix | None = None
    horizon_steps: Annotated[int, quantity("steps", "prediction horizon N", ge=1, le=500)] = 1
    nonlinearity: Annotated[
        float, quantity("state", "largest size of what is added to the state each step", ge=0)
    ] = 0.0


def linear_plant_names() -> list[str]:
    """Names of the linear plants that come with the package."""
    return sorted(path.stem for path in (config_folder() / "plants").glob("*.yaml"))


def load_linear_plant(name_or_path: str) -> LinearPlantParameters:
    """A name below config/plants or the path of a YAML file; checks that the matrices fit each other."""
    path = Path(name_or_path)
    if not name_or_path.endswith((".yaml", ".yml")):
        path = config_folder() / "plants" / f"{name_or_path}.yaml"
    if not path.is_file():
        known = ", ".join(linear_plant_names())
        raise ParameterError(
            f"there is no linear plant {name_or_path!r}: choose one of {known}, or a YAML file"
        )
    try:
        plant = msgspec.convert(read_yaml(path), LinearPlantParameters)
    except msgspec.ValidationError as error:
        raise ParameterError(f"linear plant {path}: {error}: mend it") from error
    _check_shapes(plant, path)
    return plant


def _check_shapes(plant: LinearPlantParameters, path: Path) -> None:
    n, m = len(plant.A), len(plant.Qu)
    outputs = n if plant.C is None else len(plant.C)
    expected = {"A": (n, n), "B": (n, m)} | ({} if plant.C is None else {"C": (outputs, n)})
    for name, shape in expected.items():
        rows = {len(row) for row in getattr(plant, name)}
        if len(getattr(plant, name)) != shape[0] or rows != {shape[1]}:
            raise ParameterError(
                f"linear plant {path}: {name} must have {shape[0]} rows of {shape[1]} numbers, as A and Qu say"
            )
    if len(plant.P_err) != outputs:
        raise ParameterError(f"linear plant {path}: P_err must have {outputs} numbers, one per output")
    if np.linalg.matrix_rank(np.array(plant.B)) == 0:
        raise ParameterError(f"linear plant {path}: B is zero: give the controls an effect")
