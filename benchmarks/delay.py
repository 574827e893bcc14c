# SPDX-License-Identifier: Apache-2.0
"""What a delay between state and command costs, with and without compensation: ``python benchmarks/delay.py``.

In process and without a clock, so the figures are the same each time: the command that answers the state at k acts
on [t_k+d, t_k+d+1). A real-time flight in which every command is on time has d = 1.
"""

from collections import deque

import click
import numpy as np

from skydiver_utc.analysis.numbers import SETTLING_S
from skydiver_utc.loop.build import build_controller, build_plant, build_reference
from skydiver_utc.parameters import Scenario, load_scenario


def rmse_deg_s(scenario: Scenario, delay: int, compensated: int) -> float:
    """Error of the tracked rate from 2 s on, with commands `delay` steps late and `compensated` steps predicted."""
    plant, reference = build_plant(scenario), build_reference(scenario)
    controller = build_controller(scenario, plant, reference, compensated)
    tracked = plant.output_names.index(reference.outputs[0])
    state, held = plant.initial_state(), plant.initial_applied()
    waiting = deque([held[:4]] * delay)
    errors = []
    for k in range(scenario.steps):
        waiting.append(controller.decide(state, reference.preview(k, controller.preview_steps + 1)).control)
        state, held = plant.advance(state, held, waiting.popleft())
        if (k + 1) * scenario.dt_s >= SETTLING_S:
            errors.append(plant.outputs(state)[tracked] - reference.preview(k + 1, 1)[0, 0])
    return float(np.rad2deg(np.sqrt(np.mean(np.square(errors)))))


@click.command()
@click.argument("name", default="fast_turn_unknown_dynamics")
def main(name: str) -> None:
    """A table of the RMSE [deg/s] over the delay [steps]."""
    scenario = load_scenario(name)
    click.echo("| delay [steps] | RMSE [deg/s] | compensated |\n|---|---|---|")
    for delay in (0, 1, 2, 5, 20):
        figures = [rmse_deg_s(scenario, delay, compensated) for compensated in (0, delay)]
        click.echo(f"| {delay} | {figures[0]:.2f} | {figures[1]:.2f} |")


if __name__ == "__main__":
    main()
