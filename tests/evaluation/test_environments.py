"""Agents are scored in an environment's wind: all of them in the same, each with its own interval between actions."""

from __future__ import annotations

import numpy as np
import pytest

from flapgym.control import OpenLoop, load_agent
from flapgym.evaluation import compare
from flapgym.evaluation.comparison import plan
from flapgym.evaluation.report import as_json, as_text
from flapgym.evaluation.simulate import simulate_together

SITE = "flapgym/NREL5MWSite-v0"


def test_agents_meet_the_same_field_however_long_they_hold_actions():
    planned = plan(["lqg_saturating", "ppo"], environment=SITE, realisations=2, duration=20.0)
    steps = {agent.steps_per_action for agent in planned.agents}
    assert len(steps) > 1
    still, *others = simulate_together(planned.agents, planned.model, range(2), 20.0, **planned.settings)
    assert np.ptp(still.wind) > 0.5
    for record in others:
        np.testing.assert_allclose(record.wind, still.wind, atol=1e-12)
        np.testing.assert_array_equal(record.azimuth, still.azimuth)


def test_a_comparison_tells_the_environment_it_was_made_in():
    comparison = compare(["lqg"], environment=SITE, realisations=1, duration=20.0, seed=5)
    assert comparison.model_name == "nrel5mw-site"
    assert comparison.scores["lqg"].made_for_this_model
    assert as_json(comparison)["environment"] == SITE
    assert f"environment {SITE}" in as_text(comparison)


def test_gravity_and_shear_are_part_of_the_loads_at_a_site():
    planned = plan([], environment=SITE, realisations=1, duration=40.0)
    (calm,) = simulate_together(
        [OpenLoop()], planned.model, [0], 40.0, wind={"turbulence_intensity": 0.0}, gravity=True
    )
    edge = calm.further["rbm_edge"]
    amplitude = 0.5 * np.ptp(edge, axis=1)
    # First mass moment of the blade times gravity: 3.5 MN m (docs/turbine.md).
    np.testing.assert_allclose(amplitude, 3.54e6, rtol=0.01)
    assert not calm.wind.any()


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"environment": "NREL5MW"}, "environment: expected one of 'flapgym/NREL5MW-v1'"),
        ({"environment": "flapgym/NREL5MWBlade-v1"}, "environment: expected one of"),
        ({"environment": SITE, "model": "nrel5mw-rated"}, "wind.field: expected a model with winds by strip"),
    ],
)
def test_what_is_no_environment_or_a_model_that_does_not_suit_it_is_refused(keywords, message):
    with pytest.raises(ValueError, match=message):
        plan(**keywords)


def test_a_shipped_agent_fits_the_same_turbine_at_a_site():
    planned = plan([], environment=SITE)
    assert load_agent("lqg", planned.model).model_hash == planned.model.hash
