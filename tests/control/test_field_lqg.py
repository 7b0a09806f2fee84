"""The LQG for a field: its cost and rms against the drawn field's, its lead over one that believes in a gust."""

import numpy as np
import pytest
import scipy.linalg

from flapgym.control import (
    FIELD_AGENT_NAMES,
    FIELD_AGENT_SETS,
    BladeController,
    RotorController,
    Weights,
    field_lqg,
    load_agent,
    lqg_agent,
    made_for,
    synthesise,
)
from flapgym.control.field_lqg import field_design, moment_shares
from flapgym.control.margins import disk_margin
from flapgym.evaluation import compare, simulate
from flapgym.model import load_model
from flapgym.wind import BoxFile, VonKarman
from tests.loops import design_loop, priced, riccati_cost

FIELD = VonKarman()
GENTLE = Weights(rbm=0.3, acceleration=3.6, measurement_noise=0.1)
SETTLED = 2000
"""Samples after which the closed loop, which starts with calm flaps, is stationary."""


@pytest.fixture(scope="module")
def model():
    return load_model("nrel5mw-site")


@pytest.fixture(scope="module")
def design(model):
    return field_design(model, FIELD)


@pytest.fixture(scope="module")
def flown(model, design):
    """An hour in the drawn field, with the noise that the observer expects."""
    agent = lqg_agent("field", model, GENTLE, design)
    sensors = {"noise": GENTLE.measurement_noise * model.rbm_rms}
    return simulate(
        agent, model, range(400, 500), 40.0, wind={"field": {"kind": "von_karman"}}, sensors=sensors
    )


def _means(record, model):
    """Of each realisation, the mean squares of moment, angle and acceleration in the design's units, (N, 3)."""
    (flap,) = model.flaps
    acceleration = np.diff(record.flap_rate, axis=1) / model.time_step / flap.acceleration_limit
    signals = (record.rbm / 1e6, record.flap_angle / flap.angle_limit, acceleration)
    return np.stack([np.mean(each[:, SETTLED:] ** 2, axis=(1, 2)) for each in signals], axis=1)


def _assert_within_sampling_error(values, expected):
    error = values.std(ddof=1) / np.sqrt(len(values))
    assert abs(values.mean() - expected) < 4.0 * error
    assert 4.0 * error < 0.5 * expected  # so that it can fail


def test_the_measured_cost_in_the_drawn_field_is_the_riccati_value_within_sampling_error(
    model, design, flown
):
    """Stops out of reach. The design has one wind by component and four harmonics, the field has ten strips and all."""
    assert np.abs(flown.flap_angle).max() < model.flaps[0].angle_limit
    costs = _means(flown, model) @ [GENTLE.rbm, GENTLE.flap_angle, GENTLE.acceleration]
    _assert_within_sampling_error(costs, riccati_cost(design, GENTLE))


def test_the_lyapunov_rms_of_the_loop_behind_the_filter_is_that_in_the_drawn_field(model, design, flown):
    loop, drive, outputs = design_loop(design, synthesise(design, GENTLE), GENTLE)
    covariance = scipy.linalg.solve_discrete_lyapunov(loop, drive @ drive.T)
    squares = np.diag(outputs @ covariance @ outputs.T).reshape(3, 3) @ design.channels.weight
    # Moment and angle. Accelerations are of frequencies above 1 Hz, where the filter ends and the field does not.
    for measured, expected in zip(_means(flown, model).T[:2], squares[:2], strict=True):
        _assert_within_sampling_error(measured, expected)


def test_in_the_field_believing_in_a_homogeneous_gust_costs_more(model):
    """The Riccati value is the least there is: the other's cost comes from the Lyapunov equation of its own loop."""
    weights = Weights(rbm=5.0, acceleration=3.6, measurement_noise=0.1)
    ours = field_design(model, FIELD, multiblade=False)
    theirs = lqg_agent("gust", model, weights).system
    loop, drive, outputs = design_loop(ours, theirs, weights)
    covariance = scipy.linalg.solve_discrete_lyapunov(loop, drive @ drive.T)
    cost = np.diag(outputs @ covariance @ outputs.T) @ priced(ours, weights)
    assert cost > 1.05 * riccati_cost(ours, weights)


def test_one_wind_on_all_strips_is_the_homogeneous_wind(model):
    """And the shares of the strips in the moment are those of a steady collective wind, too, to a hundredth."""
    shares = moment_shares(model)
    assert shares.sum() == pytest.approx(1.0)
    collective = [f"wind{strip}_0" for strip in range(1, model.strips + 1)]
    gain = model.turbine.select(collective, ["rbm_0"]).dc_gain()[0]
    np.testing.assert_allclose(shares, gain / gain.sum(), atol=0.01)
    homogeneous = model.turbine.select(["wind"], ["rbm_0"]).dc_gain()[0, 0]
    assert gain.sum() == pytest.approx(homogeneous, rel=1e-6)


@pytest.mark.parametrize("name", FIELD_AGENT_NAMES)
@pytest.mark.parametrize("chosen", FIELD_AGENT_SETS)
def test_every_shipped_field_agent_is_found_for_its_model_and_has_the_disk_margin(chosen, name):
    model = load_model(chosen)
    agent = load_agent(name, model)
    assert isinstance(agent, BladeController | RotorController)
    assert agent.name == name
    assert made_for(agent, model)
    assert agent.flaps == len(model.flaps)
    assert disk_margin(model, agent.system).alpha >= 0.54


def test_the_shipped_field_agents_lead_at_the_site(model):
    """By name, through the environment's own wind; seeds that score nothing."""
    names = ("lqg_saturating", *FIELD_AGENT_NAMES)
    scores = compare(
        names, realisations=3, seed=7000, duration=60.0, environment="flapgym/NREL5MWSite-v0"
    ).scores
    rms = [scores[name].rbm_rms_change.mean for name in names]
    assert rms[2] < rms[1] - 0.01 < rms[0] - 0.02
    assert all(scores[name].made_for_this_model for name in names)


def test_they_fly_beside_individual_pitch(model):
    agent = load_agent(f"individual_pitch+{FIELD_AGENT_NAMES[0]}", model)
    record = simulate(agent, model, [7], 2.0, wind={"field": {"kind": "von_karman"}}, pitch=True)
    assert np.abs(record.flap_angle).max() > 1e-3


def test_what_is_no_field_or_has_no_strips_is_refused_by_name(model):
    with pytest.raises(ValueError, match="field: expected a turbulence over the disk with spectra"):
        field_lqg("field", model, "von_karman", GENTLE)
    with pytest.raises(ValueError, match="field: expected a model with winds by strip .* nrel5mw-corrected"):
        field_lqg("field", load_model("nrel5mw-corrected"), FIELD, GENTLE)
    boxes = object.__new__(BoxFile)
    with pytest.raises(ValueError, match="field: expected a turbulence over the disk with spectra"):
        field_lqg("field", model, boxes, GENTLE)
