"""How a path of measured postures is flown: the settings of `simulate`, checked before they are told."""

import shlex
from collections.abc import Sequence
from pathlib import Path

import msgspec
import yaml

from skydiver_utc.parameters import ParameterError, Posture, PosturePath, Scenario, load_scenario
from skydiver_utc.verbs.settings import parse_setting

# The range of alpha that the motion is laid over [rad].
ALPHA = (0.0, 2.0)
# What the flight holds the first and the last posture for [s].
_BEFORE_S, _AFTER_S = 1.0, 5.0


def timing(scenario: Scenario, duration_s: float) -> list[str]:
    """Settings that let alpha go through its range in the time that the motion was measured in."""
    needed = [f"duration_s={_BEFORE_S + duration_s + _AFTER_S:g}"]
    rate = (ALPHA[1] - ALPHA[0]) / duration_s
    if rate > scenario.plant.limits.alpha_rate:
        needed.append(f"plant.limits.alpha_rate={rate:g}")
    return needed


def flight(out: Path, start: Path, duration_s: float, nodes: int) -> list[str]:
    """Settings that fly the path in a file open loop, from the posture in another."""
    first, last = ALPHA
    return [
        _setting("name", out.stem),
        _setting("title", f"Measured motion {out.stem}"),
        _setting("pattern", str(out)),
        _setting("posture", str(start)),
        f"plant.limits.alpha=[{first:g}, {last:g}]",
        f"plant.pattern_nodes={nodes}",
        f"initial.alpha={first:g}",
        "initial.bank_deg=0",
        "controller={kind: open_loop}",
        f"reference={{kind: posture, points: [[{_BEFORE_S:g}, {first:g}],"
        f" [{_BEFORE_S + duration_s:g}, {last:g}]]}}",
    ]


def _setting(name: str, text: str) -> str:
    """NAME=TEXT, in quotes where YAML would read something else than the text: 1, on, a: b, a #1."""
    plain = f"{name}={text}"
    if _reads_as(plain, (name, text)):
        return plain
    quoted = yaml.safe_dump(text, default_style='"', allow_unicode=True, width=10**6).strip()
    return f"{name}={quoted}"


def _reads_as(setting: str, meant: tuple[str, str]) -> bool:
    try:
        return parse_setting(setting) == meant
    except ParameterError:
        return False


def flown(scenario_name: str, settings: Sequence[str], path: PosturePath, start: Posture) -> Scenario:
    """The scenario that the command will fly, before the files that it names are written."""
    overrides = dict(map(parse_setting, settings))
    overrides |= {"pattern": msgspec.to_builtins(path), "posture": msgspec.to_builtins(start)}
    return load_scenario(scenario_name, overrides)


def command(scenario_name: str, settings: Sequence[str]) -> str:
    """What to type into a shell."""
    options = [part for setting in settings for part in ("--set", setting)]
    return shlex.join(["skydiver-utc", "simulate", scenario_name, *options])
