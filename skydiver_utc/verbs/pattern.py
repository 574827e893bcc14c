"""``skydiver-utc pattern``: a neutral posture and movement patterns, made again from the parameters."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from skydiver_utc.body.posture import joint_rows
from skydiver_utc.parameters import MovementPattern, Posture
from skydiver_utc.parameters.yaml_io import write_yaml
from skydiver_utc.plant.pattern_design import design_pattern
from skydiver_utc.plant.pattern_kinds import DEFAULT_KIND, PATTERN_KINDS
from skydiver_utc.plant.trim import straight_fall
from skydiver_utc.verbs.errors import VerbError
from skydiver_utc.verbs.settings import load

# Decimals of a degree, and of a component: rounding leaves less than 1e-6 of acceleration.
_DECIMALS = 9


def neutral(scenario_name: str, settings: Sequence[str], out: Path | None) -> None:
    """Write the straight fall nearest to the scenario's posture at the scenario's pitch."""
    scenario = load(scenario_name, settings)
    start, subject = scenario.posture, scenario.subject
    trim = straight_fall(scenario, start, scenario.initial.pitch_deg)
    posture = Posture(
        name=_name(out, "neutral"),
        description=(
            f"Belly to earth with the head low; subject {subject.name} falls straight down at {trim.speed:.2f} m/s"
        ),
        source=(
            f"Straight fall nearest to posture {start.name} at a pitch of {scenario.initial.pitch_deg:g} deg, by"
            f" skydiver-utc pattern neutral: segments {subject.segments.name}, suit {subject.suit.name},"
            f" joint limits {subject.joint_limits.name}"
        ),
        joint_angles_deg=joint_rows(np.rad2deg(trim.angles).round(_DECIMALS)),
    )
    _write(posture, out)


def design(scenario_name: str, settings: Sequence[str], kind_name: str, seed: int, out: Path | None) -> None:
    """Write a pattern of a kind for the scenario's posture, which must fall straight."""
    scenario, kind = load(scenario_name, settings), PATTERN_KINDS[kind_name]
    trim = straight_fall(scenario, scenario.posture, scenario.initial.pitch_deg)
    direction = design_pattern(kind, scenario, trim, np.random.default_rng(seed))
    option = "" if kind_name == DEFAULT_KIND else f" --kind {kind_name}"
    pattern = MovementPattern(
        name=_name(out, kind.name),
        description=kind.description,
        source=(
            f"Designed by skydiver-utc pattern design{option} for posture {scenario.posture.name}, subject"
            f" {scenario.subject.name}, suit {scenario.subject.suit.name}, seed {seed}: {kind.aim}, within the"
            f" joint limits {scenario.subject.joint_limits.name}"
        ),
        components=joint_rows(direction.round(_DECIMALS)),
    )
    _write(pattern, out)


def _name(out: Path | None, default: str) -> str:
    if out is None:
        return default
    if out.suffix != ".yaml" or not out.parent.is_dir():
        raise VerbError(f"--out {out} must end in .yaml and lie in a folder that exists: choose another")
    return out.stem


def _write(parameters: Posture | MovementPattern, out: Path | None) -> None:
    content: dict[str, Any] = msgspec.to_builtins(parameters)
    if out is None:
        print(write_yaml(content), end="")
    else:
        out.write_text(write_yaml(content), encoding="utf-8")
