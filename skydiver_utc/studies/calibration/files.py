# SPDX-License-Identifier: Apache-2.0
"""A calibrated skydiver as YAML files with their source, and the report of its calibration."""

from contextlib import suppress
from pathlib import Path
from typing import Any

from skydiver_utc.parameters import ParameterError, Scenario
from skydiver_utc.parameters.files import write_file
from skydiver_utc.parameters.loading import named_path
from skydiver_utc.parameters.yaml_io import read_yaml, write_yaml
from skydiver_utc.studies.calibration.candidate import build_candidate, numbers_of, skydiver_of
from skydiver_utc.studies.calibration.evaluation import Evaluation, labels
from skydiver_utc.studies.calibration.settings import Calibration


def write_skydiver(
    folder: Path, calibration: Calibration, start: Scenario, best: Evaluation, command: str
) -> Path:
    """Write suit, subject, posture, pattern and the skydiver that names them; returns the skydiver's path."""
    skydiver = skydiver_of(build_candidate(calibration, start, best.numbers))
    subject, own = skydiver["subject"], start.plant.subject.suit
    met = f"{sum(best.met)} of {len(best.met)} targets met"
    suit = subject["suit"]
    suit["source"] = f"Calibrated by {command} ({met}) from suit {own.name}. That one's source: {own.source}"
    for field in ("segments", "joint_limits"):
        subject[field] = _name_or_content(field, subject[field])
    files = {"suit": suit, "subject": subject, "posture": skydiver["posture"], "pattern": skydiver["pattern"]}
    subject["suit"] = "suit.yaml"
    for name, content in files.items():
        write_file(folder / f"{name}.yaml", write_yaml(content))
    block = skydiver | {name: f"{name}.yaml" for name in ("subject", "posture", "pattern")}
    before = numbers_of(calibration, start)
    changes = [f"#   {name}: {value:g}, was {before[name]:g}" for name, value in best.numbers.items()]
    head = [f"# Calibrated by {command}: {met}.", *changes]
    path = folder / "skydiver.yaml"
    write_file(path, "\n".join(head) + "\n" + write_yaml(block))
    return path


def report(calibration: Calibration, best: Evaluation, seed: int, tried: int) -> dict[str, Any]:
    """The best skydiver beside the targets, plain data."""
    targets = [
        bar.as_dict() | {"stage": stage, "measure": measure, "found": found, "met": met}
        for (stage, measure, bar), found, met in zip(labels(calibration), best.found, best.met, strict=True)
    ]
    return {
        "calibration": calibration.name,
        "seed": seed,
        "evaluations": tried,
        "cost": best.cost,
        "error": best.error,
        "numbers": best.numbers,
        "targets": targets,
    }


def _name_or_content(field: str, content: dict[str, Any]) -> object:
    """The name of the file below ``config/`` with this content, else the content."""
    with suppress(ParameterError):
        if read_yaml(named_path(field, content["name"])) == content:
            return content["name"]
    return content
