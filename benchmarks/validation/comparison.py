"""The comparison of one model with OpenFAST: all rows of the table, and the series of the picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.validation.measures import (
    BANDS,
    Statistics,
    aligned,
    correlation,
    respond,
    statistics,
    step_answer,
)
from benchmarks.validation.reference import WIND_SPEED, Figures, Series, read_figures, read_series
from benchmarks.validation.rows import AtLeast, Between, Limit, Near, Row, Unit, Within
from benchmarks.validation.steady import Means, RigidAnswer, means, rigid_answer
from flapgym.model import TurbineModel
from flapgym.turbine import Case, load_turbine

DEGREE = np.pi / 180.0
MOMENT, METRES, TOWER = Unit("MN m", 1e6), Unit("m"), Unit("m", decimals=4)
PER_WIND = Unit("MN m per m/s", 1e6), Unit("m per m/s"), Unit("m per m/s", decimals=4)
PER_DEGREE = Unit("MN m per deg", 1e6, decimals=4), Unit("m per deg", decimals=4)

PROGRAMS = ("BeamDyn", "ElastoDyn")
SIZES = {"BeamDyn": Within(0.06), "ElastoDyn": Within(0.08)}  # of root moment and tip in turbulence
FATIGUE = {"BeamDyn": Within(0.05), "ElastoDyn": Within(0.08)}
BAND = Within(0.08)  # of BeamDyn's, below BAND_LIMIT
BAND_LIMIT = 0.6  # Hz; above it twelve beam elements and forty-eight differ by a quarter
CORRELATION = AtLeast(0.99)
GAIN = Between(0.06)  # of BeamDyn's quasi-steady and dynamic values
TOWER_GAIN = Within(0.08)
FLAP = Between()  # BeamDyn and ElastoDyn
RIGID_STEP = Within(0.06)  # of the free wake's
RIGID_TORQUE = Within(0.05)
ROOT_REACTION, TIP, TORQUE = Within(0.03), Within(0.05), Within(0.05)
TWIST = Near(0.5 * DEGREE, "within 0.5 deg")


@dataclass(frozen=True, eq=False)
class Comparison:
    """A model beside OpenFAST.

    Attributes
    ----------
    model : str
        Its name.
    tables : mapping
        Rows by the heading they stand under.
    step, turbulence : mapping
        Ours and theirs under the same wind by program, theirs with dynamic inflow; turbulence without its start-up.
        Ours are perturbations, theirs hold the means.
    """

    model: str
    tables: Mapping[str, tuple[Row, ...]]
    step: Mapping[str, tuple[Series, Series]]
    turbulence: Mapping[str, tuple[Series, Series]]


def compare(model: TurbineModel) -> Comparison:
    """Compare a model.

    Raises
    ------
    ValueError
        If it is not of OpenFAST's turbine or not at its wind speed, or its blades differ.
    """
    if model.periodic is not None:
        raise ValueError(f"model {model.name}: expected equal blades, as OpenFAST's, got {model.form}")
    if model.wind_speed != WIND_SPEED:
        raise ValueError(
            f"model {model.name}: expected a wind_speed of {WIND_SPEED:g} m/s, that of OpenFAST's series, "
            f"got {model.wind_speed:g} m/s"
        )
    case, figures = Case.from_dict(model.case), read_figures()
    case.turbine.require(load_turbine("nrel5mw"))
    step = {name: _both(model, f"step_{name.lower()}_dynamic") for name in PROGRAMS}
    windy = turbulence(model)
    tables = {
        **{f"Turbulence, {name}": turbulence_rows(name, *pair) for name, pair in windy.items()},
        **{f"Steady wind, {name}": gain_rows(model, name) for name in PROGRAMS},
        "Step of 1 m/s": step_rows(model, step),
        "Flap, all blades alike": flap_rows(model, figures),
        "Rigid rotor": rigid_rows(rigid_answer(case), figures),
        "Mean state": mean_rows(means(case), figures),
    }
    return Comparison(model.name, tables, step, windy)


def turbulence(model: TurbineModel) -> dict[str, tuple[Series, Series]]:
    """Ours and theirs in each program's turbulence with dynamic inflow, without its start-up."""
    pairs = {name: _both(model, f"turbulence_{name.lower()}_dynamic") for name in PROGRAMS}
    return {name: (aligned(ours), aligned(theirs)) for name, (ours, theirs) in pairs.items()}


def _both(model: TurbineModel, name: str) -> tuple[Series, Series]:
    theirs = read_series(name)
    return respond(model, theirs), theirs


def turbulence_rows(name: str, ours: Series, theirs: Series) -> tuple[Row, ...]:
    """Sizes of the loads under the same wind."""
    one, other = statistics(ours), statistics(theirs)
    return (
        Row("RBM, standard deviation", MOMENT, one.rbm_std, {name: other.rbm_std}, SIZES[name]),
        Row("RBM, DEL", MOMENT, one.rbm_del, {name: other.rbm_del}, FATIGUE[name]),
        Row("tip, standard deviation", METRES, one.tip_std, {name: other.tip_std}, SIZES[name]),
        Row("tower top, standard deviation", TOWER, one.tower_std, {name: other.tower_std}),
        *band_rows(name, one, other),
        Row("RBM, correlation of the two", Unit(""), correlation(ours, theirs), {}, CORRELATION),
    )


def band_rows(name: str, ours: Statistics, theirs: Statistics) -> list[Row]:
    """Rms of the root moment by band."""
    return [
        Row(
            f"RBM, {low:g} to {high:g} Hz",
            MOMENT,
            mine,
            {name: independent},
            BAND if name == "BeamDyn" and high <= BAND_LIMIT else None,
        )
        for (low, high), mine, independent in zip(BANDS, ours.bands, theirs.bands, strict=True)
    ]


def gain_rows(model: TurbineModel, name: str) -> tuple[Row, ...]:
    """Answer to steady wind: ours exactly, OpenFAST's over a step from 11 to 12 m/s."""
    outputs = ("rbm_0", "tip_deflection_0", "tower_fore_aft")
    ours = model.turbine.select(inputs=["wind"], outputs=outputs).dc_gain()[:, 0]
    stem = f"step_{name.lower()}"
    steps = {
        f"{name} quasi-steady": step_answer(read_series(f"{stem}_quasi_steady"), revolution(model)),
        f"{name} dynamic": step_answer(read_series(f"{stem}_dynamic"), revolution(model)),
    }
    rows: tuple[tuple[str, dict[str, float], Limit], ...] = (
        ("RBM", {inflow: step.rbm for inflow, step in steps.items()}, GAIN),
        ("tip", {inflow: step.tip for inflow, step in steps.items()}, GAIN),
        ("tower top", {inflow: step.tower for inflow, step in steps.items()}, TOWER_GAIN),
    )
    return tuple(
        Row(quantity, unit, float(gain), independent, limit if name == "BeamDyn" else None)
        for (quantity, independent, limit), unit, gain in zip(rows, PER_WIND, ours, strict=True)
    )


def revolution(model: TurbineModel) -> float:
    """Time of one [s]."""
    return float(2.0 * np.pi / model.rotor_speed)


def step_rows(model: TurbineModel, steps: Mapping[str, tuple[Series, Series]]) -> tuple[Row, ...]:
    """When the root moment follows the wind."""
    answers = {
        name: tuple(step_answer(series, revolution(model)) for series in both) for name, both in steps.items()
    }
    ours = answers[PROGRAMS[0]][0]
    seconds = Unit("s", decimals=2)

    def theirs(of: str) -> dict[str, float]:
        return {f"{name} dynamic": float(getattr(both[1], of)) for name, both in answers.items()}

    return (
        Row("RBM, nine tenths of the way after", seconds, ours.rise, theirs("rise")),
        Row("RBM, largest of the first revolution after", seconds, ours.peak_time, theirs("peak_time")),
    )


def flap_rows(model: TurbineModel, figures: Figures) -> tuple[Row, ...]:
    """Steady answer of the elastic turbine."""
    outputs = ("rbm_0", "tip_deflection_0")
    moment, tip = model.turbine.select(inputs=["flap_angle_0"], outputs=outputs).dc_gain()[:, 0] * DEGREE
    return (
        Row("RBM", PER_DEGREE[0], float(moment), figures.flap_moment, FLAP),
        Row("tip", PER_DEGREE[1], float(tip), figures.flap_tip, FLAP),
    )


def rigid_rows(ours: RigidAnswer, figures: Figures) -> tuple[Row, ...]:
    """The lattice alone."""
    moment, torque, flap = PER_WIND[0], Unit("MN m per m/s", 1e6, decimals=2), Unit("MN m per deg", 1e6)
    return (
        Row("RBM, 0.2 s after a step of 1 m/s", moment, ours.early, figures.rigid_early, RIGID_STEP),
        Row("RBM, peak after it", moment, ours.peak, figures.rigid_peak, RIGID_STEP),
        Row("RBM, end", moment, ours.end, figures.rigid_end, RIGID_STEP),
        Row("RBM per m/s, steady", moment, ours.gain, figures.rigid_gain),
        Row("torque per m/s, steady", torque, ours.torque, figures.rigid_torque, RIGID_TORQUE),
        Row("RBM per degree of flap, steady", flap, ours.flap * DEGREE, figures.rigid_flap),
    )


def mean_rows(ours: Means, figures: Figures) -> tuple[Row, ...]:
    """Steady loads and shape at 11 m/s."""
    kilonewton, moment = Unit("kN", 1e3, decimals=0), Unit("MN m", 1e6, decimals=2)
    degrees = Unit("deg", DEGREE, decimals=2)
    return (
        Row("thrust, rigid", kilonewton, ours.thrust, figures.thrust),
        Row("torque, rigid", moment, ours.torque, figures.torque, TORQUE),
        Row("thrust, bent blades", kilonewton, ours.bent_thrust, {}),
        Row("torque, bent blades", moment, ours.bent_torque, {}),
        Row("aerodynamic root moment, rigid", moment, ours.aerodynamic_moment, figures.aerodynamic_moment),
        Row("root reaction", moment, ours.root_reaction, figures.root_reaction, ROOT_REACTION),
        Row("tip", Unit("m", decimals=2), ours.tip, figures.tip, TIP),
        Row("twist of the tip, nose up", degrees, ours.twist, figures.twist, TWIST),
    )
