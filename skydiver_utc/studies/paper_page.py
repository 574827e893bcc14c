# SPDX-License-Identifier: Apache-2.0
"""The comparison with the paper in Markdown, from its results alone: a page of claims, and one of details."""

from collections import Counter

from skydiver_utc.studies import paper_cases as flown
from skydiver_utc.studies.cases import Case, Measures, shipped
from skydiver_utc.studies.claim import Claim, Verdict
from skydiver_utc.studies.claims_conclusion import of_conclusion
from skydiver_utc.studies.claims_plant import of_plant
from skydiver_utc.studies.claims_tracking import of_tracking
from skydiver_utc.studies.claims_tuning import of_tuning
from skydiver_utc.studies.markdown import figure, table
from skydiver_utc.studies.paper_results import QUICK_S, PaperResults
from skydiver_utc.studies.sensitivity import sensitivity_section

_CAPTIONS = {
    "ff6": "The pose controller with constant damping fails the fast turn",
    "utc_m0_c2": "UTC, dynamics of alpha unknown, hands coupled by the yaw rate",
    "utc_m1_c2": "UTC, dynamics of alpha modelled, hands coupled by the yaw rate",
    "utc_m1_c3": "UTC, dynamics of alpha modelled, hands coupled by the yaw acceleration",
}
_MATRICES = {
    "The hands": ("What the hands' force and their roll moment contribute (eq_force2).", flown.HANDS),
    "The sign by the damping": (
        "Beyond the paper: the sign of alpha's coupling by the damping left, in place of eq:s14"
        " (docs/findings.md). It is insensitive to tuning, and other claims rest on the sensitivity that it heals.",
        flown.INSENSITIVE,
    ),
    "Moving limbs": (
        "The plant includes the reaction of moving limbs, which the controllers' model does not.",
        flown.LIMBS,
    ),
}


def checklist(results: PaperResults) -> list[Claim]:
    """Every claim that the paper makes in words, in its order, beside what was measured."""
    return [*of_plant(results), *of_tracking(results), *of_tuning(results), *of_conclusion(results)]


def page(results: PaperResults) -> str:
    """The claims and the paper's figures."""
    claims = checklist(results)
    counts = Counter(claim.verdict for claim in claims)
    counted = ", ".join(f"{verdict.value} {counts[verdict]}" for verdict in Verdict if counts[verdict])
    rows = [(claim.words, f"**{claim.verdict.value}**", claim.measured, claim.why or "-") for claim in claims]
    warning = f"The quick form: only the first {QUICK_S:g} s of each run. Its figures mean nothing."
    quick = f"\n**{warning}**\n" if results.quick else ""
    pictures = "\n".join(
        f"`{label}`: {_CAPTIONS[label]}.\n\n![{_CAPTIONS[label]}]({label}.png)\n" for label in flown.FIGURES
    )
    return f"""# The paper's results, run again

Written by `skydiver-utc compare paper --out FOLDER`; do not edit. `make paper` makes it all again.
{quick}
The paper's fast turn, 400 deg/s sin(2 pi 0.2 t), with the paper's numbers on our plant: the paper's skydiver, whose
hands pull with K_N = 100 N as printed. RMSE is that of the yaw rate after 2 s in deg/s; three in a row are those of the
paper's figures `utc_m0_c2`, `utc_m1_c2` and `utc_m1_c3`. Converged: inside 5 % of the amplitude for good. Effort: time
mean of the squared, range-scaled distance of the controls from the initial ones. How each claim is decided, and every
other figure: [details](details.md).

## Claims

Of {len(claims)} claims: {counted}.

{table(("the paper says", "", "measured", "remark"), rows)}
## The paper's figures

{pictures}"""


def details(results: PaperResults) -> str:
    """The basis of the page of claims."""
    rules = [(claim.words, claim.rule) for claim in checklist(results)]
    matrices = (
        f"## {title}\n\n{words} RMSE of the paper's three configurations of UTC;"
        " largest airspeed of the first.\n\n"
        f"{_matrix(results, rows)}"
        for title, (words, rows) in _MATRICES.items()
    )
    parts = [
        "# Details of the comparison with the paper\n\nBehind [the claims](paper.md), by the same commands. A code"
        " column holds what follows `skydiver-utc simulate`.\n",
        "## How each claim is decided\n",
        table(("the paper says", "it holds if"), rules),
        "## Configurations\n\nUTC: dynamics of alpha in the prediction, what couples the hands with the yaw damping,"
        " steps. RMSE, largest error and peak after 2 s in deg/s, largest airspeed in m/s. Late: converged in the"
        " second half of the run, where it may be chance. The slow turn is 180 deg/s sin(2 pi 0.1 t).\n",
        table(
            ("configuration", "code", "RMSE", "largest", "converged", "peak", "effort", "airspeed"),
            [_configuration(label, one, results.of(one)) for label, one in flown.CONFIGURATIONS.items()],
        ),
        *matrices,
        "## Variants of the equations\n\nThe run with the other variant, all else as in its scenario.\n",
        _variants(results),
        "## Sweeps\n\n![P_err, W0 and the horizon](sweeps.png)\n",
        "## Random tunings\n\nEach covariance times a random factor, log-uniform between 1/3 and 3 (`skydiver-utc study"
        " run tuning` shows every run, and the correlation of each factor with the RMSE). Converged: in the first half"
        " of the flight.\n",
        table(
            ("scenario", "tunings", "converged", "median RMSE"),
            [
                (f"`{name}`", str(one.count), str(one.converged), figure(one.rmse))
                for name, one in results.tuning.items()
            ],
        ),
        sensitivity_section(results.sensitivity),
    ]
    return "\n".join(parts)


def _configuration(label: str, one: Case, found: Measures) -> tuple[str, ...]:
    time_s, effort = found.convergence_time_s, found.control_effort
    late = " (late)" if time_s and time_s > 0.5 * shipped(one.scenario).duration_s else ""
    return (
        label,
        f"`{one.command}`",
        _rmse(found),
        figure(found.max_abs_error_deg_s),
        "never" if time_s is None else f"{time_s:.1f} s{late}",
        figure(found.peak_yaw_rate_deg_s),
        "-" if effort is None else f"{effort:.2f}",
        figure(found.largest_speed_m_s),
    )


def _rmse(found: Measures) -> str:
    """RMSE, and the outcome where it is not "completed"."""
    ended = "" if found.outcome == "completed" else f", {found.outcome.replace('_', ' ')}"
    return figure(found.rmse_deg_s) + ended


def _matrix(results: PaperResults, rows: dict[str, list[Case]]) -> str:
    lines = []
    for label, cases in rows.items():
        speed = figure(results.of(cases[0]).largest_speed_m_s)
        lines.append((label, f"`{cases[0].command}`", *(_rmse(results.of(one)) for one in cases), speed))
    return table(
        ("", "code of the first", *(f"`{name}`" for name in list(flown.FIGURES)[1:]), "airspeed"), lines
    )


def _variants(results: PaperResults) -> str:
    rows = []
    for variant in flown.VARIANTS:
        one = variant.flown
        measured = ("-", "-", "-")
        if one is not None:
            default = next(
                other for other in flown.FIGURES.values() if one.scenario.startswith(other.scenario)
            )
            measured = (f"`{one.command}`", _rmse(results.of(one)), _rmse(results.of(default)))
        rows.append((variant.point, variant.printed, variant.happens or "-", variant.working, *measured))
    head = ("point", "other variant", "what happens then", "default", "code", "RMSE", "RMSE, default")
    return table(head, rows)
