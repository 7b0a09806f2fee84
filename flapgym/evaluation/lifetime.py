"""Loads over a turbine's life and the report of them: the data first, the files last."""

from __future__ import annotations

import os
from collections.abc import Sequence

from flapgym.control import Agent
from flapgym.evaluation.comparison import SCORED_SEED
from flapgym.evaluation.lifetime_report import FILES, write_lifetime
from flapgym.evaluation.lifetime_study import (
    DEFAULT_MODELS,
    DURATION,
    SEEDS,
    YEARS,
    Lifetime,
    plan_lifetime,
    run_lifetime,
)
from flapgym.evaluation.report import writable_folder
from flapgym.model.model_set import ModelSet


def lifetime(
    agents: Sequence[str | os.PathLike[str] | Agent] | None = None,
    models: ModelSet | str | os.PathLike[str] = DEFAULT_MODELS,
    wind_speeds: Sequence[float] | None = None,
    seeds: int = SEEDS,
    seed: int = SCORED_SEED,
    duration: float = DURATION,
    turbulence_class: str = "B",
    wind_class: str = "II",
    years: float = YEARS,
    output: str | os.PathLike[str] | None = None,
    save_series: str | os.PathLike[str] | None = None,
    progress: bool = False,
) -> Lifetime:
    """Score agents over the life of a turbine, IEC 61400-1 design load case 1.2: normal turbulence, power production.

    Everything asked for is checked before any work. With an output folder, each agent's results at each wind speed are
    kept as they come, and a later call that asks for the same takes them up; reports are written at the end.

    Parameters
    ----------
    agents : sequence, optional
        Names of shipped agents, paths of agent files, or agents; a name means the agent for the model of each wind
        speed. Open loop is always among them. By default all shipped, and individual pitch where the blades pitch.
    models : ModelSet, name or path
        The turbine at its wind speeds, with winds by strip.
    wind_speeds : sequence of float, optional
        Some of those of the models [m/s], by default all. Bins end halfway between them.
    seeds : int
        Realisations at each.
    seed : int
        Of the first at the first speed of the set; that of the next speed follows 40 behind.
    duration : float
        Of each realisation [s].
    turbulence_class : {"A", "B", "C"}
    wind_class : {"I", "II", "III"}
        Yearly mean of 10, 8.5 or 7.5 m/s.
    years : float
        The life.
    output : path, optional
        Folder for lifetime.json, .csv, .md and .png, and for what is kept.
    save_series : path, optional
        Folder for every plant sample of each realisation as NetCDF; nothing is taken up then.
    progress : bool
        Show a bar on standard error.

    Raises
    ------
    ValueError, FileNotFoundError, ImportError
        Naming the agent, the models or the option at fault.
    """
    study = plan_lifetime(
        agents, models, wind_speeds, seeds, seed, duration, turbulence_class, wind_class, years, save_series
    )
    folder = None if output is None else writable_folder(output, FILES)
    life = run_lifetime(study, progress, folder)
    if folder is not None:
        write_lifetime(life, folder)
    return life
