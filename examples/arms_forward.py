# SPDX-License-Identifier: Apache-2.0
"""Writes arms_forward.csv: from neutral, both arms stretch forwards and come back within 4 s.

``python examples/arms_forward.py > examples/arms_forward.csv``; what flies it is in docs/patterns.md.
"""

import math

from skydiver_utc.parameters import load_scenario

DURATION_S, SAMPLES = 4.0, 80
# Angles of the arms when they are stretched [deg], both sides alike.
STRETCHED = {"shoulder_flexion": 40.0, "shoulder_abduction": 115.0, "elbow_flexion": 35.0}


def main() -> None:
    neutral = load_scenario("bank_recovery").plant.posture.joint_angles_deg
    arms = {
        "shoulder_flexion": neutral["left_shoulder"][0],
        "shoulder_abduction": neutral["left_shoulder"][1],
    }
    arms["elbow_flexion"] = neutral["left_elbow"][0]
    print(",".join(["time_s", *(f"{side}_{name}_deg" for name in arms for side in ("left", "right"))]))
    for k in range(SAMPLES + 1):
        time_s = k * DURATION_S / SAMPLES
        share = 0.5 - 0.5 * math.cos(2.0 * math.pi * time_s / DURATION_S)
        angles = [at_rest + share * (STRETCHED[name] - at_rest) for name, at_rest in arms.items()]
        print(",".join([f"{time_s:.2f}", *(f"{angle:.3f}" for angle in angles for _ in range(2))]))


if __name__ == "__main__":
    main()
