# SPDX-License-Identifier: Apache-2.0
"""Scenario files as people have them: what YAML reads, where names of files lead, which words an error has."""

from pathlib import Path

import pytest
from refusals import assert_refused

from skydiver_utc.parameters import ParameterError, from_yaml, load_scenario, to_yaml
from skydiver_utc.parameters.loading import config_folder
from skydiver_utc.parameters.yaml_io import number, parse_yaml, refuse_unfit, write_yaml

FAST = "fast_turn_unknown_dynamics"
POSTURE = (config_folder() / "postures" / "box.yaml").read_text()


def write(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


SCALARS = {
    "010": 10, "-07": -7, "0o10": 8, "0x1F": 31, "+5": 5, "1e5": 1e5, "1.": 1.0, ".5": 0.5, "-1.5E-3": -1.5e-3,
    "1_000": "1_000", "1:30": "1:30", "0b1": "0b1", "yes": "yes", "off": "off", "True": True, "false": False,
    "2026-01-01": "2026-01-01", "=": "=", "<<": "<<", "~": None, "": None, "null": None, "1e": "1e", "١": "١",
}  # fmt: skip


@pytest.mark.parametrize("text", SCALARS)
def test_scalars_are_those_of_yaml_1_2_and_come_back(text: str) -> None:
    if text == "<<":
        text, expected = "'<<'", "<<"
    else:
        expected = SCALARS[text]
    found = parse_yaml(f"a: {text}", "it")["a"]
    assert (found, type(found)) == (expected, type(expected))
    again = parse_yaml(write_yaml({"a": found, "b": text}), "it")
    assert again == {"a": expected, "b": text}
    assert write_yaml({"b": "°", "a": found}).startswith("{b: °, a: ")


@pytest.mark.parametrize("text", ["1_0", "nan", "inf", "1e999", "0x10", "١", "1:30", "", "1 0"])
def test_a_cell_that_is_no_number_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="number"):
        number(text)
    assert number(" -1.5e3 ") == -1500.0


def test_blocks_can_be_merged() -> None:
    text = "a: &a {x: 1, long: 2}\nc: {<<: [&b {<<: *a, long: 3}, *a], z: 4}\nd: *b\ne: {<<: [*a, *b]}"
    assert parse_yaml(text, "it") == {
        "a": {"x": 1, "long": 2},
        "c": {"x": 1, "long": 3, "z": 4},
        "d": {"x": 1, "long": 3},
        "e": {"x": 1, "long": 2},
    }
    doubled = "".join(f"b{k}: &b{k} {{<<: [*b{k - 1}, *b{k - 1}]}}\n" for k in range(1, 40))
    assert parse_yaml("b0: &b0 {x: 1}\n" + doubled, "it")["b39"] == {"x": 1}


def test_yaml_has_bounds_and_its_faults_a_place() -> None:
    """What stands for too much, or for itself, is in test/data/field."""
    parse_yaml("a: " + 99 * "[" + "1" + 99 * "]", "it")
    with pytest.raises(ParameterError, match="blocks"):
        parse_yaml("a: " + 100 * "[" + "1" + 100 * "]", "it")
    refuse_unfit([1] * 200_000, "it")
    for wrong, words in {"a: [1, {b: .inf}]": r"a\[1\]\.b in it is inf", "\nx:\n  <<: 3": "line 3"}.items():
        with pytest.raises(ParameterError, match=words):
            parse_yaml(wrong, "it")
    with pytest.raises(ParameterError, match="too many"):
        refuse_unfit([1] * 200_001, "it")
    deep: list[object] = []
    for _ in range(3000):
        deep = [deep]
    assert_refused("override", load_scenario, FAST, {"plant.limits.alpha": deep})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a: &a 1\nb: *a", "aliases"),
        ("*", "valid YAML"),
        ("- '*'", "mapping"),
        ("#" * 4_000_000, "mapping"),
        ("#" * 4_000_001, "characters"),
    ],
    ids=lambda text: text[:8],
)
def test_a_text_from_anywhere_has_bounds_and_no_aliases(text: str, words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        from_yaml(text)


def test_a_path_counts_from_the_file_that_says_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path / "mine" / "box.yaml", POSTURE.replace("name: box", "name: my_box"))
    write(tmp_path / "mine" / "base.yaml", "extends: bank_recovery\nplant: {posture: box.yaml}\n")
    own = write(tmp_path / "yours" / "flight.yaml", "extends: ../mine/base.yaml\nduration_s: 2.0\n")
    write(tmp_path / "here" / "box.yaml", POSTURE.replace("name: box", "name: here"))
    monkeypatch.chdir(tmp_path / "here")
    assert load_scenario("../yours/flight.yaml").plant.posture.name == "my_box"
    assert load_scenario(str(own), {"plant.posture": "box.yaml"}).plant.posture.name == "here"
    frames = "[{alpha: 0.0, posture: ../mine/box.yaml}, {alpha: 1.0, posture: box}]"
    pattern = f"{{kind: path, name: p, description: d, source: s, keyframes: {frames}}}"
    write(own, f"extends: bank_recovery\nplant: {{pattern: {pattern}}}\n")
    assert load_scenario(str(own)).plant.pattern.keyframes[0].posture.name == "my_box"
    given = [{"alpha": 0.0, "posture": "box.yaml"}, {"alpha": 1.0, "posture": "track"}]
    found = load_scenario(str(own), {"plant.pattern.keyframes": given}).plant.pattern.keyframes
    assert [keyframe.posture.name for keyframe in found] == ["here", "track"]
    write(own, "extends: bank_recovery\nplant: {posture: box.yaml}\n")
    assert_refused(str(tmp_path / "yours" / "box.yaml"), load_scenario, str(own))


def test_a_packaged_scenario_is_extended_from_anywhere(tmp_path: Path) -> None:
    path = write(tmp_path / "flight.yaml", f"extends: {FAST}\nname: mine\n")
    assert load_scenario(str(path)) == load_scenario(FAST, {"name": "mine"})


@pytest.mark.parametrize(
    "texts",
    [
        {"flight.yaml": "extends: other", "other.yaml": "extends: ../run/flight"},
        {"flight.yaml": f"extends: {FAST}\nplant: {{skydiver: a.yaml}}", "a.yaml": "{skydiver: a.yaml}"},
    ],
)  # fmt: skip
def test_a_cycle_is_named(tmp_path: Path, texts: dict[str, str]) -> None:
    for name, text in texts.items():
        write(tmp_path / "run" / name, text)
    assert_refused("itself", load_scenario, str(tmp_path / "run" / "flight.yaml"))


def test_wrong_fields_names_and_numbers_are_told_at_once() -> None:
    wrong = {
        "horizon_steps": 5, "K_N": 3.0, "plant.posture": "bax", "plant.subject": "nobody.yaml",
        "dt_s": float("nan"), "duration_s": "1_0", "controller.W0": float("inf"), "name.first": 1,
    }  # fmt: skip
    told = ["did you mean controller.horizon_steps", "did you mean plant.hands.K_N", "posture 'bax'", "1_0"]
    told += ["nobody.yaml", "dt_s", "duration_s", "controller.W0", "name.first"]
    assert_refused(told, load_scenario, FAST, wrong)


def test_a_table_that_is_missing_hides_no_other_fault(tmp_path: Path) -> None:
    text = f"extends: {FAST}\ndt_s: zero\nreference: {{kind: csv, file: nowhere.csv, tabel: 1}}\n"
    path = write(tmp_path / "flight.yaml", text)
    assert_refused(("dt_s", "nowhere.csv", "reference.tabel"), load_scenario, str(path))


@pytest.mark.parametrize("wrong", [10, 11, 20_000])
def test_very_many_wrong_fields_are_counted(wrong: int) -> None:
    text = to_yaml(load_scenario(FAST)) + "".join(f"key{k}: 1\n" for k in range(wrong))
    with pytest.raises(ParameterError, match="key9") as caught:
        from_yaml(text)
    assert f"and {wrong - 10} more (" in str(caught.value) or wrong == 10
    assert (" more (" in str(caught.value)) == (wrong > 10)
