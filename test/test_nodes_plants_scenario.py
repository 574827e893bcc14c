"""Whose scenario counts: that which the claim of the plant names, whatever comes first."""

import pytest

from skydiver_utc.nodes.border import BorderError
from skydiver_utc.nodes.plants_scenario import PlantsScenario
from skydiver_utc.nodes.roll_call import Claim, checksum

PLANT = Claim("plant", "a", 10, False, 1, "here", checksum("its own"))
SERVING = PLANT._replace(serving=True)
OTHER = Claim("plant", "b", 11, False, 2, "here", checksum("another"))


def test_the_claim_comes_first() -> None:
    heard = PlantsScenario()
    assert heard.hear_claim(PLANT) is None
    assert heard.hear("its own") == "its own"
    with pytest.raises(BorderError) as refused:
        heard.hear("a stranger's")
    assert refused.value.kind == "stranger"


def test_the_scenario_comes_first_among_those_of_strangers() -> None:
    heard = PlantsScenario()
    assert [heard.hear(text) for text in ("a", "its own", "b")] == [None] * 3
    assert heard.hear_claim(PLANT) == "its own"


def test_what_was_given_once_is_not_given_again() -> None:
    heard = PlantsScenario()
    assert (heard.hear("its own"), heard.hear_claim(PLANT)) == (None, "its own")
    assert (heard.hear_claim(SERVING), heard.hear("its own")) == (None, None)


def test_a_claim_of_another_kind_or_of_a_plant_that_is_not_configured_names_nothing() -> None:
    heard = PlantsScenario()
    heard.hear("its own")
    assert heard.hear_claim(PLANT._replace(kind="controller")) is None
    assert heard.hear_claim(PLANT._replace(scenario="")) is None
    assert heard.hear("anything") is None


def test_a_newcomer_does_not_count_beside_a_plant_that_serves_a_flight() -> None:
    heard = PlantsScenario()
    heard.hear("its own")
    heard.hear_claim(SERVING)
    assert heard.hear_claim(OTHER) is None
    with pytest.raises(BorderError):
        heard.hear("another")
    # The first one has died, the newcomer begins a flight.
    assert heard.hear_claim(OTHER._replace(serving=True)) == "another"


def test_a_plant_that_was_configured_anew_counts_with_its_new_scenario() -> None:
    heard = PlantsScenario()
    heard.hear_claim(SERVING)
    assert heard.hear("its own") == "its own"
    assert heard.hear_claim(SERVING._replace(scenario=checksum("changed"))) is None
    assert heard.hear("changed") == "changed"
