"""Compare agents and write the report: the comparison's data first, its files last."""

from __future__ import annotations

import os
from collections.abc import Sequence

from flapgym.control import AGENT_NAMES, Agent
from flapgym.evaluation.comparison import PAPER_REALISATIONS, SCORED_SEED, Comparison, plan, run
from flapgym.evaluation.metrics import FATIGUE_SLOPE
from flapgym.evaluation.report import FILES, writable_folder, write_report
from flapgym.evaluation.series import check_series, write_series
from flapgym.model.turbine_model import TurbineModel


def compare(
    agents: Sequence[str | os.PathLike[str] | Agent] = AGENT_NAMES,
    model: TurbineModel | str | os.PathLike[str] | None = None,
    realisations: int = PAPER_REALISATIONS,
    seed: int = SCORED_SEED,
    duration: float | None = None,
    output: str | os.PathLike[str] | None = None,
    progress: bool = False,
    channels: bool = False,
    environment: str | None = None,
    *,
    wind_speed: float | None = None,
    turbulence_intensity: float | None = None,
    length_scale: float | None = None,
    wind: str | os.PathLike[str] | None = None,
    box_shape: Sequence[int] | None = None,
    box_spacing: Sequence[float] | None = None,
    slope: float = FATIGUE_SLOPE,
    save_series: str | os.PathLike[str] | None = None,
) -> Comparison:
    """Score agents on the same realisations of the model's reference turbulence, or of an environment's wind.

    Everything asked for is checked before any work; files are written at the end, each whole or not at all.

    Parameters
    ----------
    agents : sequence
        Names of shipped agents, paths of agent files, or agents. Open loop is always among them.
    model : TurbineModel, name or path, optional
        The turbine, or a set of models over wind speed; by default the environment's.
    realisations : int
        Number of realisations.
    seed : int
        Seed of the first; realisation i takes seed + i.
    duration : float, optional
        Length of each [s], by default 20 L/U, or as long as a file's wind lasts if that is less.
    output : path, optional
        Folder for compare.json, .csv, .md and .png.
    progress : bool
        Show a bar on standard error.
    channels : bool
        Score every load channel, too, at several S-N slopes: a second table, and entries in the JSON.
    environment : str, optional
        Id of one of this package's turbines, such as "flapgym/NREL5MWSite-v0": its model, wind, sensors and actuators.
    wind_speed : float, optional
        Which model of a set [m/s].
    turbulence_intensity : float, optional
        Of the turbulence, homogeneous or over the disk, a fraction; what varies in a box is scaled to it.
    length_scale : float, optional
        Of von Karman's turbulence [m].
    wind : path, optional
        File that takes the place of turbulence and gust: a recording of homogeneous wind, or a box.
    box_shape, box_spacing : sequence of three, optional
        Of a HAWC2 box: points along the wind, to the left and up, and their distances [m].
    slope : float
        S-N slope of the scored damage-equivalent loads.
    save_series : path, optional
        NetCDF file for every plant sample of all agents.

    Raises
    ------
    ValueError, FileNotFoundError, ImportError
        Naming the agent, model, file or option at fault.
    """
    planned = plan(
        agents,
        model,
        realisations,
        seed,
        duration,
        channels,
        environment,
        wind_speed=wind_speed,
        turbulence_intensity=turbulence_intensity,
        length_scale=length_scale,
        wind=wind,
        box_shape=box_shape,
        box_spacing=box_spacing,
        slope=slope,
        series=save_series is not None,
    )
    folder = None if output is None else writable_folder(output, FILES)
    series = None if save_series is None else check_series(planned, save_series)
    comparison = run(planned, progress)
    if folder is not None:
        write_report(comparison, folder)
    if series is not None:
        write_series(comparison, series)
    return comparison
