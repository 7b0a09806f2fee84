"""The agents in the package: they load, belong to their shipped models, keep their margins and match the paper's."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.control import (
    AGENT_NAMES,
    AGENT_SETS,
    BladeController,
    RotorController,
    Weights,
    closed_loop,
    load_agent,
    lqg_agent,
    made_for,
    stationary_rms,
)
from flapgym.control.closed_loop import with_effectiveness
from flapgym.control.margins import disk_margin
from flapgym.evaluation import compare, measure, simulate
from flapgym.model import DEFAULT_MODEL, load_model
from tests.loops import radius_at_worst

TUNED = ("pd", "pid", "individual_flap", "lqg", "lqg_saturating")
WHOLE = "lqg_multiblade_saturating"


@pytest.fixture(scope="module", params=AGENT_SETS)
def model(request):
    return load_model(request.param)


@pytest.fixture(scope="module")
def papers():
    return load_model("nrel5mw-rated")


@pytest.mark.parametrize("name", AGENT_NAMES)
def test_every_named_agent_is_shipped_and_made_for_the_shipped_model(model, name):
    agent = load_agent(name, model)
    assert agent.name == name
    assert made_for(agent, model)


@pytest.mark.parametrize("name", [*TUNED, WHOLE])
def test_the_loop_on_the_whole_turbine_has_the_disk_margin_and_bears_the_gain_it_guarantees(model, name):
    """No mode, however narrow, hides between the frequencies of the margin: the gains are tried on the loop itself."""
    agent = load_agent(name, model)
    assert isinstance(agent, BladeController | RotorController)
    margin = disk_margin(model, agent.system)
    # The paper's saturating designs were chosen by a margin read on a grid; they keep 0.509 and 0.5399.
    assert margin.alpha >= (0.54 if model.name == DEFAULT_MODEL else 0.5)
    for factor in np.linspace(*margin.gain, 5):
        assert closed_loop(model, agent.system, factor).spectral_radius() < 1.0


@pytest.mark.parametrize("name", [*TUNED, WHOLE])
def test_the_worst_matrix_just_inside_the_disk_is_borne_and_one_just_outside_makes_the_loop_grow(model, name):
    agent = load_agent(name, model)
    assert isinstance(agent, BladeController | RotorController)
    margin = disk_margin(model, agent.system)
    inside, outside = (radius_at_worst(model, agent.system, margin, share) for share in (0.99, 1.01))
    assert inside < 1.0 < outside


def test_a_peak_beside_the_loops_own_modes_is_found(papers):
    """A design whose margin reads 0.54 on a grid and at its modes; a factor of 0.519 already lets it grow."""
    weights = Weights(rbm=419.8042925663985, acceleration=3600.0, measurement_noise=0.02)
    margin = disk_margin(papers, lqg_agent("heavy", papers, weights).system)
    assert margin.alpha == pytest.approx(0.509, abs=5e-4)
    assert margin.frequency == pytest.approx(1.0807, abs=1e-4)


def test_the_limit_respecting_lqg_is_near_the_papers_reductions(papers):
    """-22 % and -23 % in the paper; -22.9 % and -28.4 % in a trial with the scaled flap that ours has."""
    rms, open_loop = stationary_rms(papers, load_agent("lqg", papers).system), stationary_rms(papers)
    assert rms["rbm"] / open_loop["rbm"] - 1.0 == pytest.approx(-0.21, abs=0.04)
    assert rms["tip_deflection"] / open_loop["tip_deflection"] - 1.0 == pytest.approx(-0.26, abs=0.05)


def test_the_saturating_lqg_stays_within_the_stops_and_reduces_twice_as_much(model):
    names = ("lqg", "lqg_saturating", WHOLE)
    metrics = {name: measure(simulate(load_agent(name, model), model, range(50, 54), 60.0)) for name in names}
    reference = measure(simulate(load_agent("open_loop", model), model, range(50, 54), 60.0))
    change = {name: np.mean(each.rbm_rms / reference.rbm_rms) - 1.0 for name, each in metrics.items()}
    assert change[WHOLE] < change["lqg_saturating"] < 1.6 * change["lqg"] < 0.0
    for each in metrics.values():
        assert each.flap_angle_max.max() <= model.flaps[0].angle_limit * (1.0 + 1e-12)
        assert each.flap_rate_max.max() <= model.flaps[0].rate_limit * (1.0 + 1e-12)


def test_individual_flap_control_takes_a_steady_tilting_moment_away(model):
    """One plus the answer to what is added to a measurement is what is left of a moment that stays."""
    left = {}
    for name in ("pid", "individual_flap"):
        loop = closed_loop(model, load_agent(name, model).system)
        answer = loop.select(["noise_c", "noise_s"], ["rbm_c", "rbm_s"]).dc_gain()
        left[name] = np.linalg.norm(np.eye(2) + answer, ord=2)
    assert left["individual_flap"] < 0.1 < 0.7 < left["pid"] < 1.0


def test_half_the_flaps_effect_shows_in_the_shipped_agents_table(model):
    weak = replace(model, turbine=with_effectiveness(model.turbine, 0.5))
    full, half = (
        compare(
            [f"{model.name}/{name}" for name in ("pd", "lqg")], each, realisations=2, duration=30.0
        ).scores
        for each in (model, weak)
    )
    for name in ("pd", "lqg"):
        ratio = half[name].rbm_rms_change.mean / full[name].rbm_rms_change.mean
        assert 0.4 < ratio < 0.7
        assert not half[name].made_for_this_model
