"""A linear plant of the user's own, with the tuning of UTC on it, from a YAML file."""

from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray

from skydiver_utc.parameters.fields import Parameters, quantity, text
from skydiver_utc.parameters.loading import config_folder
from skydiver_utc.parameters.yaml_io import ParameterError, read_yaml

Matrix = tuple[tuple[float, ...], ...]
Variances = Annotated[tuple[Annotated[float, msgspec.Meta(gt=0)], ...], msgspec.Meta(min_length=1)]


class LinearPlantParameters(Parameters, frozen=True):
    """x' = A x + B u in continuous time, or x+ = A x + B u of one step; y = C x, the whole state without C."""

    name: str
    description: str
    time: Annotated[str, msgspec.Meta(pattern="^(continuous|discrete)$"), text("continuous or discrete")]
    dt_s: Annotated[float, quantity("s", "time step; a continuous plant is held over it", gt=0, le=100)]
    A: Matrix
    B: Matrix
    Qu: Annotated[
        tuple[float | tuple[float, ...], ...],
        text(
            "what the controls' covariance gains per step: a variance for each control, or the whole matrix"
        ),
    ]
    P_err: Annotated[Variances, text("variance of each output's tracking error")]
    source: Annotated[str, text("where the numbers come from")] = ""
    C: Matrix | None = None
    horizon_steps: Annotated[int, quantity("steps", "prediction horizon N", ge=1, le=500)] = 1
    nonlinearity: Annotated[
        float, quantity("state", "largest size of what is added to the state each step", ge=0)
    ] = 0.0

    @property
    def process_noise(self) -> NDArray[np.float64]:
        """Qu as a matrix (m, m)."""
        given = np.array(self.Qu, dtype=float)
        return np.diag(given) if given.ndim == 1 else given


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
        message = str(error).replace("`float`", "a number").replace("`float | array`", "a number or a row")
        fault, _, place = message.partition(" - at `$.")
        name = f"{place.rstrip('`')}: " if place else ""
        raise ParameterError(f"linear plant {path}: {name}{fault[:1].lower()}{fault[1:]}: mend it") from error
    _check_process_noise(plant, path)
    _check_shapes(plant, path)
    return plant


def _check_process_noise(plant: LinearPlantParameters, path: Path) -> None:
    m = len(plant.Qu)
    rows = [row for row in plant.Qu if isinstance(row, tuple)]
    if not m or (rows and [len(row) for row in rows] != [m] * m):
        raise ParameterError(
            f"linear plant {path}: Qu must have one variance for each control, or as many rows of as many numbers"
        )
    Qu = plant.process_noise
    if not (np.array_equal(Qu, Qu.T) and (np.diag(Qu) > 0.0).all() and np.linalg.eigvalsh(Qu)[0] > 0.0):
        raise ParameterError(
            f"linear plant {path}: Qu is no covariance: give each control a variance above zero, and two controls"
            " one covariance on both sides of the diagonal, smaller than the root of their variances' product"
        )


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
