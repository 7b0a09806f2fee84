"""All series of a comparison or a record as labelled data with units, and the NetCDF files they go to."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flapgym import __version__
from flapgym.core.arrays import BLADES
from flapgym.core.atomic import check_target, write_atomically
from flapgym.core.wording import number, shown
from flapgym.envs.spec import plain
from flapgym.evaluation.comparison import Comparison, Plan
from flapgym.evaluation.record import Record, require_xarray
from flapgym.evaluation.report import writable_folder
from flapgym.model.turbine_model import TurbineModel

if TYPE_CHECKING:
    import xarray

SUFFIX = ".nc"
LARGEST = 2_000_000_000
"""Of all series [bytes]: they are held in memory until they are written, and once more while they are."""
LARGEST_SEED = 2**31 - 1
"""NetCDF 3, which SciPy reads by itself, has no longer whole numbers."""
_BLADE_SERIES, _FIXED_SERIES = 3, 3
"""Of every record: moment, deflection and pitch of each blade; the tower's two and the wind."""


def check_series(plan: Plan, path: str | os.PathLike[str]) -> Path:
    """The file that the series of a plan may be written to.

    Raises
    ------
    ImportError
        If xarray is not installed.
    OSError
        If it could not be written.
    ValueError
        If its name does not end in .nc, or the series are too large or of too large seeds for it.
    """
    target = Path(path)
    if target.suffix != SUFFIX:
        raise ValueError(f"save_series: expected a file that ends in {SUFFIX}, got {shown(os.fspath(path))}")
    require_xarray("save_series")
    check_target(target)
    _check_seeds(plan.seeds)
    model = plan.model
    columns = BLADES * (_BLADE_SERIES + 2 * len(model.flaps)) + _FIXED_SERIES
    columns += BLADES * len(model.blade_outputs) + len(model.fixed_outputs)
    samples = round(plan.duration / model.time_step)
    size = 8 * columns * samples * len(plan.agents) * len(plan.seeds)
    if size > LARGEST:
        raise ValueError(
            f"save_series: expected series of at most {LARGEST / 1e9:.0f} GB, got some {size / 1e9:.0f} GB; take fewer "
            "agents or realisations, or shorter ones"
        )
    return target


def check_series_folder(folder: str | os.PathLike[str], seeds: range) -> Path:
    """The folder that realisations of these seeds may be written to, which is made if it is missing.

    Raises
    ------
    ImportError
        If xarray is not installed.
    ValueError
        If nothing can be written there, or the seeds are too large for the files.
    """
    require_xarray("save_series")
    _check_seeds(seeds)
    return writable_folder(folder)


def _check_seeds(seeds: range) -> None:
    if seeds[-1] > LARGEST_SEED:
        raise ValueError(f"save_series: expected seeds up to {LARGEST_SEED}, got {seeds[-1]}")


def as_dataset(comparison: Comparison) -> xarray.Dataset:
    """Every plant sample of all agents, with dimensions agent, realisation, time, blade and, of flap motion, flap.

    Raises
    ------
    ImportError
        If xarray is not installed.
    ValueError
        If the comparison was made without keeping its series.
    """
    if not comparison.series:
        raise ValueError("as_dataset: expected a comparison with its series, planned with series=True")
    require_xarray("as_dataset")
    import xarray  # long to import, and an extra

    seeds: Sequence[int] = range(comparison.seed, comparison.seed + comparison.realisations)
    each = [record.to_xarray(seeds) for record in comparison.series.values()]
    found = xarray.concat(each, "agent", data_vars="all").assign_coords(agent=list(comparison.series))
    # All agents begin at the same azimuths and meet the same wind.
    for name in ("azimuth", "wind"):
        found[name] = found[name].isel(agent=0, drop=True)
    return found.assign_attrs(
        title="flapgym compare",
        flapgym=__version__,
        model=comparison.model_name,
        model_hash=comparison.model_hash,
        environment=comparison.environment or "",
        settings=json.dumps(plain(comparison.settings)),
        wind_speed_m_per_s=comparison.wind_speed,
        rotor_speed_rad_per_s=comparison.rotor_speed,
    )


def write_series(comparison: Comparison, path: str | os.PathLike[str]) -> None:
    """Write `as_dataset` to a NetCDF file of the classic kind, which needs no library but SciPy to read."""
    _write(as_dataset(comparison), path)


def write_realisations(
    folder: Path, record: Record, model: TurbineModel, agent: str, seeds: Sequence[int]
) -> None:
    """Write one file for each realisation of an agent's record: <speed>mps-<agent>-seed<seed>.nc.

    In single precision, whose seven digits are more than any load is known to: a life has many realisations.

    Parameters
    ----------
    folder : path
    record : Record
    model : TurbineModel
        That it is of.
    agent : str
        Name.
    seeds : sequence of int
        Of the realisations.
    """
    dataset = record.to_xarray(seeds).assign_attrs(
        title="flapgym lifetime",
        flapgym=__version__,
        agent=agent,
        model=model.name,
        model_hash=model.hash,
        wind_speed_m_per_s=model.wind_speed,
        rotor_speed_rad_per_s=model.rotor_speed,
    )
    single = {str(name): {"dtype": "float32"} for name in dataset.data_vars}
    for place, seed in enumerate(seeds):
        path = folder / f"{number(model.wind_speed)}mps-{agent}-seed{seed}.nc"
        _write(dataset.isel(realisation=[place]), path, single)


def _write(
    dataset: xarray.Dataset, path: str | os.PathLike[str], encoding: dict[str, Any] | None = None
) -> None:
    content = dataset.to_netcdf(engine="scipy", format="NETCDF3_64BIT", encoding=encoding)
    write_atomically(path, bytes(content))
