# SPDX-License-Identifier: Apache-2.0
"""What the examples share: the option --figure, and a figure of a few panels over time."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np


def figure_path(description: str) -> Path | None:
    """The value of --figure, if it is given; in a notebook, which shows the figure, figure.png."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--figure", type=Path, help="write a PNG here")
    in_notebook = "ipykernel" in sys.modules  # where sys.argv is the kernel's
    return parser.parse_args(["--figure", "figure.png"] if in_notebook else None).figure


def panels(
    path: Path, title: str, time: np.ndarray, rows: Sequence[tuple[str, dict[str, np.ndarray]]]
) -> None:
    """One panel per row: its label, and curves by name; a curve named "reference" is dashed grey."""
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(
        len(rows), 1, figsize=(7.5, 1.0 + 1.7 * len(rows)), sharex=True, layout="constrained", squeeze=False
    )
    for axis, (label, curves) in zip(axes[:, 0], rows, strict=True):
        for name, values in curves.items():
            style = {"color": "0.45", "linestyle": "--"} if name == "reference" else {}
            axis.plot(time[: len(values)], values, label=name, linewidth=1.4, **style)
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
        if len(curves) > 1:
            axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize="small", frameon=False)
    axes[0, 0].set_title(title, fontsize="medium")
    axes[-1, 0].set_xlabel("time [s]")
    figure.savefig(path, dpi=120)
