"""Every public function refuses arguments that have no meaning, in one line that names the argument."""

import importlib
import inspect
import os
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flapgym.control import (
    BladeController,
    LidarLQG,
    OpenLoop,
    PDGains,
    PIDGains,
    PredictiveController,
    RotorController,
    Weights,
    closed_loop,
    growth_per_turn,
    pd_agent,
    stationary_rms,
)
from flapgym.control.margins import delay_margin, late_measurement
from flapgym.evaluation import plan, simulate
from flapgym.plant import Faults, Stepping, chosen_backend, make_plant
from flapgym.reduction import balanced_reduction, normal_modes
from flapgym.structure import (
    assemble,
    blade_beam,
    hub_velocity,
    linear_blade,
    linear_support,
    mean_gravity_load,
    modes_table,
    multi_blade_matrices,
    named_modes,
    parked_modes,
    rotating_modes,
    solve_equilibrium,
)
from flapgym.turbine import load_turbine
from flapgym.wind import Kaimal, Lidar, realise, von_karman_filter, von_karman_spectrum
from tests.synthetic import synthetic_model

MODEL = synthetic_model()
GAINS = PDGains(5e-8, 0.1, 0.1, 9.0, 0.8)
CONTROLLER = pd_agent("pd", MODEL, GAINS).system
TURBINE = load_turbine()
FILTER = von_karman_filter(11.0, 0.1, 147.0, 0.007)
NAN, INFINITE = float("nan"), float("inf")


def _support():
    return linear_support(TURBINE)


def _calls():
    """What to call wrongly, and how the refusal begins, by public name."""
    return {
        "closed_loop": [
            (lambda: closed_loop(MODEL, CONTROLLER, NAN), "closed_loop.effectiveness"),
            (lambda: closed_loop(MODEL, CONTROLLER, "1"), "closed_loop.effectiveness"),
        ],
        "growth_per_turn": [
            (lambda: growth_per_turn(MODEL, CONTROLLER, 1), "growth_per_turn.turns"),
            (lambda: growth_per_turn(MODEL, CONTROLLER, 2.5), "growth_per_turn.turns"),
        ],
        "stationary_rms": [
            (
                lambda: stationary_rms(MODEL, CONTROLLER, measurement_noise=-1.0),
                "stationary_rms.measurement_noise",
            ),
            (lambda: stationary_rms(MODEL, effectiveness=NAN), "stationary_rms.effectiveness"),
            (lambda: stationary_rms(MODEL, filter_order=2.0), "turbulence.order"),
        ],
        "delay_margin": [(lambda: delay_margin(MODEL, CONTROLLER, 0), "delay_margin.longest")],
        "late_measurement": [(lambda: late_measurement(CONTROLLER, -1, 1.2), "late_measurement.steps")],
        "Weights": [
            (lambda: Weights("1"), "weights.rbm"),
            (lambda: Weights(1.0, flap_angle=True), "weights.flap_angle"),
        ],
        "PDGains": [
            (lambda: PDGains(NAN, 0.1, 0.1, 9.0, 0.8), "pd.proportional"),
            (lambda: PDGains(5e-8, INFINITE, 0.1, 9.0, 0.8), "pd.derivative_time"),
            (lambda: PDGains(5e-8, 0.1, "0.1", 9.0, 0.8), "pd.filter_time"),
            (lambda: PDGains(5e-8, 0.1, INFINITE, 9.0, 0.8), "pd.filter_time"),
        ],
        "PIDGains": [
            (lambda: PIDGains(5e-8, 0.1, 0.1, 9.0, 0.8, 1.0, NAN), "pid.leak_time"),
            (lambda: PIDGains(5e-8, 0.1, 0.1, 9.0, 0.8, "1", 1.0), "pid.integral_gain"),
        ],
        "BladeController": [
            (lambda: BladeController("a", CONTROLLER, np.full((1, 3), NAN), (1.0,)), "agent a: start"),
            (
                lambda: BladeController("a", CONTROLLER, np.zeros((1, 3)), (INFINITE,)),
                "agent a: acceleration_limit",
            ),
        ],
        "RotorController": [
            (
                lambda: RotorController("a", CONTROLLER, np.zeros((1, 9)), (1.0,)),
                "agent a: expected a controller of three",
            ),
        ],
        "PredictiveController": [
            (lambda: PredictiveController("a", MODEL, Weights(1.0), preview=1.5), "agent a: preview"),
            (lambda: PredictiveController("a", MODEL, Weights(1.0), blocks=()), "agent a: blocks"),
            (lambda: PredictiveController("a", MODEL, Weights(1.0), blocks=(1, 0)), "agent a: blocks"),
        ],
        "LidarLQG": [
            (
                lambda: LidarLQG("a", MODEL, Weights(1.0), Lidar(100.0, 40.0), Kaimal(hub_height=90.0), -1.0),
                "agent a: share",
            ),
        ],
        "plan": [
            (lambda: plan([], MODEL, realisations=True), "realisations: expected"),
            (lambda: plan([], MODEL, realisations=2.5), "realisations: expected"),
            (lambda: plan([], MODEL, realisations="5"), "realisations: expected"),
            (lambda: plan([], MODEL, seed=1.5), "seed: expected"),
            (lambda: plan([], MODEL, duration="20"), "duration: expected"),
            (lambda: plan("lqg", MODEL), "agents: expected a list"),
            (lambda: plan({"lqg"}, MODEL), "agents: expected a list"),
            (lambda: plan([3], MODEL), "agents: expected"),
        ],
        "simulate": [
            (lambda: simulate(OpenLoop(), MODEL, [], 5.0), "simulate.seeds"),
            (lambda: simulate(OpenLoop(), MODEL, [1], 0.0), "simulate.duration"),
            (lambda: simulate(OpenLoop(), MODEL, [1], NAN), "simulate.duration"),
        ],
        "realise": [
            (lambda: realise(FILTER, 0, np.random.default_rng(0)), "realise.steps"),
            (lambda: realise(FILTER, 10, np.random.default_rng(0), 1.5), "realise.count"),
            (lambda: realise(MODEL.blade, 10, np.random.default_rng(0)), "realise.shaping_filter"),
            (lambda: realise(FILTER, 10, 0), "realise.rng"),
        ],
        "von_karman_filter": [
            (lambda: von_karman_filter("11", 0.1, 147.0, 0.007), "turbulence.wind_speed"),
            (lambda: von_karman_filter(11.0, 0.1, 147.0, INFINITE), "turbulence.time_step"),
            (lambda: von_karman_filter(11.0, 0.1, 147.0, 0.007, 3.0), "turbulence.order"),
        ],
        "von_karman_spectrum": [
            (lambda: von_karman_spectrum([NAN], 11.0, 0.1, 147.0), "turbulence.frequency"),
            (lambda: von_karman_spectrum(-1.0, 11.0, 0.1, 147.0), "turbulence.frequency"),
        ],
        "normal_modes": [
            (lambda: normal_modes(np.eye(2), np.eye(2), 1.5), "normal_modes.count"),
            (lambda: normal_modes(np.eye(2), np.eye(3), 1), "normal_modes.stiffness"),
            (lambda: normal_modes(np.full((2, 2), NAN), np.eye(2), 1), "normal_modes.mass"),
        ],
        "balanced_reduction": [
            (
                lambda: balanced_reduction(
                    np.ones((64, 1, 1), complex), 0, np.ones(1), np.ones(1), real=True
                ),
                "balanced_reduction.order",
            ),
            (
                lambda: balanced_reduction(
                    np.full((64, 1, 1), NAN, complex), 2, np.ones(1), np.ones(1), real=True
                ),
                "balanced_reduction.response",
            ),
        ],
        "blade_beam": [(lambda: blade_beam(TURBINE, 12, NAN), "blade.pitch")],
        "linear_blade": [
            (lambda: linear_blade(TURBINE, 13), "blade_elements"),
            (lambda: linear_blade(TURBINE, 12, NAN), "blade.rotor_speed"),
        ],
        "linear_support": [(lambda: linear_support(TURBINE, INFINITE), "support.rotor_speed")],
        "mean_gravity_load": [(lambda: mean_gravity_load(TURBINE, 11), "blade_elements")],
        "hub_velocity": [(lambda: hub_velocity(_support(), NAN, 0.0), "hub_velocity.azimuth")],
        "assemble": [(lambda: assemble([], _support()), "assemble.blades")],
        "multi_blade_matrices": [
            (lambda: multi_blade_matrices([linear_blade(TURBINE)], _support()), "multi_blade_matrices.blades")
        ],
        "parked_modes": [
            (lambda: parked_modes(TURBINE, 12, 0), "parked_modes.count"),
            (lambda: parked_modes(TURBINE, 12, 10**6), "parked_modes.count"),
        ],
        "rotating_modes": [
            (lambda: rotating_modes(TURBINE, 12, NAN), "rotor_speed"),
            (lambda: rotating_modes(TURBINE, 12, 1.2, 0), "rotating_modes.count"),
            (lambda: rotating_modes(TURBINE, 12, 1.2, 6, NAN), "rotating_modes.around"),
        ],
        "named_modes": [(lambda: named_modes(TURBINE, 12, NAN), "rotor_speed")],
        "modes_table": [(lambda: modes_table(TURBINE, 13), "blade_elements")],
        "solve_equilibrium": [
            (lambda: solve_equilibrium(blade_beam(TURBINE, 12), load_steps=0), "equilibrium.load_steps"),
            (lambda: solve_equilibrium(blade_beam(TURBINE, 12), np.full(3, NAN)), "equilibrium.rotation"),
        ],
        "Faults": [
            (lambda: Faults(lag="0.1"), "faults.lag"),
            (lambda: Faults((1.0, "1", 1.0)), "faults.effectiveness"),
            (lambda: Faults(stuck=(NAN, None, None)), "faults.stuck"),
            (lambda: Faults(stuck=0.1), "faults.stuck"),
        ],
        "Stepping": [
            (lambda: Stepping(0, 10, 147.0), "stepping.steps_per_action"),
            (lambda: Stepping(2.5, 10, 147.0), "stepping.steps_per_action"),
            (lambda: Stepping(5, -1, 147.0), "stepping.intervals"),
            (lambda: Stepping(5, 10, NAN), "stepping.length_scale"),
            (lambda: Stepping(5, 10, "147 m"), "stepping.length_scale"),
            (lambda: Stepping(5, 10, 147.0, record=True), "stepping.record"),
            (
                lambda: Stepping(5, 10, 147.0, record=True, every_sample=True, displacements=False),
                "stepping.record",
            ),
            (lambda: Stepping(5, 10, 147.0, single_blade=1), "stepping.single_blade"),
            (lambda: Stepping(5, 10, 147.0, precision="float16"), "stepping.precision"),
            (lambda: Stepping(5, 10, 147.0, pool=-1), "stepping.pool"),
            (lambda: Stepping(5, 10, 147.0, faults={"lag": -1.0}), "stepping.faults.lag"),
        ],
        "chosen_backend": [(lambda: chosen_backend("jax"), "backend")],
        "make_plant": [
            (lambda: make_plant(MODEL, 0, Stepping(5, 10, 147.0)), "make_plant.count"),
            (lambda: make_plant(MODEL, 1.5, Stepping(5, 10, 147.0)), "make_plant.count"),
            (lambda: make_plant(MODEL, 1, Stepping(5, 10, 147.0), "jax"), "backend"),
            (
                lambda: make_plant(MODEL, 1, Stepping(5, 10, 147.0, faults=Faults((1.0, 1.0)))),
                "faults.effectiveness",
            ),
        ],
        "StateSpace": [
            (lambda: replace(CONTROLLER, A=[[0.5]]), "state_space.A"),
            (lambda: replace(CONTROLLER, A=np.array(0.5)), "state_space.A"),
            (lambda: replace(CONTROLLER, outputs="acceleration"), "state_space.outputs"),
            (lambda: replace(CONTROLLER, time_step=INFINITE), "state_space.time_step"),
            (lambda: CONTROLLER.simulate(np.zeros((5, 2))), "state_space.simulate.u"),
            (lambda: CONTROLLER.simulate(np.full((5, 3), NAN)), "state_space.simulate.u"),
            (lambda: CONTROLLER.simulate(np.zeros((5, 3)), [0.0, 0.0]), "state_space.simulate.x0"),
        ],
    }


CALLS: dict[str, list[Any]] = _calls()
CASES = [
    pytest.param(call, text, id=f"{name}-{index}")
    for name, calls in CALLS.items()
    for index, (call, text) in enumerate(calls)
]


@pytest.mark.parametrize("call, text", CASES)
def test_an_argument_without_meaning_is_refused_by_name(call, text):
    with pytest.raises(ValueError, match=text) as refused:
        call()
    assert os.linesep not in str(refused.value)
    assert len(str(refused.value)) < 400


ELSEWHERE = {
    "tests/model/test_model_file.py": ("builtin_models", "load_model", "save_model"),
    "tests/model/test_model_set.py": ("load_model_set", "save_model_set"),
    "tests/control/test_agents.py": ("agent_design", "load_agent", "save_agent"),
    "tests/control/test_time_step.py": ("balance", "design_model", "relative_error", "stability"),
    "tests/evaluation/test_bands.py": ("bands",),
    "tests/evaluation/test_channels.py": (
        "channel_loads",
        "damage_equivalent_loads",
        "split",
        "steady_loads",
    ),
    "tests/control/test_field_lqg.py": ("field_design", "field_lqg"),
    "tests/control/test_individual_pitch.py": ("individual_pitch_agent", "pitch_margin"),
    "tests/evaluation/test_compare.py": ("compare", "writable_folder"),
    "tests/evaluation/test_lifetime.py": (
        "class_mean",
        "lifetime",
        "lifetime_change",
        "lifetime_load",
        "plan_lifetime",
        "weibull_share",
        "wind_bins",
    ),
    "tests/evaluation/test_metrics.py": (
        "damage_equivalent_load",
        "measure",
        "paired_change",
        "root_mean_square",
        "summed_damage_change",
        "summed_damage_load",
    ),
    "tests/evaluation/test_series.py": ("as_dataset",),
    "tests/turbine/test_files.py": ("load_case", "load_turbine"),
    "tests/wind/test_box.py": ("mann_box", "read_mann", "read_netcdf", "read_turbsim"),
    "tests/wind/test_extreme_gusts.py": ("gust_components",),
    "tests/wind/test_field.py": ("disk_turbulence",),
    "tests/wind/test_field_filter.py": ("blade_filter", "component_filter", "effective_field"),
    "tests/wind/test_gusts.py": ("gust_of",),
    "tests/wind/test_turbulence.py": ("turbulence_of",),
}
"""Functions whose refusals have a test of their own."""
CHECKED_ALREADY = {
    "scheduled_agent",
    "as_json", "as_markdown", "as_text", "blade_flap_inputs", "builtin_model_sets", "flap_inputs", "is_model_set",
    "lifetime_json", "lifetime_markdown", "lifetime_text", "lqg_agent", "made_for", "multiblade_pid_agent",
    "output_rms", "pd_agent", "pid_agent", "pitch_inputs", "register_environments", "run", "run_lifetime",
    "simulate_together", "strip_inputs", "synthesise", "white_wind", "write_lifetime", "write_report", "write_series",
}  # fmt: skip
"""Those that take nothing but data classes which check themselves, a count of what exists, or no argument at all; and
`simulate_together`, which `simulate` calls with its own; `is_model_set` refuses nothing."""


@pytest.mark.parametrize(
    "package",
    [
        "model",
        "control",
        "envs",
        "evaluation",
        "plant",
        "reduction",
        "structure",
        "turbine",
        "wind",
    ],
)
def test_every_exported_function_is_among_those_whose_refusals_are_tested(package):
    module = importlib.import_module(f"flapgym.{package}")
    functions = {name for name in module.__all__ if inspect.isfunction(getattr(module, name))}
    known = set(CALLS) | CHECKED_ALREADY | {name for names in ELSEWHERE.values() for name in names}
    assert functions <= known
