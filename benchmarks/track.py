# SPDX-License-Identifier: Apache-2.0
"""The posture track made again, and how slowly a track falls in each suit: ``python benchmarks/track.py``.

Without rotation, force and moment are linear in the wind's direction, so that in the plane of symmetry the straight
falls of a posture follow from two sums over the segments, without a search.
"""

from typing import NamedTuple

import click
import numpy as np
from scipy.optimize import differential_evolution, minimize

from skydiver_utc.body.posture import ANGLES, Configuration, configuration
from skydiver_utc.body.segments import JOINTS, SEGMENTS, build_body
from skydiver_utc.parameters import Scenario, load_scenario
from skydiver_utc.plants.skydiver.model import GRAVITY_M_S2

SUITS = ("formation", "standard", "rig")
# Joint angles that are searched, both sides alike; those of a stretched track, and their ranges [deg].
FREE = (
    ("thorax", 0),
    ("shoulder", 0),
    ("shoulder", 1),
    ("shoulder", 2),
    ("elbow", 0),
    ("hip", 0),
    ("hip", 1),
    ("knee", 0),
)
STRETCHED = np.array([5.0, 0.0, 25.0, 0.0, 5.0, 0.0, 8.0, 5.0])
RANGES = ((-20, 20), (-60, 60), (0, 45), (-90, 70), (0, 45), (-30, 40), (0, 45), (0, 45))
# From broadside [deg].
INCIDENCE = 50.0
LEAST_GLIDE_DEG = 20.0


class Fall(NamedTuple):
    """The straight fall of a posture that is statically stable in pitch: angles in deg, speed in m/s."""

    incidence: float
    fall_rate: float
    glide: float
    ventral_side_down: float


def placed(scenario: Scenario, degrees: np.ndarray, ankle: float = -50.0) -> tuple[Configuration, np.ndarray]:
    """A track of joint angles `FREE`, and the drag areas (16, 3, 3) of its segments in body axes."""
    angles = np.zeros((len(JOINTS), 3))
    for (joint, column), value in zip(FREE, degrees, strict=True):
        angles[[row for row, name in enumerate(JOINTS) if name.endswith(joint)], column] = value
    angles[JOINTS.index("neck"), 0] = -20.0
    angles[[JOINTS.index("left_ankle"), JOINTS.index("right_ankle")], 0] = ankle
    body = build_body(scenario.plant.subject)
    track = configuration(body, np.deg2rad(angles))
    return track, np.einsum("ijk,ik,ilk->ijl", track.rotation, body.drag_area, track.rotation)


def fall(scenario: Scenario, degrees: np.ndarray) -> Fall:
    """The fall of a track that a turn in pitch out of the wind is answered from; its reverse is the other one."""
    track, areas = placed(scenario, degrees)
    x, z = track.centre[:, 0], track.centre[:, 2]
    incidence = np.arctan2(
        (z * areas[:, 0, 2] - x * areas[:, 2, 2]).sum(), (z * areas[:, 0, 0] - x * areas[:, 2, 0]).sum()
    )
    direction = np.array([np.sin(incidence), 0.0, -np.cos(incidence)])
    force = -areas.sum(axis=0) @ direction
    strength = float(np.linalg.norm(force))
    speed = np.sqrt(
        scenario.plant.subject.mass_kg * GRAVITY_M_S2 / (0.5 * scenario.plant.air.density_kg_m3 * strength)
    )
    up = force / strength
    rate = -speed * direction @ up
    forwards = speed * (direction[0] * up[2] - direction[2] * up[0])
    return Fall(*map(float, (np.rad2deg(incidence), rate, np.rad2deg(np.arctan2(forwards, rate)), up[2])))


def track_posture() -> np.ndarray:
    """Joint angles `FREE` [deg] nearest to a stretched track that meet the air of suit rig at `INCIDENCE`."""
    scenario = load_scenario("bank_recovery", {"plant.subject.suit": "rig"})
    start = STRETCHED + np.array([0, 0, 0, 0, 0, -10.0, 0, 5.0])
    found = minimize(
        lambda x: ((x - STRETCHED) ** 2).sum() / 100,
        start,
        bounds=RANGES,
        constraints={"type": "eq", "fun": lambda x: fall(scenario, x).incidence / 10 - INCIDENCE / 10},
        method="SLSQP",
        options={"ftol": 1e-12, "maxiter": 500},
    )
    assert found.success
    return found.x


def slowest(scenario: Scenario) -> tuple[np.ndarray, Fall]:
    """The track that falls slowest, belly to earth, with a glide of at least `LEAST_GLIDE_DEG`."""

    def cost(x: np.ndarray) -> float:
        flown = fall(scenario, x)
        return (
            flown.fall_rate
            + 5 * max(0, LEAST_GLIDE_DEG - flown.glide)
            + 100 * max(0, 0.75 - flown.ventral_side_down)
        )

    found = differential_evolution(cost, RANGES, maxiter=300, popsize=12, tol=1e-8, seed=1)
    return found.x, fall(scenario, found.x)


def described(flown: Fall) -> str:
    return f"falls at {flown.fall_rate:.1f} m/s, glides at {flown.glide:.1f} deg"


def variations() -> dict[str, Fall]:
    """What becomes of the track of the posture file when one thing is changed."""
    rig = load_scenario("bank_recovery", {"plant.subject.suit": "rig"})
    track = np.round(track_posture())
    hips, knees = (np.eye(len(FREE))[FREE.index((joint, 0))] for joint in ("hip", "knee"))
    return {
        "as in its file": fall(rig, track),
        "hips 3 deg more bent": fall(rig, track + 3 * hips),
        "knees 3 deg less bent": fall(rig, track - 3 * knees),
    }


@click.command(help=__doc__)
def main() -> None:
    angles = " ".join(f"{joint}_{ANGLES[column]}" for joint, column in FREE)
    print(f"track [deg], {angles}: {np.round(track_posture(), 1)}")
    for change, flown in variations().items():
        print(f"track, {change}: {described(flown)}")
    low = [row for row, segment in enumerate(SEGMENTS) if segment.kind in ("shank", "foot")]
    for suit in SUITS:
        scenario = load_scenario("bank_recovery", {"plant.subject.suit": suit})
        front = placed(scenario, STRETCHED)[1][:, 2, 2]
        found, flown = slowest(scenario)
        print(
            f"{suit}: stretched, lower legs and feet {front[low].sum() / front.sum():.0%} of the area;"
            f" the slowest track {described(flown)}, knees {found[-1]:.0f} deg"
        )


if __name__ == "__main__":
    main()
