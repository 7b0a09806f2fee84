"""Compare agents and write the report: the comparison's data first, its files last."""

from __future__ import annotations

import os
from collections.abc import Sequence

from flapgym.control import AGENT_NAMES, Agent
from flapgym.evaluation.comparison import PAPER_REALISATIONS, SCORED_SEED, Comparison, plan, run
from flapgym.evaluation.report import FILES, writable_folder, write_report
from flapgym.model.turbine_model import DEFAULT_MODEL, TurbineModel


def compare(
    agents: Sequence[str | os.PathLike[str] | Agent] = AGENT_NAMES,
    model: TurbineModel | str | os.PathLike[str] = DEFAULT_MODEL,
    realisations: int = PAPER_REALISATIONS,
    seed: int = SCORED_SEED,
    duration: float | None = None,
    output: str | os.PathLike[str] | None = None,
    progress: bool = False,
    channels: bool = False,
    environment: str | None = None,
) -> Comparison:
    """Score agents on the same realisations of the model's reference turbulence, or of an environment's wind.

    Everything asked for is checked before any work; files are written at the end, each whole or not at all.

    Parameters
    ----------
    agents : sequence
        Names of shipped agents, paths of agent files, or agents. Open loop is always among them.
    model : TurbineModel, name or path
        The turbine.
    realisations : int
        Number of realisations.
    seed : int
        Seed of the first; realisation i takes seed + i.
    duration : float, optional
        Length of each [s], by default 20 L/U.
    output : path, optional
        Folder for compare.json, .csv, .md and .png.
    progress : bool
        Show a bar on standard error.
    channels : bool
        Score every load channel, too, at several S-N slopes: a second table, and entries in the JSON.
    environment : str, optional
        Id of one of this package's turbines, such as "flapgym/NREL5MWSite-v0": its model, wind, sensors and actuators.

    Raises
    ------
    ValueError, FileNotFoundError
        Naming the agent, model or option at fault.
    """
    planned = plan(agents, model, realisations, seed, duration, channels, environment)
    folder = None if output is None else writable_folder(output, FILES)
    comparison = run(planned, progress)
    if folder is not None:
        write_report(comparison, folder)
    return comparison
