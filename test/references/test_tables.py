# SPDX-License-Identifier: Apache-2.0
"""CSV tables, points and sums of references: several outputs, paths from the file that names them, errors."""

import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from refusals import assert_refused
from runs import CART

from skydiver_utc.loop.build import build_reference
from skydiver_utc.parameters import ParameterError, from_yaml, load_scenario, to_yaml
from skydiver_utc.parameters.registry import KINDS

BASE = CART.replace("reference: {kind: constant, values: {place: 2.0, speed: 0.0}}\n", "")
TABLE = "time_s,place,speed\n0.5,1.0,-1.0\n1.5,3.0,1e-1\n\n2.5, 2.0,0\n"


@pytest.fixture
def load(tmp_path, monkeypatch):
    """Load a scenario from the folder `scenarios`, with the working directory elsewhere; `table.csv` lies beside it."""
    folder = tmp_path / "scenarios"
    folder.mkdir()
    (folder / "table.csv").write_text(TABLE, encoding="utf-8")
    monkeypatch.chdir(tmp_path)

    def loaded(reference, overrides=None, name="own"):
        path = folder / f"{name}.yaml"
        path.write_text(f"{BASE}reference: {reference}\n", encoding="utf-8")
        return load_scenario(str(path), overrides)

    return loaded


def values(scenario, count=80):
    return build_reference(scenario).preview(0, count)


def test_what_the_reader_of_csv_files_refuses_is_no_table(load):
    with pytest.raises(ParameterError, match="no CSV"):
        load(f"{{kind: csv, table: 'time_s,{'x' * (1 << 18)}'}}")


def test_a_csv_file_gives_lines_between_its_rows(load):
    reference = build_reference(load("{kind: csv, file: table.csv}"))
    assert reference.outputs == ("place", "speed")
    np.testing.assert_array_equal(reference.amplitude, [3.0, 1.0])
    time = 0.05 * np.arange(80)
    found = reference.preview(0, 80)
    np.testing.assert_allclose(found[:, 0], np.interp(time, [0.5, 1.5, 2.5], [1, 3, 2]), atol=1e-12)
    np.testing.assert_allclose(found[:, 1], np.interp(time, [0.5, 1.5, 2.5], [-1, 0.1, 0]), atol=1e-12)
    assert reference.preview(33, 5).tobytes() == found[33:38].tobytes()


def test_the_resolved_scenario_needs_the_file_no_longer(load, tmp_path):
    scenario = load("{kind: csv, file: table.csv}")
    (tmp_path / "scenarios" / "table.csv").unlink()
    again = from_yaml(to_yaml(scenario))
    assert again == scenario
    np.testing.assert_array_equal(values(again), values(scenario))


def test_a_path_counts_from_the_file_that_names_it(load, tmp_path):
    """Also of one that extends another; on the command line it counts from the working directory."""
    load("{kind: csv, file: table.csv}")
    other = tmp_path / "other"
    other.mkdir()
    (other / "short.csv").write_text("time_s,speed\n0,7\n", encoding="utf-8")
    (other / "child.yaml").write_text("extends: ../scenarios/own\nname: child\n", encoding="utf-8")
    child = str(other / "child.yaml")
    assert build_reference(load_scenario(child)).outputs == ("place", "speed")
    (other / "child.yaml").write_text(
        "extends: ../scenarios/own\nname: child\nreference: {file: short.csv}\n", encoding="utf-8"
    )
    assert build_reference(load_scenario(child)).outputs == ("speed",)
    given = load_scenario(child, {"reference.file": "scenarios/table.csv"})
    assert build_reference(given).outputs == ("place", "speed")


def test_degrees_become_radians(load, tmp_path):
    text = "\ufefftime_s,place_deg,speed_deg_s\n0,180,90\n"
    (tmp_path / "scenarios" / "degrees.csv").write_text(text, encoding="utf-8")
    reference = build_reference(load("{kind: csv, file: degrees.csv}"))
    assert reference.outputs == ("place", "speed")
    np.testing.assert_allclose(reference.preview(0, 1), [[np.pi, np.pi / 2]])


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("", ["file"]),
        ("\n", ["header", "time_s"]),
        ("t,place\n0,1\n", ["header", "time_s"]),
        ("time_s\n0\n", ["header"]),
        ("time_s,place,\n0,1,2\n", ["header"]),
        ("time_s,place\n", ["no rows"]),
        ("time_s,place\n0,1\n1\n", ["row 3", "1 entries"]),
        ("time_s,place\n0,one\n", ["row 2", "one"]),
        ("time_s,place\n0,nan\n", ["row 2", "finite"]),
        ("time_s,place\n1,0\n1,1\n", ["growing time"]),
        ("time_s,place,place_deg\n1,0,1\n", ["twice"]),
    ],
)
def test_a_wrong_table_is_refused(load, tmp_path, table, words):
    (tmp_path / "scenarios" / "wrong.csv").write_text(table, encoding="utf-8")
    assert_refused(words, load, "{kind: csv, file: wrong.csv}")


def test_sums_for_several_outputs(load, tmp_path):
    """A sine on a step for one output, a CSV file for the other."""
    (tmp_path / "scenarios" / "speed.csv").write_text("time_s,speed\n0,0\n4,4\n", encoding="utf-8")
    step = "{kind: step, output: place, amplitude: 1, start_s: 1}"
    sine = "{kind: sine, output: place, amplitude: 0.1, frequency_hz: 0.5}"
    scenario = load(f"{{kind: combined, parts: [{step}, {{kind: csv, file: speed.csv}}, {sine}]}}")
    assert from_yaml(to_yaml(scenario)) == scenario
    reference = build_reference(scenario)
    assert reference.outputs == ("place", "speed")
    np.testing.assert_allclose(reference.amplitude, [1.1, 4.0])
    time = 0.05 * np.arange(80)
    found = reference.preview(0, 80)
    np.testing.assert_allclose(found[:, 0], (time > 0.999) + 0.1 * np.sin(np.pi * time), atol=1e-12)
    np.testing.assert_allclose(found[:, 1], time, atol=1e-12)
    assert reference.preview(20, 3).tobytes() == found[20:23].tobytes()


def test_a_live_reference_holds_what_it_received_last(load):
    outputs = "{place: linear.x, speed: linear.y}"
    reference = build_reference(load(f"{{kind: live, outputs: {outputs}, initial: {{speed: 2}}}}"))
    np.testing.assert_array_equal(reference.preview(5, 2), [[0.0, 2.0], [0.0, 2.0]])
    reference.receive([1.0, 4.0])
    np.testing.assert_array_equal(reference.preview(9, 2), [[1.0, 4.0], [1.0, 4.0]])


@pytest.mark.parametrize(
    ("reference", "words"),
    [
        ("{kind: csv}", ["reference: file is missing"]),
        ("{kind: csv, file: none.csv}", ["none.csv"]),
        ('{kind: csv, file: "a\\0b"}', ["control character"]),
        ("{kind: combined, parts: []}", ["reference.parts"]),
        ("{kind: combined, parts: 1}", ["reference.parts"]),
        ("{kind: combined, parts: [{kind: sin, amplitude: 1}]}", ["reference.parts", "[0]", "sine"]),
        (
            "{kind: combined, parts: [{kind: step, amplitude: 1}, {kind: sine, amplitude: 1, frequency_hz: -1}]}",
            ["[1].frequency_hz"],
        ),
        ("{kind: combined, parts: [{kind: live, outputs: {place: linear.x}}]}", ["reference.parts", "live"]),
        ("{kind: live, outputs: {}}", ["outputs", "at least one"]),
        ("{kind: live, outputs: {place: linear.x}, initial: {roll: 1}}", ["roll", "outputs"]),
        ("{kind: constant, values: {}}", ["values", "at least one"]),
    ],
)
def test_a_wrong_part_or_output_is_named(load, reference, words):
    assert_refused(words, load, reference)


def test_each_line_of_the_page_is_a_reference_for_the_skydiver(tmp_path, monkeypatch):
    (tmp_path / "profile.csv").write_text("time_s,yaw_rate_deg_s\n0,0\n5,90\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    page = (Path(__file__).parents[2] / "docs" / "references.md").read_text(encoding="utf-8")
    lines = dict(re.findall(r"^\| `(\w+)` \| `(\{.*?\})` \|", page, re.MULTILINE))
    assert set(lines) == set(KINDS["reference"])
    for kind, line in lines.items():
        scenario = load_scenario("slow_turn_pose_only", {"reference": yaml.safe_load(line)})
        found = build_reference(scenario)
        assert (scenario.reference.kind, found.outputs[0]) == (kind, "yaw_rate")
        assert np.abs(found.preview(0, 3000)).max() <= found.amplitude.max() + 1e-12
