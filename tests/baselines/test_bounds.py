"""What no controller can beat: checked against brute force, other solvers, the environment and agents."""

import json
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest
from scipy.optimize import linprog, minimize

from baselines.bounds.bound import PlannedMotion, bound, least_fatigue, least_rms, realisations
from baselines.bounds.certificate import least, linear_bound, multipliers, value_of
from baselines.bounds.chain import solve_chain
from baselines.bounds.metrics import Swings, equivalent_load, rms, swing_load, worst_chain
from baselines.bounds.optimum import plan
from baselines.bounds.response import response_of
from flapgym.control import OpenLoop, load_agent
from flapgym.envs.registration import ENVIRONMENTS
from flapgym.evaluation import damage_equivalent_load, measure, simulate
from flapgym.model.turbine_model import load_model

SEED = 2_000_011
KEYWORDS = {entry.id.split("/")[1]: dict(entry.keywords) for entry in ENVIRONMENTS}


def _made(name, duration):
    keywords = dict(KEYWORDS[name])
    model = load_model(keywords.pop("model"))
    (one,) = realisations(model, keywords, [SEED], duration)
    return model, keywords, one


@pytest.fixture(scope="module")
def field():
    return _made("NREL5MWField-v0", 10.0)


@pytest.fixture(scope="module")
def calm(field):
    return least_rms(field[2])


@pytest.fixture(scope="module")
def tiny():
    """Less than a second: few enough variables for any solver."""
    return _made("NREL5MWField-v0", 0.7)[2]


def _matrix(programme):
    """Moments (3 T, n) of each variable alone, by running the response."""
    size = np.prod(programme.shape)
    columns = [
        programme.total(programme.motion(unit.reshape(programme.shape))) - programme.free
        for unit in np.eye(size)
    ]
    return np.array([each.ravel() for each in columns]).T


@pytest.mark.parametrize("name", ["NREL5MWSite-v0", "NREL5MWThreeFlaps-v0", "NREL5MWPitch-v0"])
def test_a_plan_played_in_the_environment_has_the_programmes_moments(name):
    model, keywords, one = _made(name, 2.0)
    programme, metric = one.programme(), rms(one.free)
    best = plan(programme, programme.solve(metric, iterations=10).variables)
    record = simulate(PlannedMotion([best], one.pitch), model, [SEED], 2.0, **keywords)
    promised = programme.total(best.motion)
    assert np.abs(record.rbm[0] - promised).max() <= 1e-6 * np.abs(promised).max()


def test_the_pull_is_the_adjoint_of_the_moments():
    response = response_of(load_model("nrel5mw-site"), True, 0.7, 300, 10)
    random = np.random.default_rng(0)
    motion = random.standard_normal((response.intervals, 3, 3, 2))
    weights = random.standard_normal((300, 3))
    there, back = np.sum(response.moments(motion) * weights), np.sum(response.pull(weights) * motion)
    assert there == pytest.approx(back, rel=1e-9)


def test_the_least_rms_is_that_of_another_solver(tiny):
    programme = tiny.programme()
    of_each, free = _matrix(programme), tiny.free
    still = np.sqrt(np.mean(free**2, axis=0))
    units = np.eye(of_each.shape[1]).reshape(-1, *programme.shape)
    shares = np.array([(programme.motion(each) / programme.limits).ravel() for each in units]).T
    shares = shares[np.abs(shares).any(axis=1)]

    def of(x):
        moments = (free.ravel() + of_each @ x).reshape(free.shape)
        value = np.sqrt(np.mean(moments**2, axis=0))
        slope = (moments / (moments.size * value * still)).ravel() @ of_each
        return np.mean(value / still), slope

    found = minimize(
        of,
        np.zeros(of_each.shape[1]),
        jac=True,
        method="SLSQP",
        bounds=[(-1.0, 1.0)] * of_each.shape[1],
        constraints=[
            {"type": "ineq", "fun": lambda x: 1.0 - shares @ x, "jac": lambda x: -shares},
            {"type": "ineq", "fun": lambda x: 1.0 + shares @ x, "jac": lambda x: shares},
        ],
        options={"maxiter": 200, "ftol": 1e-12},
    )
    assert found.success
    metric = rms(free)
    point = programme.solve(metric, prices=(1.0,) * 12, iterations=100)
    best = programme.total(programme.motion(point.variables))
    assert metric(best)[0] == pytest.approx(found.fun, abs=2e-4)
    assert least(metric, best, free, programme.response) <= found.fun


def test_with_stops_out_of_reach_nothing_but_least_squares_is_left(tiny):
    small = replace(tiny, free=1e-3 * tiny.free)
    programme = small.programme()
    of_each = _matrix(programme)
    solution = np.linalg.lstsq(of_each, -small.free.ravel(), rcond=None)[0]
    left = (small.free.ravel() + of_each @ solution).reshape(small.free.shape)

    def square(moments):
        return float(np.mean(moments**2) / np.mean(small.free**2)), 2.0 * moments / small.free.size / np.mean(
            small.free**2
        )

    exact = square(left)[0]
    assert least(square, left, small.free, programme.response) == pytest.approx(exact, abs=1e-6)


def test_a_linear_programme_is_bounded_as_another_solver_has_it():
    response = response_of(load_model("nrel5mw-site"), True, 0.0, 300, 10)
    random = np.random.default_rng(1)
    for actuator in response.actuators:
        count = response.intervals
        pull = random.standard_normal((count, 3)) / actuator.limits
        rows = np.zeros((2 * (count - 1), 3 * count))
        for k in range(count - 1):
            rows[2 * k : 2 * k + 2, 3 * k : 3 * k + 3] = np.hstack([actuator.drive[:, None], actuator.march])
            rows[2 * k : 2 * k + 2, 3 * k + 4 : 3 * k + 6] = -np.eye(2)
        limits = np.tile(actuator.limits, count)
        limits[1:3] = 0.0
        bounds = np.stack([-limits, limits], axis=1)
        exact = linprog(pull.ravel(), A_eq=rows, b_eq=np.zeros(len(rows)), bounds=bounds).fun
        assert linear_bound(pull, actuator) == pytest.approx(exact, rel=1e-6)
        assert linear_bound(pull, actuator) <= exact + 1e-9 * abs(exact)


def test_any_multipliers_bound_any_motion_from_below():
    response = response_of(load_model("nrel5mw-site"), True, 0.0, 300, 10)
    random = np.random.default_rng(2)
    for actuator in response.actuators:
        pull, other = random.standard_normal((2, response.intervals, 3))
        pull /= actuator.limits
        good = multipliers(pull, actuator)
        for wanted in (-other, other, pull * actuator.limits):
            motion = solve_chain(actuator, wanted)[0] * actuator.limits
            for spread in (0.0, 0.1, 1.0, 10.0):
                drawn = good + spread * np.abs(good).max() * random.standard_normal(good.shape)
                # To the tolerance to which a solver's motion is feasible.
                assert value_of(drawn, pull, actuator) <= np.sum(pull * motion) + 1e-5


def _histories():
    random = np.random.default_rng(3)
    for size in (2, 3, 5, 8, 20, 60, 200):
        for _ in range(20):
            yield random.standard_normal(size) if size % 2 else np.cumsum(random.standard_normal(size))


def test_no_chain_of_instants_does_more_damage_than_rainflow_counts():
    random = np.random.default_rng(4)
    for history in _histories():
        counted = damage_equivalent_load(history, 0.01)
        chains = [worst_chain(history)]
        for _ in range(10):
            chosen = np.sort(random.choice(history.size, random.integers(2, history.size + 1), replace=False))
            chains.append(Swings(chosen[:-1], chosen[1:], np.full(chosen.size - 1, 0.5)))
        mixed = chains[0].mixed(chains[1], 0.3)
        three = np.stack([history] * 3, axis=1)
        for each in (*chains, mixed):
            share = swing_load(three, 0.01, [each] * 3)(three)[0]
            assert share * counted <= counted * (1.0 + 1e-12)


def test_the_worst_chain_is_the_worst_of_all():
    random = np.random.default_rng(5)
    for _ in range(20):
        history = random.standard_normal(7)
        found = worst_chain(history)
        best = 0.0
        for chosen in range(2**7):
            values = history[[place for place in range(7) if chosen >> place & 1]]
            best = max(best, 0.5 * np.sum(np.abs(np.diff(values)) ** 10.0))
        ours = np.sum(found.weight * np.abs(history[found.first] - history[found.second]) ** 10.0)
        assert ours == pytest.approx(best, rel=1e-12)


def test_slopes_of_the_metrics_are_their_differences():
    random = np.random.default_rng(6)
    reference = np.cumsum(random.standard_normal((300, 3)), axis=0)
    moments = np.cumsum(random.standard_normal((300, 3)), axis=0)
    step = 1e-6 * random.standard_normal(moments.shape)
    chains = [worst_chain(each) for each in moments.T]
    for metric in (rms(reference), equivalent_load(reference, 0.01), swing_load(reference, 0.01, chains)):
        told = np.sum(metric(moments)[1] * 2.0 * step)
        assert metric(moments + step)[0] - metric(moments - step)[0] == pytest.approx(told, rel=1e-4)


def test_agents_lie_above_the_bound(field, calm):
    model, keywords, one = field
    seeds = [SEED]
    lasting = least_fatigue(one, calm.point, rounds=5)
    agent = load_agent("ppo", model)
    ours = measure(simulate(agent, model, seeds, 10.0, **keywords))

    class Still(OpenLoop):
        steps_per_action = agent.steps_per_action

    theirs = measure(simulate(Still(), model, seeds, 10.0, **keywords))
    for name, each in (("rbm_rms", calm), ("rbm_del", lasting)):
        change = np.mean(getattr(ours, name) / getattr(theirs, name)) - 1.0
        assert each.value < each.reached < change


def test_what_is_reached_is_what_is_scored(field, calm):
    model, keywords, one = field
    record = simulate(PlannedMotion([calm.plan]), model, [SEED], 10.0, **keywords)
    scored = measure(record).rbm_rms / np.sqrt(np.mean(one.free**2, axis=0))
    assert np.mean(scored) - 1.0 == pytest.approx(calm.reached, abs=1e-6)
    loads = [damage_equivalent_load(each, model.time_step) for each in record.rbm[0].T]
    still = [damage_equivalent_load(each, model.time_step) for each in one.free.T]
    told = equivalent_load(one.free, model.time_step)(record.rbm[0])[0]
    assert told == pytest.approx(np.mean(np.array(loads) / still), rel=1e-12)


def test_the_rms_is_bounded_within_a_hundredth(calm):
    assert 0.0 <= calm.gap < 0.01


@pytest.mark.parametrize(
    ("settings", "metric", "message"),
    [
        ({"actuators": {"lag": 0.1}}, "rbm_rms", "settings: expected no others than wind"),
        ({}, "tip_rms", "metric: expected"),
    ],
)
def test_what_is_not_bounded_is_refused(settings, metric, message):
    with pytest.raises(ValueError, match=message):
        bound(load_model(), settings, SEED, 10.0, metric)


def test_unequal_blades_are_refused():
    with pytest.raises(ValueError, match="equal blades"):
        bound(load_model("nrel5mw-heavy-blade"), {}, SEED, 10.0)


def test_the_shipped_bounds_are_whole():
    entries = json.loads((resources.files("flapgym.evaluation") / "data" / "bounds.json").read_text())
    known = {entry.id for entry in ENVIRONMENTS}
    for entry in entries:
        assert entry["environment"] in known
        assert entry["model_hash"] == load_model(entry["model"]).hash
        assert -1.0 <= entry["value"] <= entry["reached"] <= 0.0
        assert entry["gap"] == pytest.approx(entry["reached"] - entry["value"], abs=2e-5)
        for key in ("value", "reached"):
            assert np.mean(entry[f"{key}_of_each"]) == pytest.approx(entry[key], abs=1e-5)
            assert len(entry[f"{key}_of_each"]) == entry["realisations"]
    assert len({(entry["environment"], entry["metric"]) for entry in entries}) == len(entries)
