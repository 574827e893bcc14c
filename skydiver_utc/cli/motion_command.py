# SPDX-License-Identifier: Apache-2.0
"""The command that flies a path of measured postures."""

import json
import shlex
from collections.abc import Sequence
from pathlib import Path

from skydiver_utc.cli.settings import parse_setting
from skydiver_utc.parameters import (
    Posture,
    PosturePath,
    Scenario,
    SkydiverSettings,
    load_scenario,
)

# The range of alpha that the motion is laid over [rad].
ALPHA = (0.0, 2.0)
# How long the first and the last posture are held [s].
_BEFORE_S, _AFTER_S = 1.0, 5.0


def timing(plant: SkydiverSettings, duration_s: float) -> list[str]:
    """Settings that let alpha go through its range in the time that the motion was measured in."""
    needed = [f"duration_s={_BEFORE_S + duration_s + _AFTER_S:g}"]
    rate = (ALPHA[1] - ALPHA[0]) / duration_s
    if rate > plant.limits.alpha_rate:
        needed.append(f"plant.limits.alpha_rate={rate:g}")
    return needed


def settings_of(out: Path, start: Path, duration_s: float, nodes: int) -> list[str]:
    """Settings that fly the path in a file open loop, from the posture in another."""
    first, last = ALPHA
    return [
        _setting("name", out.stem),
        _setting("title", f"Measured motion {out.stem}"),
        _setting("plant.pattern", str(out)),
        _setting("plant.posture", str(start)),
        f"plant.limits.alpha=[{first:g}, {last:g}]",
        f"plant.pattern_nodes={nodes}",
        f"plant.initial.alpha={first:g}",
        "plant.initial.bank_deg=0",
        "controller={kind: open_loop}",
        f"reference={{kind: points, output: alpha, points: [[{_BEFORE_S:g}, {first:g}],"
        f" [{_BEFORE_S + duration_s:g}, {last:g}]]}}",
    ]


def _setting(name: str, text: str) -> str:
    """NAME="TEXT": without quotes YAML reads some file names as something else than a text."""
    return f"{name}={json.dumps(text, ensure_ascii=False)}"


def scenario_of(scenario: str, settings: Sequence[str], path: PosturePath, start: Posture) -> Scenario:
    """The scenario of the command, before the files that it names are written."""
    overrides = dict(map(parse_setting, settings))
    overrides |= {"plant.pattern": path.as_dict(), "plant.posture": start.as_dict()}
    return load_scenario(scenario, overrides)


def command(scenario: str, settings: Sequence[str]) -> str:
    """The same command for a shell."""
    options = [part for setting in settings for part in ("--set", setting)]
    return shlex.join(["skydiver-utc", "simulate", scenario, *options])
