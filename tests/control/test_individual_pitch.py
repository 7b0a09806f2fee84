"""Individual pitch control: its gain is the plant's, it takes off what turns with the rotor, whatever the flaps do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flapgym.control import OpenLoop, load_agent
from flapgym.control.individual_pitch import (
    CROSSOVER,
    SECOND_CROSSOVER,
    cyclic_gain,
    individual_pitch_agent,
    pitch_margin,
    second_gain,
)
from flapgym.core.multiblade import to_blades, to_components
from flapgym.envs.registration import ENVIRONMENTS
from flapgym.evaluation import plan
from flapgym.evaluation.bands import bands
from flapgym.evaluation.simulate import simulate, simulate_together
from flapgym.model import load_model
from tests.plant.plants import plant_of, rest

SHEAR = {"wind": {"inflow": {"shear_exponent": 0.2}, "turbulence_intensity": 0.0}, "pitch": True}


@pytest.fixture(scope="module")
def model():
    return load_model("nrel5mw-site")


def test_the_gain_is_what_the_plant_comes_to_under_a_cyclic_demand(model):
    plant, actions = plant_of(1, 1, 12000, model, record=False, pitch=True), 12000
    turn = model.rotor_speed * model.time_step
    # Held from sample to sample, so half a step late.
    demand = to_blades(np.array([[0.0, 0.3, -0.2]]), np.zeros(1))
    plant.reset(np.arange(1), rest(plant))
    seen = np.empty((actions, 3))
    for n in range(actions):
        demand = to_blades(np.array([[0.0, 0.3, -0.2]]), turn * (n + np.array([0.5])))
        told = plant.step(np.concatenate([np.zeros((1, 3)), demand], axis=1)).last
        seen[n] = to_components(told[0, plant.quantities.last["rbm"]], turn * (n + 1))
    expected = cyclic_gain(model, model.pitch_actuator) @ [0.3, -0.2] * model.pitch_actuator.angle_limit
    # Over the last whole turns: the tower still rings.
    np.testing.assert_allclose(seen[-7344:, 1:].mean(axis=0), expected, rtol=3e-3)


def test_the_gain_twice_a_turn_is_what_the_plant_comes_to(model):
    plant, actions = plant_of(1, 1, 12000, model, record=False, pitch=True), 12000
    turn = model.rotor_speed * model.time_step
    plant.reset(np.arange(1), rest(plant))
    seen = np.empty((actions, 3))
    for n in range(actions):
        demand = to_blades(np.array([[0.0, 0.3, -0.2]]), turn * (n + np.array([0.5])), 2)
        told = plant.step(np.concatenate([np.zeros((1, 3)), demand], axis=1)).last
        seen[n] = to_components(told[0, plant.quantities.last["rbm"]], turn * (n + 1), 2)
    # Over whole turns: what the tower makes of it whirls the other way, and comes to six times a turn.
    found = seen[-7344:, 1:].mean(axis=0) @ [1.0, 1j]
    expected = second_gain(model, model.pitch_actuator) * (0.3 - 0.2j) * model.pitch_actuator.angle_limit
    assert abs(found - expected) < 5e-3 * abs(expected)


def test_a_moment_twice_a_turn_alone_makes_the_demand_computed_by_hand(model):
    """Each action asks for as much more as the crossover times the interval takes off, at twice the azimuth."""
    both = individual_pitch_agent("pitch", model, 0.3, forgetting=1e9, second=0.1)
    # What the other's notch let by until it had settled would stay in its integral.
    agent = replace(both, gain=both.gain * np.array([0, 1])[:, None, None])
    moment, begun, actions = 2e5 * np.exp(0.7j), 0.4, 400
    azimuths = begun + model.rotor_speed * agent.interval * np.arange(actions)
    of_blades = 2.0 * np.pi / 3.0 * np.arange(3)
    state, asked = None, np.empty((actions, 3))
    for n, azimuth in enumerate(azimuths):
        # M_2c cos + M_2s sin of twice each blade's azimuth, in the environment's MN m.
        rbm = np.real(moment * np.exp(-2j * (azimuth + of_blades))) / 1e6
        seen = np.concatenate([np.zeros(3), rbm, [np.cos(azimuth), np.sin(azimuth)]])
        action, state = agent.predict(seen, state)
        asked[n] = action[3:] * model.pitch_actuator.angle_limit
    # The demand holds over the action, in whose middle the rotor has turned on by half of it.
    middle = azimuths[:, None] + 0.5 * model.rotor_speed * agent.interval + of_blades
    pattern = 2.0 / 3.0 * (asked * np.exp(2j * middle)).sum(axis=1)
    growth = (pattern[-1] - pattern[200]) / (actions - 201)
    expected = -0.1 * agent.interval * moment / second_gain(model, model.pitch_actuator)
    assert abs(growth - expected) < 1e-3 * abs(expected)


def test_what_comes_twice_a_turn_falls_and_once_a_turn_stays(model):
    """In turbulence the load twice a turn is as wide as one eddy lasts, and the integral takes its middle."""
    (site,) = (entry for entry in ENVIRONMENTS if entry.id == "flapgym/NREL5MWPitch-v0")
    settings = {name: value for name, value in site.keywords.items() if name != "model"}
    agents = [load_agent(name, model) for name in ("individual_pitch", "individual_pitch_2p")]
    found = [
        bands(np.moveaxis(record.rbm, 1, 2), record.time_step, model.rotor_speed)
        for record in simulate_together(agents, model, [31, 32], 90.0, **settings)
    ]
    once, twice = (
        np.sqrt(np.mean(getattr(found[1], name) ** 2) / np.mean(getattr(found[0], name) ** 2))
        for name in ("once", "twice")
    )
    assert once == pytest.approx(1.0, abs=0.02)
    assert twice < 0.75


def test_in_shear_alone_the_moment_once_a_turn_goes(model):
    """An integral leaves no steady tilt and yaw, but for what it forgets."""
    crossover, forgetting = 0.3, 200.0
    agent = individual_pitch_agent("pitch", model, crossover, forgetting=forgetting)
    still, steered = (simulate(each, model, [0], 150.0, **SHEAR) for each in (OpenLoop(), agent))

    def cyclic(record):
        turn = model.rotor_speed * model.time_step
        azimuth = record.azimuth[0] + turn * np.arange(1, record.rbm.shape[1] + 1)
        return np.hypot(*to_components(record.rbm[0], azimuth)[-3672:, 1:].mean(axis=0))

    assert cyclic(steered) / cyclic(still) == pytest.approx(1.0 / (1.0 + crossover * forgetting), rel=0.05)


@pytest.mark.parametrize("second", [0.0, 0.1])
def test_the_same_agent_in_a_batch_and_alone_acts_alike(model, second):
    agent = individual_pitch_agent("pitch", model, 0.3, load_agent("lqg", model), second=second)
    rng = np.random.default_rng(0)
    size = 3 + 3 + 3 + 2
    observations = rng.uniform(-1.0, 1.0, (4, 2, size)).astype(np.float32)
    batch, alone = None, [None, None]
    for n, observation in enumerate(observations):
        start = np.array([n == 0, n in (0, 2)])
        actions, batch = agent.predict(observation, batch, start)
        for row in range(2):
            action, alone[row] = agent.predict(observation[row], None if start[row] else alone[row])
            np.testing.assert_allclose(actions[row], action, atol=1e-6)


def test_the_flaps_agent_acts_as_it_does_alone_where_pitch_stays(model):
    """With next to no crossover pitch does nothing, and the flaps' part of the record is theirs alone."""
    lqg = load_agent("lqg", model)
    both = individual_pitch_agent("both", model, 1e-12, lqg)
    first, second = simulate_together([lqg, both], model, [1], 10.0, pitch=True)
    np.testing.assert_allclose(second.rbm, first.rbm, atol=1.0)


def test_it_is_refused_where_pitch_stays(model):
    with pytest.raises(
        ValueError, match=r"^agent pitch: moves the blades' pitch; take an environment with pitch=True"
    ):
        simulate(individual_pitch_agent("pitch", model, 0.3), model, [0], 1.0)


def test_a_model_without_pitch_is_refused():
    with pytest.raises(ValueError, match=r"^individual_pitch: expected a model with pitch as an input"):
        individual_pitch_agent("pitch", load_model("nrel5mw-corrected"), 0.3)


def test_there_is_no_margin_of_pitch_on_a_model_without_it(model):
    agent = individual_pitch_agent("pitch", model, 0.3)
    with pytest.raises(ValueError, match=r"^pitch_margin: expected a model with pitch as an input"):
        pitch_margin(load_model("nrel5mw-corrected"), agent)


@pytest.mark.parametrize(
    "given, name",
    [({"crossover": 0.0}, "crossover"), ({"forgetting": -1.0}, "forgetting"), ({"second": -0.1}, "second")],
)
def test_gains_that_are_none_are_refused_by_name(model, given, name):
    with pytest.raises(ValueError, match=rf"^individual_pitch\.{name}: expected"):
        individual_pitch_agent("pitch", model, **({"crossover": 0.3} | given))


def test_the_margin_vanishes_at_the_gain_at_which_the_simulated_loop_begins_to_grow(model):
    agent = individual_pitch_agent("pitch", model, 0.3)
    gains = np.linspace(4.0, 7.0, 31)
    margins = [pitch_margin(model, replace(agent, gain=agent.gain * gain)).alpha for gain in gains]
    least = gains[int(np.argmin(margins))]
    assert min(margins) < 0.1
    faint = {"turbulence_intensity": 1e-3}
    for factor, grows in ((0.85, False), (1.2, True)):
        steered = replace(agent, gain=agent.gain * least * factor)
        pitch = np.abs(simulate(steered, model, [0], 120.0, pitch=True, wind=faint).pitch_angle[0])
        assert (pitch[-4000:].max() > 3.0 * pitch[4000:8000].max()) == grows


@pytest.mark.parametrize("factor, grows", [(0.9, False), (1.1, True)])
def test_the_margin_vanishes_at_the_gain_twice_a_turn_at_which_both_loops_begin_to_grow(model, factor, grows):
    both = individual_pitch_agent("pitch", model, 0.3, second=0.2)

    def at(gain):
        return replace(both, gain=both.gain * np.array([1.0, gain])[:, None, None])

    gains = np.linspace(5.0, 8.0, 31)
    margins = [pitch_margin(model, at(gain)).alpha for gain in gains]
    least = gains[int(np.argmin(margins))]
    assert min(margins) < 0.05
    faint = {"turbulence_intensity": 1e-3}
    pitch = np.abs(simulate(at(least * factor), model, [0], 120.0, pitch=True, wind=faint).pitch_angle[0])
    assert (pitch[-4000:].max() > 2.0 * pitch[4000:8000].max()) == grows


def test_the_margin_of_both_is_not_above_that_of_either(model):
    both = individual_pitch_agent("pitch", model, 0.3, second=0.4)
    once, twice = (replace(both, gain=both.gain * np.array(of)[:, None, None]) for of in ((1, 0), (0, 1)))
    found = pitch_margin(model, both).alpha
    assert found <= min(pitch_margin(model, once).alpha, pitch_margin(model, twice).alpha)


def test_what_goes_by_name_is_the_rule_of_the_model(model):
    made = individual_pitch_agent("individual_pitch+lqg", model, CROSSOVER, load_agent("lqg", model))
    named = load_agent("individual_pitch+lqg", model)
    np.testing.assert_array_equal(named.gain, made.gain)
    assert (named.name, named.beside.name, named.observe) == (made.name, "lqg", made.observe)
    assert load_agent("individual_pitch", model).beside.name == "open_loop"


def test_what_goes_by_the_name_of_twice_a_turn_has_its_integral(model):
    made = individual_pitch_agent("individual_pitch_2p", model, CROSSOVER, second=SECOND_CROSSOVER)
    np.testing.assert_array_equal(load_agent("individual_pitch_2p", model).gain, made.gain)
    beside = load_agent("individual_pitch_2p+pd", model)
    assert (beside.name, beside.beside.name) == ("individual_pitch_2p+pd", "pd")
    np.testing.assert_array_equal(beside.gain[0], load_agent("individual_pitch+pd", model).gain[0])


@pytest.mark.parametrize(
    "name",
    ["individual_pitch+", "individual_pitch_2p+", "individual_pitch+individual_pitch_2p"],
)
def test_behind_the_plus_stands_an_agent_of_the_flaps(model, name):
    with pytest.raises(ValueError, match=r"expected an agent of the flaps behind the \+$"):
        load_agent(name, model)


def test_a_comparison_refuses_it_before_any_work_where_pitch_stays():
    with pytest.raises(ValueError, match=r"^agent individual_pitch: moves the blades' pitch"):
        plan(["individual_pitch"], environment="flapgym/NREL5MWSite-v0")
