"""The tuning study in tables."""

from collections.abc import Callable, Mapping

from skydiver_utc.studies.markdown import figure, table
from skydiver_utc.studies.tuning import FACTORS
from skydiver_utc.studies.tuning_summary import TuningSummary

_COUNTS: dict[str, Callable[[TuningSummary], str]] = {
    "tunings": lambda one: str(one.count),
    "belly to earth to the end": lambda one: str(one.completed),
    "converged in the first half": lambda one: str(one.converged),
    "converged by 2 s": lambda one: str(one.converged_by_2_s),
    "RMSE at most 5 % of the amplitude": lambda one: str(one.tracked),
    "RMSE: 5 %, half, 95 % stay below [deg/s]": lambda one: ", ".join(map(figure, one.rmse_quantiles)),
    "steps without an answer": lambda one: str(one.kept_previous_steps),
}


def count_rows(summaries: Mapping[str, TuningSummary]) -> list[tuple[str, ...]]:
    """How many tunings did what, one column per scenario."""
    return [(label, *(text(one) for one in summaries.values())) for label, text in _COUNTS.items()]


def reason_rows(summaries: Mapping[str, TuningSummary]) -> list[tuple[str, ...]]:
    """Rank correlation of each factor with the RMSE, and the share that converged by thirds of the factor."""
    return [(factor, *(_reason(one, factor) for one in summaries.values())) for factor in FACTORS]


def _reason(one: TuningSummary, factor: str) -> str:
    thirds = ", ".join(f"{share:.0%}" for share in one.converged_by_thirds[factor])
    return f"{one.rank_correlation[factor]:+.2f}; {thirds}"


def tuning_section(summaries: Mapping[str, TuningSummary]) -> str:
    """The study's part of the page."""
    if not summaries:
        return "## Random tunings\n\nNot flown: `skydiver-utc study tuning` into the same folder first.\n"
    head = ("", *(f"`{name}`" for name in summaries))
    return f"""## Random tunings

Each covariance times a factor between 0.1 and 10, log-uniform, all at once (`skydiver-utc study tuning`). Every
flight is in [tuning.csv](tuning.csv), with its factors on the scenario's own values.

{table(head, count_rows(summaries))}
Why: the rank correlation of each factor with the RMSE; then the share that converged in the lowest, middle and
highest third of the factor.

{table(head, reason_rows(summaries))}
![RMSE of the random tunings](tuning.png)
"""
