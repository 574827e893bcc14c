# SPDX-License-Identifier: Apache-2.0
"""`tuned_at_dt_s`: settings that were tuned at another step.

Qu and the forgetting factor count per step, the horizon counts steps. Converted, they do the same per second.
"""

from skydiver_utc import UtcSettings

tuned = UtcSettings(horizon_steps=20, Qu_ratio=0.1, forgetting_factor=0.02, tuned_at_dt_s=0.01)
# A controller does this itself, with the dt of its plant.
converted = tuned.at_step(0.02)
print(f"at 0.02 s: horizon {converted.horizon_steps} steps, Qu_ratio {converted.Qu_ratio:g}")
print(f"forgotten in a step: {converted.forgetting_factor:.4f} instead of {tuned.forgetting_factor:.4f}")
