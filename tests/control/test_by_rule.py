"""Shipped designs at other wind speeds have their margin there, and are softer only where it asks for it."""

from dataclasses import fields

import numpy as np
import pytest

from flapgym.control import agent_design, load_agent
from flapgym.control.by_rule import MARGIN, RULED, agent_by_rule
from flapgym.control.linear_loop import linear_loop
from flapgym.control.margins import disk_margin
from flapgym.control.pd import PDGains, pd_agent
from flapgym.model import load_model, load_model_set

FAST = load_model_set("nrel5mw-range").at(21.0)
SITE = load_model("nrel5mw-site")


@pytest.mark.parametrize("name", ["pd", "individual_flap", "lqg_saturating", "lqg_field_multiblade"])
def test_a_design_at_another_wind_speed_has_the_margin(name):
    agent = load_agent(name, FAST)
    assert agent.model_hash == FAST.hash
    assert disk_margin(FAST, agent.system).alpha >= MARGIN


def test_every_shipped_design_has_a_rule():
    for name in RULED:
        assert agent_design(name, SITE)


def test_the_rule_on_a_model_that_a_set_was_made_for_is_not_asked():
    assert load_agent("pd", SITE).model_hash == SITE.hash
    assert linear_loop(load_agent("pd", SITE), SITE).margin.alpha == pytest.approx(
        agent_design("pd", SITE)["disk_margin"], rel=1e-3
    )


def test_gains_too_high_are_halved_until_the_loop_has_the_margin():
    """The servo's stiffness stays, so the moment's entry tells the share that is left."""
    design = agent_design("pd", SITE)
    eager = {**design, "proportional": 16.0 * design["proportional"]}
    asked = pd_agent("asked", FAST, PDGains(**{each.name: eager[each.name] for each in fields(PDGains)}))
    agent = agent_by_rule("pd", FAST, eager)
    halvings = np.log2(asked.system.D[0, 0] / agent.system.D[0, 0])
    assert halvings == pytest.approx(round(halvings))
    assert halvings >= 1
    assert disk_margin(FAST, agent.system).alpha >= MARGIN
