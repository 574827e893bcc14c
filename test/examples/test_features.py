# SPDX-License-Identifier: Apache-2.0
"""Features by example: every option has a file of at most 40 lines, which runs and shows what its page says."""

import inspect
import re
import runpy
from pathlib import Path

import numpy as np
import pytest

from skydiver_utc import FunctionPlant, UnscentedTransformController, UtcSettings

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "examples" / "features"
PAGE = (ROOT / "docs" / "library.md").read_text(encoding="utf-8")
FACTS = {
    "accuracy": lambda x: x["accurate"][0] < x["calm"][0] and x["accurate"][1] > 1.5 * x["calm"][1],
    "after_reference": lambda x: x["result"].control[0] == -0.5,
    "aim": lambda x: x["tangent"] < 0.25 * x["end_point"],
    "angles": lambda x: abs(x["held"] - 3.3) < 0.01 and abs(x["lost"] - 3.3) > 3.0,
    "another_dt": lambda x: (x["converted"].horizon_steps, x["converted"].Qu_ratio) == (10, 0.2),
    "between_steps": lambda x: x["result"].control[1] == 0.0 and x["explanation"].moves[0, 0] > 0.05,
    "bounds": lambda x: (
        min(x["controls"]) == -1.0 and max(x["controls"]) == 2.0 and x["steepest"] < 4.0 + 1e-9
    ),
    "curved": lambda x: abs(x["exact"] - 0.25) < 1e-6 and abs(x["mean"] - 0.25) > 3e-4,
    "dynamics": lambda x: x["lag"][0] < 0.5 * x["held"][0] and x["lag"][1] < 1e-3,
    "forgetting": lambda x: x["forgotten"][0] == pytest.approx(0.2, rel=0.2) and x["kept"][0] > 2.0,
    "gain": lambda x: list(x["found"].values()) == sorted(x["found"].values(), reverse=True),
    "horizon": lambda x: np.abs(np.subtract(list(x["found"].values()), [0.0, 0.5, 0.5])).max() < 1e-3,
    "jitted": lambda x: abs(x["state"][0] - 1.0) < 1e-3,
    "names": lambda x: abs(x["state"][0] - 1.0) < 1e-3 and "std_force" in x["controller"].telemetry_names,
    "noise_of_a_step": lambda x: x["raised"] < 0.9 * x["usual"],
    "nominal": lambda x: abs(x["named"][1]) < 0.01 and abs(sum(x["named"]) - 1.0) < 0.01 < abs(x["free"][1]),
    "offset_free": lambda x: abs(x["offset_free"] - 2.0) < 1e-4 and abs(x["plain"] - 2.0) > 0.05,
    "output": lambda x: x["with_speed"] < 1e-3 < 0.1 < x["alone"],
    "plant": lambda x: np.ptp(x["controls"]) < 1e-6,
    "preview": lambda x: x["ahead"] < 0.5 * x["one"],
    "result": lambda x: x["result"].lost == 1 and "empty" in x["result"].cause,
    "scenario_blocks": lambda x: x["dynamics"] == "alpha" and x["run"].outcome.value == "completed",
    "warm_start": lambda x: x["difference"] < 1e-12,
}


@pytest.mark.parametrize("name", FACTS)
def test_it_shows_what_it_says(name, capsys):
    path = FOLDER / f"{name}.py"
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 40
    assert FACTS[name](runpy.run_path(str(path)))
    assert capsys.readouterr().out


def test_the_page_links_every_file_and_has_every_option():
    """One row each; `settings` are the fields of `UtcSettings`, and `kind` is a word of scenarios."""
    linked = re.findall(r"\]\(\.\./examples/features/(\w+)\.py\)", PAGE)
    assert set(linked) == set(FACTS) == {path.stem for path in FOLDER.glob("*.py")}
    options = {*inspect.signature(UnscentedTransformController.of).parameters, *UtcSettings.model_fields}
    options |= set(inspect.signature(FunctionPlant).parameters)
    rows = [line.split("|")[1] for line in PAGE.splitlines() if line.startswith("| ")]
    named = {word for row in rows for word in re.findall(r"`(\w+)`", row)}
    assert options - {"settings", "kind"} <= named
