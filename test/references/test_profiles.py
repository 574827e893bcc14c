# SPDX-License-Identifier: Apache-2.0
"""Each profile against a formula of its own, from SciPy or NumPy; its bounds and its previews."""

import numpy as np
import pytest
from refusals import assert_refused
from runs import CART_PLANT
from scipy.signal import chirp, find_peaks

from skydiver_utc.loop.build import build_reference
from skydiver_utc.parameters import ParameterError, from_yaml, override, to_yaml

CART = f"""
name: cart
duration_s: 1.0
dt_s: 0.01
{CART_PLANT}controller: {{{{kind: utc, horizon_steps: 10}}}}
reference: {{{{output: place, kind: {{}}}}}}
"""
STEPS = 1200
TIME = 0.01 * np.arange(STEPS)
LINES = {
    "step, amplitude: 2": ([0.0], [2.0]),
    "step, amplitude: -2, start_s: 0.07": ([0.07, 0.07], [0.0, -2.0]),
    "ramp, amplitude: 2, rise_s: 0.5, start_s: 1": ([1.0, 1.5], [0.0, 2.0]),
    "trapezoid, amplitude: 2, rise_s: 0.5, hold_s: 1, start_s: 1": ([1.0, 1.5, 2.5, 3.0], [0, 2, 2, 0]),
    "trapezoid, amplitude: 1, rise_s: 0, hold_s: 0.3, start_s: 0.7": ([0.7, 0.7, 1.0, 1.0], [0, 1, 1, 0]),
    "doublet, amplitude: 1, hold_s: 1.1, start_s: 0.3": (
        [0.3, 0.3, 1.4, 1.4, 2.5, 2.5],
        [0, 1, 1, -1, -1, 0],
    ),
    "points, points: [[1, 2], [1.5, -1], [4, 0]]": ([1.0, 1.5, 4.0], [2.0, -1.0, 0.0]),
    "doublet, amplitude: -1, rise_s: 0.5, hold_s: 1": ([0.0, 0.5, 1.5, 2.5, 3.5, 4.0], [0, -1, -1, 1, 1, 0]),
}
W = 2 * np.pi * TIME
SINES = {
    "sine, amplitude: 2, frequency_hz: 0.3": 2 * np.sin(0.3 * W),
    "sine, amplitude: 2, frequency_hz: 0.3, phase_deg: 90": 2 * np.cos(0.3 * W),
    "sine, amplitude: 2, frequency_hz: 0.3, start_s: 1": np.where(
        TIME >= 1, 2 * np.sin(0.3 * (W - 2 * np.pi)), 0
    ),
    "sine, amplitude_deg_s: 180, frequency_hz: 0.5": np.pi * np.sin(0.5 * W),
    "multi_sine, amplitude: 0.5, frequencies_hz: [0.1, 0.35]": 0.5 * (np.sin(0.1 * W) + np.sin(0.35 * W)),
    "multi_sine, amplitude: 1, frequencies_hz: [0.1, 0.35], phases_deg: [90, -180]": np.cos(0.1 * W)
    - np.sin(0.35 * W),
    "rotation, angle_deg: 180, duration_s: 4, start_s: 1": np.where(
        (TIME > 1) & (TIME < 5), np.pi / 4 * (1 - np.cos(np.pi / 2 * (TIME - 1))), 0
    ),
    # Of one sine, as nine digits of a number of periods count; its amplitude is positive with the seed 0.
    "random, amplitude: 3, to_hz: 0.4999999999, period_s: 2": 3 * np.sin(0.5 * W),
}
RANDOM = "random, amplitude: 3, from_hz: 0.2, to_hz: 1, period_s: 20"


def scenario(reference):
    """A cart with this reference of its place."""
    return from_yaml(CART.format(reference))


def values(reference, count=STEPS):
    """All values (count,) in one preview."""
    return build_reference(scenario(reference)).preview(0, count)[:, 0]


@pytest.mark.parametrize("reference", LINES)
def test_lines_against_numpy(reference):
    """Right of a jump from the step of its time on, which a product k dt misses by rounding."""
    times, wanted = LINES[reference]
    expected = np.array([np.interp(round(t, 6), times, wanted) for t in TIME])
    np.testing.assert_allclose(values(reference), expected, atol=1e-12)
    assert build_reference(scenario(reference)).amplitude == pytest.approx(np.abs(expected).max())


def test_a_step_that_the_clock_misses_by_rounding_is_taken():
    """5 * 0.0042 is below 0.021."""
    late = build_reference(override(scenario("step, amplitude: 2, start_s: 0.021"), {"dt_s": 0.0042}))
    assert late.preview(0, 7)[:, 0].tolist() == [0, 0, 0, 0, 0, 2, 2]


@pytest.mark.parametrize("reference", SINES)
def test_sines_against_numpy(reference):
    np.testing.assert_allclose(values(reference), SINES[reference], atol=1e-12)
    largest = np.abs(SINES[reference]).max()
    assert largest - 1e-12 <= build_reference(scenario(reference)).amplitude <= 1.3 * largest


@pytest.mark.parametrize(("f0", "f1", "phase"), [(0.1, 2.0, 0), (2.0, 0.1, 0), (0, 1, 30), (0.5, 0.5, -90)])
def test_chirp_against_scipy(f0, f1, phase):
    """Inside the sweep; then a sine of the last frequency goes on without a jump of value or slope."""
    found = values(f"chirp, amplitude: 2, from_hz: {f0}, to_hz: {f1}, duration_s: 8, phase_deg: {phase}")
    swept = TIME <= 8
    np.testing.assert_allclose(found[swept], 2 * chirp(TIME[swept], f0, 8, f1, phi=phase - 90), atol=1e-9)
    cycles = 8 * (f0 + f1) / 2 + f1 * (TIME[~swept] - 8)
    np.testing.assert_allclose(found[~swept], 2 * np.sin(2 * np.pi * cycles + np.deg2rad(phase)), atol=1e-9)


def test_a_random_profile_is_band_limited_and_reaches_its_amplitude():
    """All of its spectrum lies on the multiples of 1 / period in the band."""
    found = values(RANDOM, 2000)
    spectrum = np.abs(np.fft.rfft(found)) / 1000
    inside = np.zeros(len(spectrum), dtype=bool)
    inside[4:21] = True
    assert np.hypot.reduce(spectrum[~inside]) < 1e-9
    assert (spectrum[inside] > 1e-4).all()
    assert np.abs(found).max() == pytest.approx(3.0, rel=2e-3)
    assert found[0] == 0.0
    assert len(find_peaks(found)[0]) > 8
    seeded = scenario(RANDOM + ", seed: 5")
    assert np.abs(np.corrcoef(found, build_reference(seeded).preview(0, 2000)[:, 0])[0, 1]) < 0.9
    assert override(seeded, {"seed": 9}).reference == seeded.reference


@pytest.mark.parametrize("reference", [*LINES, *SINES, RANDOM])
def test_every_preview_has_the_same_bits_and_the_settings_come_back(reference):
    resolved = scenario(reference)
    assert from_yaml(to_yaml(resolved)) == resolved
    whole = build_reference(resolved).preview(0, 400)
    fresh = build_reference(resolved)
    for k, count in ((371, 20), (3, 20), (40, 20), (0, 9000), (3, 20)):
        assert fresh.preview(k, count)[:20].tobytes() == whole[k : k + 20].tobytes()
    assert fresh.preview(7, 0).shape == (0, 1)


@pytest.mark.parametrize(
    ("reference", "words"),
    [
        ("step", ["amplitude", "amplitude_deg_s"]),
        ("step, amplitude: 1, amplitude_deg_s: 1", ["amplitude", "amplitude_deg_s"]),
        ("step, amplitude: 1, rise_s: 1", ["reference.rise_s"]),
        ("ramp, amplitude: 1, rise_s: 0", ["reference.rise_s", "greater than 0"]),
        ("ramp, amplitude: 1", ["reference.rise_s", "missing"]),
        ("trapezoid, amplitude: 1, rise_s: 1, hold_s: 0", ["reference.hold_s"]),
        ("doublet, amplitude: 1, rise_s: -1, hold_s: 1", ["reference.rise_s"]),
        ("sine, amplitude: 1, frequency_hz: 0", ["reference.frequency_hz"]),
        ("sine, amplitude: 1, frequency_hz: 1, phase_deg: 400", ["reference.phase_deg", "360"]),
        ("multi_sine, amplitude: 1, frequencies_hz: []", ["reference.frequencies_hz"]),
        ("multi_sine, amplitude: 1, frequencies_hz: [1, -1]", ["reference.frequencies_hz.1"]),
        ("multi_sine, amplitude: 1, frequencies_hz: [1], phases_deg: [1, 2]", ["phases_deg"]),
        ("chirp, amplitude: 1, from_hz: 0, to_hz: 0, duration_s: 1", ["from_hz", "to_hz"]),
        ("chirp, amplitude: 1, from_hz: 0, to_hz: 1, duration_s: 0", ["reference.duration_s"]),
        ("random, amplitude: 1, to_hz: 0.001", ["from_hz", "to_hz", "period_s"]),
        ("random, amplitude: 1, from_hz: 2, to_hz: 1", ["from_hz", "to_hz", "period_s"]),
        ("random, amplitude: 1, to_hz: 10.01, period_s: 100", ["from_hz", "to_hz", "period_s"]),
        ("random, amplitude: 1, to_hz: 1, seed: 1.5", ["reference.seed", "whole number"]),
        ("points, points: []", ["points", "at least one"]),
        ("points, points: [[1, 0], [1, 2]]", ["points", "time"]),
    ],
)
def test_a_wrong_setting_is_named(reference, words):
    assert_refused(words, scenario, reference)


@pytest.mark.parametrize(
    "fast",
    [
        "sine, amplitude: 1, frequency_hz: 11",
        "multi_sine, amplitude: 1, frequencies_hz: [1, 11]",
        "chirp, amplitude: 1, from_hz: 11, to_hz: 1, duration_s: 1",
        "random, amplitude: 1, from_hz: 1, to_hz: 11, period_s: 10",
        "rotation, angle_deg: 10, duration_s: 0.09",
    ],
)
def test_a_period_of_less_than_ten_steps_is_refused(fast):
    with pytest.raises(ParameterError, match="dt_s"):
        build_reference(scenario(fast))
    build_reference(scenario(fast.replace("11", "10").replace("0.09", "0.1")))
