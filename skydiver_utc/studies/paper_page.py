# SPDX-License-Identifier: Apache-2.0
"""The comparison with the paper as a page in Markdown: nothing but what the results hold."""

from skydiver_utc.studies import paper_cases as flown
from skydiver_utc.studies.cases import Case, Measures, shipped
from skydiver_utc.studies.checklist import checklist
from skydiver_utc.studies.markdown import figure, table
from skydiver_utc.studies.paper_results import QUICK_S, PaperResults
from skydiver_utc.studies.tuning_page import tuning_section

CONFIGURATION_HEAD = ("configuration", "code", "RMSE", "largest", "converged", "peak", "effort")
QUICK_WARNING = f"The quick form: only the first {QUICK_S:g} s of each run. Its figures mean nothing."
_ALTERNATIVE_TEXT = {
    "ff6": "The pose controller fails the fast turn",
    "utc_m0_c2": "UTC, dynamics of alpha unknown, coupling eq_q1",
    "utc_m1_c2": "UTC, dynamics of alpha modelled, coupling eq_q1",
    "utc_m1_c3": "UTC, dynamics of alpha modelled, coupling eq_q3",
}


def page(results: PaperResults) -> str:
    """All tables and figures of the comparison."""
    parts = [
        _introduction(results),
        "## Claims\n\nThe paper's claims in words, each with the rule that decides.\n",
        _claims(results),
        "## Configurations\n",
        table(CONFIGURATION_HEAD, configuration_rows(results)),
        "## Variants of the equations\n\nThe run with the other variant, all else as in its scenario.\n",
        _variants(results),
        "## The paper's hand force\n\nK_N = 100 N as printed. What each part contributes:\n",
        _hands(results),
        "## Moving limbs\n\nRMSE when the plant feels its limbs' motion, which the controllers' model does not.\n",
        _limbs(results),
        "## Sweeps\n\n![P_err, W0 and the horizon](sweeps.png)\n",
        tuning_section(results.tuning),
        "## Figures\n",
        *(f"### {label}\n\n![{_ALTERNATIVE_TEXT[label]}]({label}.png)\n" for label in flown.FIGURES),
    ]
    return "\n".join(parts)


def _introduction(results: PaperResults) -> str:
    quick = f"\n**{QUICK_WARNING}**\n" if results.quick else ""
    return f"""# The paper's results, run again

Written by `skydiver-utc compare paper --out FOLDER`; do not edit. `make paper` makes it all again.
{quick}
The figures are ours, on our plant. RMSE, largest error and peak are those of the yaw rate after 2 s, in deg/s.
Converged is the time from which on the error stays inside 5 % of the amplitude; late: in the second half of the
run, where it may be chance. Effort is the time mean of the squared, range-scaled distance of the controls from
the initial ones. The fast turn is 400 deg/s sin(2 pi 0.2 t) for 20 s, the slow turn 180 deg/s sin(2 pi 0.1 t).
A code column holds what follows `skydiver-utc simulate`.
"""


def _claims(results: PaperResults) -> str:
    rows = [
        (claim.words, claim.rule or "-", claim.measured, f"**{claim.verdict.value}**")
        for claim in checklist(results)
    ]
    return table(("the paper says", "it holds if", "measured", ""), rows)


def configuration_rows(results: PaperResults) -> list[tuple[str, ...]]:
    """The paper's configurations and those beside them, under CONFIGURATION_HEAD."""
    return [
        (label, f"`{one.command}`", *_cells(one, results.of(one)))
        for label, one in flown.CONFIGURATIONS.items()
    ]


def _cells(one: Case, found: Measures) -> tuple[str, ...]:
    return (
        _rmse(found),
        figure(found.max_abs_error_deg_s),
        _converged(one, found),
        figure(found.peak_yaw_rate_deg_s),
        "-" if found.control_effort is None else f"{found.control_effort:.2f}",
    )


def _converged(one: Case, found: Measures) -> str:
    """The convergence time in words."""
    if found.convergence_time_s is None:
        return "never"
    late = found.convergence_time_s > 0.5 * shipped(one.scenario).duration_s
    return f"{found.convergence_time_s:.1f} s" + (" (late)" if late else "")


def _rmse(found: Measures) -> str:
    """RMSE, and the outcome where it is not "completed"."""
    ended = "" if found.outcome == "completed" else f", {found.outcome.replace('_', ' ')}"
    return figure(found.rmse_deg_s) + ended


def _variants(results: PaperResults) -> str:
    rows = []
    for variant in flown.VARIANTS:
        one = variant.flown
        measured = ("-", "-", "-")
        if one is not None:
            default = next(other for other in flown.FIGURES.values() if other.scenario == one.scenario)
            measured = (f"`{one.command}`", _rmse(results.of(one)), _rmse(results.of(default)))
        rows.append((variant.point, variant.printed, variant.happens or "-", variant.working, *measured))
    head = ("point", "other variant", "what happens then", "default", "code", "RMSE", "RMSE, default")
    return table(head, rows)


def _hands(results: PaperResults) -> str:
    rows = []
    for one in flown.HANDS:
        found = results.of(one)
        rows.append((f"`{one.command}`", _rmse(found), figure(found.min_dorsal_axis)))
    return table(("code", "RMSE", "lowest dorsal axis"), rows)


def _limbs(results: PaperResults) -> str:
    scenarios = list(dict.fromkeys(name for name, _ in flown.LIMBS))
    rows = []
    for settings in flown.LIMB_SETTINGS:
        words = " ".join(f"`--set {name}={str(value).lower()}`" for name, value in settings) or "as it is"
        rows.append((words, *(_rmse(results.of(flown.LIMBS[name, settings])) for name in scenarios)))
    return table(("", *(f"`{name}`" for name in scenarios)), rows)
