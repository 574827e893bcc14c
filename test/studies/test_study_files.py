# SPDX-License-Identifier: Apache-2.0
"""Studies from a file: what they refuse, that runs depend on their number alone, and that no finished run is lost."""

import csv
import json
import os
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from child_processes import PATIENCE_S, children, wait_for_end, wait_until
from command_line import invoke, start
from matplotlib.image import imread
from runs import CART
from scipy.stats import binomtest, spearmanr

from skydiver_utc.parameters import ParameterError
from skydiver_utc.parameters.loading import config_folder
from skydiver_utc.parameters.yaml_io import write_yaml
from skydiver_utc.studies.design import Design
from skydiver_utc.studies.flights import Plan
from skydiver_utc.studies.intervals import median_interval, share_interval
from skydiver_utc.studies.study import Study, Variation, load_study
from skydiver_utc.studies.study_report import borne

TRAP = """
from skydiver_utc.disturbances.protocol import Disturbance
from skydiver_utc.parameters import SlotSettings


class Trap(Disturbance):
    class Settings(SlotSettings):
        above: float

    def __init__(self, settings, plant, dt_s, seed):
        self.above = settings.above

    def state(self, k, state):
        if self.above > 0.8:
            raise ZeroDivisionError("the trap is shut")
        return state
"""


def content(folder: Path, **changes: Any) -> dict[str, Any]:
    """A study of the cart, which is pushed away from another place in each run."""
    flown = CART.replace("open_loop", "lqr")
    (folder / "cart.yaml").write_text(flown, encoding="utf-8")
    return {
        "name": "carts",
        "seed": 5,
        "runs": 6,
        "cases": {
            "light": {"scenario": str(folder / "cart.yaml")},
            "heavy": {"scenario": str(folder / "cart.yaml"), "set": {"plant.B.1.0": 0.5}},
        },
        "vary": {"start": {"settings": ["plant.initial.0"], "unit": "m", "uniform": [0.0, 4.0]}},
        "success": {"outputs.place.rmse": {"at_most": 1.0}},
        "metrics": ["outputs.place.rmse", "control_effort"],
    } | changes


def study_file(folder: Path, **changes: Any) -> Path:
    """The same as a file."""
    path = folder / "carts.yaml"
    path.write_text(write_yaml(content(folder, **changes)), encoding="utf-8")
    return path


def varied(setting: str, **distribution: Any) -> dict[str, Any]:
    """Changes of `content`: another setting varies."""
    return {"vary": {"start": {"settings": [setting], **distribution}}}


def rows(folder: Path) -> dict[int, tuple[Any, ...]]:
    """The ledger's rows without their CPU time, by number."""
    connection = sqlite3.connect(folder / "ledger.sqlite")
    found = connection.execute("select number, case_name, sample, outcome, metrics, sentence from runs")
    return {row[0]: row[1:] for row in found}


class TestDistributions:
    @pytest.mark.parametrize(
        ("distribution", "middle"),
        [
            ({"uniform": [2.0, 4.0]}, 3.0),
            ({"log_uniform": [0.25, 4.0]}, 1.0),
            ({"normal": [5.0, 2.0]}, 5.0),
            ({"choice": ["a", "b", "c"]}, "b"),
            ({"grid": [1, 2, 3]}, 2),
        ],
    )
    def test_the_middle_is_the_median(self, distribution: dict[str, Any], middle: Any) -> None:
        assert Variation.model_validate({"settings": ["a"], **distribution}).at(0.5) == pytest.approx(middle)

    def test_random_runs_draw_all_values_from_seed_and_number(self, tmp_path: Path) -> None:
        both = {
            "start": {"settings": ["plant.initial.0"], "normal": [1.0, 0.5]},
            "speed": {"settings": ["plant.initial.1"], "uniform": [-1.0, 1.0]},
        }
        few, many = (
            Design(Study.model_validate(content(tmp_path, vary=both, runs=runs))) for runs in (3, 400)
        )
        assert [few.sample(n) for n in few.numbers()] == [many.sample(n) for n in range(6)]
        assert many.sample(6) == many.sample(7)  # the two cases meet the same sample
        drawn = np.array([list(many.sample(n).values.values()) for n in range(0, 800, 2)])
        np.testing.assert_allclose(drawn.mean(axis=0), [1.0, 0.0], atol=0.15)
        np.testing.assert_allclose(drawn.std(axis=0), [0.5, 3.0**-0.5], atol=0.07)

    def test_one_by_one_varies_one_and_a_grid_goes_through_its_values(self, tmp_path: Path) -> None:
        both = {
            "start": {"settings": ["plant.initial.0"], "grid": [0.0, 1.0]},
            "speed": {"settings": ["plant.initial.1"], "grid": [5.0, 6.0, 7.0]},
        }
        alone = Design(Study.model_validate(content(tmp_path, vary=both, runs=3, sampler="one_by_one")))
        found = [alone.sample(n).values for n in alone.numbers() if n % 2 == 0]
        assert found[::2] == [{"start": 0.0}, {"start": 1.0}, {"start": 0.0}]
        assert found[1::2] == [{"speed": 5.0}, {"speed": 6.0}, {"speed": 7.0}]
        together = Design(Study.model_validate(content(tmp_path, vary=both, runs=6)))
        pairs = {tuple(together.sample(n).values.values()) for n in together.numbers()}
        assert len(pairs) == 6

    def test_a_factor_is_on_the_scenarios_own_number(self, tmp_path: Path) -> None:
        force = varied("plant.B.1.0", times=True, choice=[3.0])
        plan = Plan(Study.model_validate(content(tmp_path, **force)))
        assert [plan.scenario(n).plant.B[1][0] for n in (0, 1)] == [6.0, 1.5]


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"runz": 3}, "runz"),
        (varied("plant.initial.0"), "uniform"),
        (varied("plant.initial.7", uniform=[0.0, 1.0]), "plant.initial.7"),
        (varied("plant.mass", uniform=[0.0, 1.0]), "plant.mass"),
        (varied("dt_s", uniform=[0.01, 5.0]), "dt_s"),
        (varied("plant.kind", times=True, uniform=[0.0, 1.0]), "plant.kind"),
        (varied("plant.initial.0", grid=[0, "far", 1, 2, 3]), "plant.initial.0"),
        ({"cases": {"light": {"scenario": "no_such"}}}, "no_such"),
        ({"metrics": ["outputs.place.rmse", "beauty"]}, "beauty"),
        ({"success": {"beauty": {"at_most": 1.0}}}, "beauty"),
        ({"success": {"reason": {"at_most": 1.0}}, "metrics": ["reason"]}, "reason"),
        ({"sampler": "sobol", "cases": {"light": {"scenario": "x", "runs": 2}}}, "sobol"),
        (varied("plant.initial.0", grid=[0, 1]) | {"sampler": "sobol"}, "grid"),
    ],
)
def test_a_bad_study_is_refused_before_anything_starts(
    tmp_path: Path, changes: dict[str, Any], word: str
) -> None:
    result = invoke("study", "run", study_file(tmp_path, **changes), "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert word in result.stderr
    assert not (tmp_path / "out").exists()


def test_the_studies_of_the_package_can_be_flown_and_no_other() -> None:
    with pytest.raises(ParameterError, match="no_such_study"):
        load_study("no_such_study")
    names = sorted(path.stem for path in (config_folder() / "studies").glob("*.yaml"))
    assert names
    for name in names:
        study = load_study(name)
        assert study.name == name
        plan = Plan(study)
        for number in range(len(study.cases)):
            assert plan.scenario(number).duration_s == 20.0


def flown(*arguments: object, exit_code: int = 0) -> Any:
    """`study` with these arguments."""
    alone = ("--workers", 1) if arguments[0] == "run" else ()
    result = invoke("study", *arguments, *alone)
    assert result.exit_code == exit_code, result.output
    assert "Traceback" not in result.output
    return result


class TestRuns:
    def test_a_study_is_resumed_reported_and_shown(self, tmp_path: Path) -> None:
        out = tmp_path / "out"
        flown("run", study_file(tmp_path, runs=2), "--out", out)
        first = rows(out)
        flown("run", study_file(tmp_path), "--out", out)
        found = rows(out)
        assert list(found) == list(range(12))
        assert first.items() <= found.items()
        report = (out / "report.md").read_text(encoding="utf-8")
        samples = ((json.loads(row[1]), json.loads(row[3])) for row in found.values())
        pairs = [(sample["start"], kept["outputs.place.rmse"]) for sample, kept in samples]
        correlation = spearmanr(*zip(*pairs[::2], strict=True)).statistic
        for words in ("| light | 6 |", "| heavy | 6 |", f"| light | start | {correlation:.2f} |"):
            assert words in report
        assert imread(out / "maps.png").shape[1] > 600
        table = csv.DictReader((out / "runs.csv").read_text(encoding="utf-8").splitlines())
        assert [float(row["start"]) for row in table] == [start for start, _ in pairs]

        result = flown("run", study_file(tmp_path, seed=6), "--out", out, exit_code=2)
        assert "ledger" in result.stderr
        assert rows(out) == found

        path = study_file(tmp_path)
        shown = json.loads(flown("show", path, 3, "--out", out, "--json").stdout)
        assert shown["outputs"]["place"]["rmse"] == json.loads(found[3][3])["outputs.place.rmse"]
        again = json.loads(invoke("simulate", out / "run_3.yaml", "--json", "--quiet").stdout)
        assert again["outputs"] == shown["outputs"]
        flown("show", path, 99, "--out", out, exit_code=2)
        connection = sqlite3.connect(out / "ledger.sqlite")
        connection.execute("update runs set metrics = '{}' where number = 3")
        connection.commit()
        flown("show", path, 3, "--out", out, "--json", exit_code=1)

    def test_it_stops_when_the_interval_is_narrow(self, tmp_path: Path) -> None:
        flown("run", study_file(tmp_path, runs=500), "--out", tmp_path, "--until", 0.5)
        count = len(rows(tmp_path))
        assert 8 <= count < 60
        text = (tmp_path / "report.md").read_text(encoding="utf-8")
        assert int(text.split(" runs,")[0].split()[-1]) <= count

    def test_a_run_that_raises_is_a_row_and_the_exit_code_says_so(self, tmp_path: Path) -> None:
        (tmp_path / "own_trap.py").write_text(TRAP, encoding="utf-8")
        path = study_file(
            tmp_path,
            runs=20,
            set={"disturbances": [{"kind": "own_trap:Trap", "above": 0.0}]},
            **varied("disturbances.0.above", uniform=[0.0, 1.0]),
        )
        flown("run", path, "--out", tmp_path, exit_code=1)
        failed = {number: row for number, row in rows(tmp_path).items() if row[2] == "failed"}
        assert all(json.loads(row[1])["start"] > 0.8 for row in failed.values())
        assert all("the trap is shut" in row[4] for row in failed.values())
        assert 0 < len(failed) < 20
        connection = sqlite3.connect(tmp_path / "ledger.sqlite")
        (trace,) = connection.execute("select trace from runs where outcome = 'failed'").fetchone()
        assert "ZeroDivisionError" in trace
        assert "own_trap.py" in trace
        shown = flown("show", path, min(failed), "--out", tmp_path, exit_code=1)
        assert "the trap is shut" in shown.stderr


def ended(folder: Path, least: int, process: "subprocess.Popen[str]") -> None:
    """Wait until the ledger has this many rows."""

    def enough() -> bool:
        with suppress(sqlite3.OperationalError):  # its table is being made
            return (folder / "ledger.sqlite").is_file() and len(rows(folder)) >= least
        return False

    wait_until(enough, process)


@pytest.mark.long
class TestProcesses:
    """Flights of minutes, so that one of many is killed on its way."""

    @pytest.fixture
    def path(self, tmp_path: Path) -> Path:
        return study_file(tmp_path, runs=100, set={"duration_s": 200.0})

    @pytest.mark.parametrize("victim", ["worker", "parent", "Ctrl-C"])
    def test_a_killed_process_loses_no_finished_run(self, path: Path, tmp_path: Path, victim: str) -> None:
        process = start("study", "run", path, "--out", tmp_path, "--workers", 2)
        ended(tmp_path, 3, process)
        workers = [pid for pid, line in children(process.pid) if "spawn_main" in line]
        if victim == "worker":
            os.kill(workers[0], signal.SIGKILL)
        else:
            process.send_signal(signal.SIGKILL if victim == "parent" else signal.SIGINT)
        _, error = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == {"worker": 1, "parent": -signal.SIGKILL, "Ctrl-C": 130}[victim]
        if victim == "worker":
            assert "worker" in error
        wait_for_end(workers)
        kept = rows(tmp_path)
        assert 3 <= len(kept) < 200
        path.write_text(path.read_text(encoding="utf-8").replace("runs: 100", "runs: 4"), encoding="utf-8")
        for out in (tmp_path, tmp_path / "alone"):
            flown("run", path, "--out", out)
        resumed, alone = rows(tmp_path), rows(tmp_path / "alone")
        assert kept.items() <= resumed.items()
        assert alone == {number: resumed[number] for number in alone}  # of two workers, and of one

    def test_a_cluster_flies_the_same_and_its_worker_and_scheduler_may_be_killed(
        self, path: Path, tmp_path: Path
    ) -> None:
        pytest.importorskip("distributed")
        file, cluster = tmp_path / "scheduler.json", tmp_path / "cluster"
        dask: Callable[..., subprocess.Popen[str]] = lambda *given: subprocess.Popen(  # noqa: E731
            [sys.executable, "-m", *given, "--scheduler-file", str(file), "--no-dashboard"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, text=True,
            env=os.environ | {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"},
        )  # fmt: skip
        scheduler = dask("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0")
        worker = None
        try:
            wait_until(file.is_file)
            address = json.loads(file.read_text(encoding="utf-8"))["address"]
            for victim in ("worker", "scheduler"):
                worker = dask("distributed.cli.dask_worker", "--nthreads", "1", "--no-nanny")
                kept = len(rows(cluster)) if cluster.is_dir() else 0
                process = start("study", "run", path, "--out", cluster, "--scheduler", address)
                ended(cluster, kept + 3, process)
                killed = worker if victim == "worker" else scheduler
                killed.kill()
                killed.wait()
                _, error = process.communicate(timeout=PATIENCE_S)
                assert process.returncode == 1, error
                assert victim in error
        finally:
            for each in filter(None, (worker, scheduler)):
                each.kill()
                each.wait()
        finished = rows(cluster)
        assert len(finished) >= 6
        assert "failed" not in {row[2] for row in finished.values()}
        path.write_text(path.read_text(encoding="utf-8").replace("runs: 100", "runs: 2"), encoding="utf-8")
        flown("run", path, "--out", tmp_path / "here")
        here = rows(tmp_path / "here")
        assert {n: finished[n] for n in here if n in finished} == {n: here[n] for n in here if n in finished}


def test_no_scheduler_at_an_address_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    path = study_file(tmp_path)
    with pytest.importorskip("dask.config").set({"distributed.comm.timeouts.connect": "1s"}):
        result = invoke("study", "run", path, "--out", tmp_path / "out", "--scheduler", "tcp://127.0.0.1:1")
    assert result.exit_code == 2
    assert "127.0.0.1:1" in result.stderr


class TestReport:
    def test_values_borne_end_before_the_first_failure_on_each_side(self) -> None:
        runs = [(v, -3 < v < 4) for v in range(-6, 7)]
        assert borne(runs, 0.0) == "-2 to 3"
        assert borne([(v, True) for v in range(-2, 3)], 0.0) == "-2 to 2 (all)"
        assert borne([(-1, False), (1, False)], 0.0) == "none"
        assert borne([(0.0, False), (1.0, True)], 0.0) == "none"

    def test_intervals_hold_what_they_are_of(self) -> None:
        for successes, count in ((0, 10), (3, 7), (50, 100), (10, 10)):
            wilson = binomtest(successes, count).proportion_ci(method="wilson")
            assert share_interval(successes, count) == pytest.approx(tuple(wilson), abs=1e-12)
        normal = np.random.default_rng(1).normal(3.0, 1.0, 400)
        middle, least, most = median_interval(normal.tolist())
        assert least < middle < most
        # The standard error of the median of a normal sample: sqrt(pi / 2 / n).
        assert most - least == pytest.approx(2 * 1.96 * np.sqrt(np.pi / 2 / 400), rel=0.3)

    @pytest.mark.parametrize("sampler", ["sobol", "morris"])
    def test_the_sensitivity_of_a_linear_plant(self, tmp_path: Path, sampler: str) -> None:
        """The place at the start moves the mean error, the friction of a cart at rest does not."""
        pytest.importorskip("SALib")
        path = study_file(
            tmp_path, sampler=sampler, runs=8, metrics=["outputs.place.max_abs_error"], success={},
            cases={"light": {"scenario": str(tmp_path / "cart.yaml")}},
            vary={
                "start": {"settings": ["plant.initial.0"], "uniform": [-4.0, 0.0]},
                "friction": {"settings": ["plant.A.1.1"], "uniform": [-0.2, -0.1]},
            },
        )  # fmt: skip
        flown("run", path, "--out", tmp_path)
        lines = (tmp_path / "report.md").read_text(encoding="utf-8").splitlines()
        start, friction = (
            float(next(line for line in lines if line.startswith(f"| light | {name} |")).split("|")[3])
            for name in ("start", "friction")
        )
        assert abs(friction) < 0.05 * start
