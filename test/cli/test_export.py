# SPDX-License-Identifier: Apache-2.0
"""A recorded run for other programs, and pages of recorded runs."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke, refused
from recordings import write_run
from runs import cart, random_run

from skydiver_utc.loop.run import Run
from skydiver_utc.parameters import from_yaml


@pytest.fixture(scope="module")
def run() -> Run:
    return random_run(cart())


@pytest.fixture(scope="module")
def folder(run: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("export") / "run", run)


def test_tables_hold_every_number_of_the_run(tmp_path: Path) -> None:
    parquet, run = pytest.importorskip("pyarrow.parquet"), random_run()
    folder = write_run(tmp_path / "run", run)
    made = invoke("export", folder, "--csv", "--npz", "--parquet", "--out", tmp_path)
    assert made.exit_code == 0
    assert made.stdout.split() == [str(tmp_path / f"run.{form}") for form in ("csv", "npz", "parquet")]
    csv = np.genfromtxt(tmp_path / "run.csv", delimiter=",", names=True, deletechars="", replace_space="_")
    npz, columns = np.load(tmp_path / "run.npz"), parquet.read_table(tmp_path / "run.parquet")
    wanted = {
        "time_s": run.time_s,
        "state/wz": run.states[:, 12],
        "command/alpha": np.append(run.commands[:, 3], np.nan),
        "applied_command/alpha": np.append(run.applied[:, 3], np.nan),
        "reference/yaw_rate": run.reference[:, 0],
        "telemetry/innovation": np.append(run.telemetry[:, 0], np.nan),
    }
    for name, values in wanted.items():
        for found in (csv[name], npz[name], columns[name].to_numpy()):
            assert np.array_equal(found, values, equal_nan=True), name
    assert from_yaml(str(npz["scenario"])) == run.scenario


def test_figures_in_each_form(folder: Path) -> None:
    assert invoke("export", folder, "--png", "--svg", "--pdf").exit_code == 0
    begins = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}
    first = {form: (folder / f"tracking.{form}").read_bytes() for form in begins}
    assert all(content.startswith(begins[form]) for form, content in first.items())
    assert invoke("export", folder, "--svg").exit_code == 0
    assert (folder / "tracking.svg").read_bytes() == first["svg"]


def test_what_cannot_be_exported_is_one_sentence(folder: Path, tmp_path: Path) -> None:
    for arguments in ((folder,), (tmp_path / "none", "--csv", "--out", tmp_path / "new")):
        refused("export", *arguments)
        assert not list(tmp_path.iterdir())


def test_pages_of_one_run_and_of_two(folder: Path, tmp_path: Path) -> None:
    result = invoke("report", folder)
    assert (result.exit_code, result.stdout) == (0, f"{folder / 'report.html'}\n")
    both = invoke("report", folder, folder, "--out", tmp_path / "both.html")
    assert both.exit_code == 0
    assert (tmp_path / "both.html").read_text(encoding="utf-8").count("with all settings</summary>") == 2


def test_a_page_needs_no_matplotlib_and_commands_that_show_no_body_no_viewer() -> None:
    code = (
        "import sys, skydiver_utc.view.report\n"
        "assert 'matplotlib' not in sys.modules\n"
        "import skydiver_utc.cli.simulate\n"
        "assert 'viser' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
