"""Predictive control: the LQG where no stop is in sight, an independent optimum where one is; preview as knowledge."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.optimize import lsq_linear, minimize

from flapgym.control import (
    PredictiveController,
    Weights,
    agent_design,
    design_model,
    field_design,
    load_agent,
    lqg_agent,
    stability,
)
from flapgym.control.horizon import condense, innovations
from flapgym.control.lqg import regulator_gain, with_actuator
from flapgym.core.state_space import StateSpace
from flapgym.evaluation import measure, simulate
from flapgym.evaluation.simulate import coming_wind
from flapgym.model import load_model
from flapgym.wind import Inflow, Kaimal, von_karman_filter
from tests.synthetic import synthetic_model

MODEL = synthetic_model()
STOPS = MODEL.flaps[0]
GENTLE = Weights(0.05)
FIERCE = Weights(30.0, 1.0, 1.0, 0.05)
QUICK = Weights(30.0, 1.0, 0.01, 0.05)
"""Acceleration weighs so little that offsets of a blade's flaps cost unequally, and together other than alone."""
BRISK = Weights(100.0, 1.0, 36.0, 2.0)
"""An observer that leans on the filter's peaks, with a load it can lower at once."""
FIELD, INFLOW = Kaimal(turbulence_class="B"), Inflow(shear_exponent=0.2, tower_shadow=True)
"""Those of `NREL5MWSite-v0`, for which `lqg_field` is made."""
STEPS = 25
ONES = (1,) * STEPS


def _by_hand(design, weights, z, w):
    """The finite-horizon problem in all accelerations u: cost |rows u - rights|^2, stops |bounds + limits u| <= 1.

    Nothing of the regulator's law enters but its Riccati matrix as terminal cost. Of several flaps the mean counts.
    """
    a, b, c = with_actuator(design)
    _, terminal = regulator_gain(design, weights)
    n, flaps = a.shape[0], design.channels.flaps
    # Of several white inputs none is known: what the state says of them is all.
    drive = np.concatenate([design.G[:, 0], np.zeros(2 * flaps)])
    root = np.linalg.cholesky(terminal + 1e-12 * np.trace(terminal) * np.eye(n)).T
    free, forced = z.copy(), np.zeros((n, STEPS * flaps))
    rows, rights, limits, bounds = [], [], [], []
    priced = [
        (weights.rbm, c[0]),
        *((weights.flap_angle / flaps, np.eye(n)[n - 2 * flaps + i]) for i in range(flaps)),
    ]
    for k in range(STEPS):
        for weight, row in priced:
            rows.append(np.sqrt(weight) * row @ forced)
            rights.append(-np.sqrt(weight) * row @ free)
        rows += list(
            np.sqrt(weights.acceleration / flaps) * np.eye(STEPS * flaps)[k * flaps : (k + 1) * flaps]
        )
        rights += [0.0] * flaps
        free = a @ free + drive * (w[k] if k < w.size else 0.0)
        forced = a @ forced
        forced[:, k * flaps : (k + 1) * flaps] += b
        limits += list(forced[-2 * flaps :])
        bounds += list(free[-2 * flaps :])
    rows, rights = np.vstack([np.array(rows), root @ forced]), np.concatenate([rights, -root @ free])
    return rows, rights, np.array(limits), np.array(bounds)


def _first_action(horizon, z, w):
    import daqp

    p = horizon.from_state @ z + horizon.from_wind @ w
    blocks, flaps = horizon.from_offsets.shape[1], len(horizon.gain)
    d, _, flag, _ = daqp.solve(
        np.eye(blocks),
        np.zeros(blocks),
        horizon.from_offsets,
        1.0 - p,
        -1.0 - p,
        np.zeros(p.size, dtype=np.int32),
    )
    assert flag == 1
    action = -horizon.gain @ z + horizon.preview_gain @ w + horizon.first_offset @ d[:flaps]
    return action, np.abs(d).max()


def _turning_wind(model):
    """Turbulence and a peak once a turn, each driven by a white input of its own, as a turning blade meets a field."""
    slow = von_karman_filter(
        model.wind_speed, model.turbulence_intensity, model.length_scale, model.time_step, 3
    )
    turn = model.rotor_speed * model.time_step
    peak = 0.9995 * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return StateSpace(
        A=block_diag(slow.A, peak),
        B=block_diag(slow.B, 0.02 * np.eye(2)),
        C=np.hstack([slow.C, [[1.0, 0.0]]]),
        D=np.hstack([slow.D, np.zeros((1, 2))]),
        time_step=model.time_step,
        inputs=("slow", "cosine", "sine"),
        outputs=("wind",),
    )


def _case(preview, flaps, weights, size, monkeypatch, turning=False):
    """A programme with every step's stops and offsets, and a state and coming wind to solve it for."""
    monkeypatch.setattr("flapgym.control.horizon.CONSTRAINED", ((STEPS, 1),))
    model = synthetic_model(flaps=flaps)
    design = design_model(model, disturbance=_turning_wind(model) if turning else None)
    rng = np.random.default_rng(3)
    z = size * np.concatenate([rng.standard_normal(design.A.shape[0]), [0.2] * flaps, [0.15] * flaps])
    return condense(design, weights, preview, ONES), z, size * rng.standard_normal(preview), design


@pytest.mark.parametrize(("flaps", "weights"), [(1, FIERCE), (3, FIERCE), (3, QUICK)])
@pytest.mark.parametrize(("preview", "turning"), [(0, False), (10, False), (0, True)])
def test_free_of_stops_the_optimum_written_out_is_the_regulators(
    preview, turning, flaps, weights, monkeypatch
):
    horizon, z, w, design = _case(preview, flaps, weights, 0.02, monkeypatch, turning)
    rows, rights, _, _ = _by_hand(design, weights, z, w)
    action, offset = _first_action(horizon, z, w)
    assert offset == 0.0
    np.testing.assert_allclose(action, np.linalg.lstsq(rows, rights)[0][:flaps], rtol=1e-6)


@pytest.mark.parametrize(("flaps", "weights"), [(1, FIERCE), (3, FIERCE), (3, QUICK)])
@pytest.mark.parametrize(("preview", "turning"), [(0, False), (10, False), (0, True)])
def test_at_the_stops_the_condensed_optimum_is_the_one_written_out(
    preview, turning, flaps, weights, monkeypatch
):
    # Where the first accelerations of some flaps are free, their shares of what others cannot do show.
    size = 1.5 if weights is FIERCE else 0.3
    horizon, z, w, design = _case(preview, flaps, weights, size, monkeypatch, turning)
    rows, rights, limits, bounds = _by_hand(design, weights, z, w)
    solved = minimize(
        lambda u: 0.5 * np.sum((rows @ u - rights) ** 2),
        lsq_linear(rows, rights, (-1.0, 1.0)).x,
        jac=lambda u: rows.T @ (rows @ u - rights),
        bounds=[(-1.0, 1.0)] * (STEPS * flaps),
        constraints=[
            {"type": "ineq", "fun": lambda u: 1.0 - bounds - limits @ u, "jac": lambda u: -limits},
            {"type": "ineq", "fun": lambda u: 1.0 + bounds + limits @ u, "jac": lambda u: limits},
        ],
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 500},
    )
    action, offset = _first_action(horizon, z, w)
    assert offset > 0.1
    np.testing.assert_allclose(action, solved.x[:flaps], atol=1e-4)


def test_without_a_stop_in_sight_it_is_the_lqg_for_any_horizon_and_blocks():
    """Actions pass as float32, which is what the tolerance is for."""
    lqg = simulate(lqg_agent("lqg", MODEL, GENTLE), MODEL, range(3), 20.0)
    assert np.abs(lqg.flap_angle).max() < 0.9 * STOPS.angle_limit
    for blocks in ((1, 1, 2, 4), (5, 20, 50)):
        mpc = simulate(PredictiveController("mpc", MODEL, GENTLE, blocks=blocks), MODEL, range(3), 20.0)
        np.testing.assert_allclose(mpc.flap_angle, lqg.flap_angle, atol=1e-6 * np.abs(lqg.flap_angle).max())


def _march(agent, loads, model=MODEL):
    """Flap motion under random loads without any stop in the actuator, in fractions of the limits."""
    limits = {
        kind: np.tile([getattr(flap, f"{kind}_limit") for flap in model.flaps], 3)
        for kind in ("angle", "rate", "acceleration")
    }
    dt, state, motion = model.time_step, None, []
    angle, rate = np.zeros((2, 3 * len(model.flaps)))
    for load in loads:
        action, state = agent.predict(np.concatenate([load, angle, rate]), state)
        acceleration = action.astype(float) * limits["acceleration"]
        angle, rate = angle + dt * rate + 0.5 * dt**2 * acceleration, rate + dt * acceleration
        motion.append(np.concatenate([angle / limits["angle"], rate / limits["rate"]]))
    return np.array(motion)


def test_it_never_asks_the_flap_beyond_its_stops():
    """Nothing holds this flap but the plan: the LQG of the same weights leaves its stops at once."""
    rng = np.random.default_rng(0)
    slow = np.cumsum(rng.standard_normal((1500, 3)), axis=0) * 0.1
    motion = _march(PredictiveController("mpc", MODEL, FIERCE), slow)
    assert np.abs(motion).max() <= 1.0 + 1e-5
    assert np.abs(motion[:, :3]).max() > 0.999
    assert np.abs(_march(lqg_agent("lqg", MODEL, FIERCE), slow)).max() > 1.5


@pytest.fixture(scope="module", params=["nrel5mw-site", "nrel5mw-three-flaps"])
def at_a_site(request):
    """A model of one or of three flaps a blade, and the design model of one blade in the field and the shear."""
    model = load_model(request.param)
    return model, field_design(model, FIELD, INFLOW, multiblade=False)


def test_with_a_fields_design_and_no_stop_in_sight_it_is_the_shipped_lqg_of_the_field(at_a_site):
    """Actions pass as float32, which is what the tolerance is for. Weak wind keeps every stop out of sight."""
    model, design = at_a_site
    kept = agent_design("lqg_field", model)
    weights = Weights(*(kept[key] for key in ("rbm", "flap_angle", "acceleration", "measurement_noise")))
    agents = PredictiveController("mpc", model, weights, design=design), load_agent("lqg_field", model)
    calm = {"field": {"kind": "von_karman", "turbulence_intensity": 0.02}}
    ours, theirs = (simulate(agent, model, range(2), 10.0, wind=calm).flap_angle for agent in agents)
    assert 0.1 < np.abs(theirs).max() / model.flaps[0].angle_limit < 0.5
    np.testing.assert_allclose(ours, theirs, atol=1e-5 * np.abs(theirs).max())


def test_with_a_fields_design_it_never_asks_a_flap_beyond_its_stops(at_a_site):
    """Nothing holds these flaps but the plan: the LQG of the same weights leaves its stops."""
    model, design = at_a_site
    rng = np.random.default_rng(0)
    slow = model.rbm_rms / 1e6 * np.cumsum(rng.standard_normal((1200, 3)), axis=0) * 0.1
    motion = _march(PredictiveController("mpc", model, BRISK, design=design), slow, model)
    angles = motion.shape[1] // 2
    assert np.abs(motion).max() <= 1.0 + 1e-5
    assert np.abs(motion[:, :angles]).max() > 0.999
    assert np.abs(_march(lqg_agent("lqg", model, BRISK, design), slow, model)).max() > 1.2


def test_a_flap_no_plan_can_keep_within_its_stops_is_braked():
    agent = PredictiveController("mpc", MODEL, FIERCE)
    lost = np.concatenate([np.zeros(3), [0.99 * STOPS.angle_limit] * 3, [0.9 * STOPS.rate_limit] * 3])
    action, _ = agent.predict(lost)
    np.testing.assert_array_equal(action, -1.0)


def test_the_filter_is_inverted():
    wind = von_karman_filter(11.0, 0.1, 147.0, MODEL.time_step, 3)
    rng = np.random.default_rng(0)
    white, start = rng.standard_normal((40, 1)), rng.standard_normal(3)
    output = wind.simulate(np.vstack([white, np.zeros((1, 1))]), start)[1:, 0]
    from_output, from_state = innovations(wind, 40)
    np.testing.assert_allclose(from_output @ output + from_state @ start, white[:, 0], atol=1e-9)


def test_preview_of_the_wind_that_is_expected_anyway_changes_nothing():
    """The first sample tells the observer nothing new either, so a second step is the same too."""
    plain, told = (PredictiveController("mpc", MODEL, FIERCE, preview) for preview in (0, 30))
    wind = von_karman_filter(11.0, 0.1, 147.0, MODEL.time_step, 3)
    scale = design_model(MODEL).scale[:3]
    rng = np.random.default_rng(1)
    state, same = None, None
    for _ in range(3):
        observation = 0.1 * rng.standard_normal(9)
        observation[:9] = np.repeat(observation[:9:3], 3)
        before = plain._start @ (observation[:9:3] * [1e6, 1.0, 1.0]) if state is None else state[0]
        expected = wind.simulate(np.zeros((31, 1)), before[:3] * scale)[1:, 0]
        action, state = plain.predict(observation, state)
        aware, same = told.predict(np.concatenate([observation, expected]), same)
        np.testing.assert_allclose(aware, action, atol=1e-5)


def test_knowing_the_wind_before_it_comes_lowers_the_load():
    seeds, ours = range(4), {}
    for preview in (0, 15, 70):
        agent = PredictiveController("mpc", MODEL, FIERCE, preview)
        assert stability(MODEL, agent.unconstrained).spectral_radius < 1.0
        ours[preview] = measure(simulate(agent, MODEL, seeds, 20.0)).rbm_rms.mean()
    assert ours[70] < ours[15] < 0.98 * ours[0]


def test_the_wind_told_is_the_wind_met():
    record = simulate(lqg_agent("lqg", MODEL, GENTLE), MODEL, [5, 6], 3.0)
    coming = coming_wind(MODEL, [5, 6], record.wind.shape[1])
    np.testing.assert_allclose(coming, record.wind, atol=1e-9)


class _Listener:
    """Notes the wind it meets and the wind it is told of."""

    name, observe, steps_per_action, model_hash, preview = "listener", ("wind",), 1, None, 3

    def __init__(self):
        self.heard = []

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        self.heard.append(np.array(observation))
        return np.zeros((len(observation), 3), dtype=np.float32), None


def test_the_first_sample_told_is_that_of_the_next_step():
    listener = _Listener()
    simulate(listener, MODEL, [5, 6], 0.5)
    heard = np.array(listener.heard)
    np.testing.assert_allclose(heard[:-1, :, 1], heard[1:, :, 0], atol=1e-6)
    np.testing.assert_allclose(heard[:-2, :, 3], heard[2:, :, 1], atol=1e-6)


def test_a_batch_gives_what_each_entry_gives_alone():
    agent = PredictiveController("mpc", MODEL, FIERCE)
    observations = np.random.default_rng(0).standard_normal((6, 4, 9)) * np.repeat([2.0, 0.1, 0.1], 3)
    state, alone = None, None
    for observation in observations:
        action, state = agent.predict(observation, state)
        single, alone = agent.predict(observation[2], alone)
        np.testing.assert_allclose(action[2], single, atol=1e-6)


def test_bad_input_is_refused_by_name():
    with pytest.raises(ValueError, match="preview: expected a whole number of at least 0, got -1"):
        PredictiveController("mpc", MODEL, FIERCE, preview=-1)
    with pytest.raises(ValueError, match="9 observations.*and 5 samples of coming wind, got 9"):
        PredictiveController("mpc", MODEL, FIERCE, preview=5).predict(np.zeros(9))
    with pytest.raises(ValueError, match="design model of one blade"):
        condense(design_model(MODEL, MODEL.turbine), FIERCE, 0)
    with pytest.raises(ValueError, match="one white input for a preview, got 3"):
        condense(design_model(MODEL, disturbance=_turning_wind(MODEL)), FIERCE, 5)


def test_a_design_model_that_does_not_suit_is_refused_by_name():
    def made(design, preview=0):
        return PredictiveController("mpc", MODEL, FIERCE, preview, design=design)

    with pytest.raises(ValueError, match="agent mpc: preview: expected 0 with a design model given.*got 5$"):
        made(design_model(MODEL, disturbance=_turning_wind(MODEL)), 5)
    with pytest.raises(ValueError, match="agent mpc: design: expected 1 flap a blade.*got 3"):
        made(design_model(synthetic_model(flaps=3)))
    with pytest.raises(ValueError, match="agent mpc: design.time_step: expected 0.007"):
        made(replace(design_model(MODEL), time_step=0.01))
    with pytest.raises(ValueError, match="design model of one blade, got one of 3 blades"):
        made(design_model(MODEL, MODEL.turbine))


def test_without_its_solver_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "daqp", None)
    with pytest.raises(ImportError, match=r"pip install 'flapgym\[mpc\]'"):
        PredictiveController("mpc", MODEL, FIERCE)
