"""Series of a record as NetCDF, which xarray and most other programs read."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from flapgym.core.arrays import Array
from flapgym.core.atomic import write_atomically
from flapgym.core.wording import number
from flapgym.evaluation.channels import unit_of
from flapgym.evaluation.metrics import Record
from flapgym.model.turbine_model import TurbineModel

UNITS = {
    "tip_deflection": "m",
    "flap_angle": "rad",
    "flap_rate": "rad/s",
    "pitch_angle": "rad",
    "tower_fore_aft": "m",
    "tower_side_side": "m",
    "wind": "m/s",
}
"""Of what every record has beside loads."""


def write_series(
    folder: Path, record: Record, model: TurbineModel, agent: str, seeds: Sequence[int]
) -> tuple[Path, ...]:
    """Write one file for each realisation of a record, in single precision: <speed>mps-<agent>-seed<seed>.nc.

    Loads are perturbations about the operating point, in SI units.

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
    series: dict[str, Array] = {"rbm": record.rbm}
    series |= {name: getattr(record, name) for name in UNITS if getattr(record, name).size} | dict(
        record.further
    )
    paths = []
    for row, seed in enumerate(seeds):
        path = folder / f"{number(model.wind_speed)}mps-{agent}-seed{seed}.nc"
        write_atomically(
            path, _netcdf({name: each[row] for name, each in series.items()}, record, model, agent, seed)
        )
        paths.append(path)
    return tuple(paths)


def _netcdf(series: dict[str, Array], record: Record, model: TurbineModel, agent: str, seed: int) -> bytes:
    # Loaded only here, for those who want series.
    from scipy.io import netcdf_file

    content = io.BytesIO()
    # Of the classic format with large files, which needs no further library.
    with netcdf_file(content, "w", version=2) as file:
        told = {"agent": agent, "model": model.name, "model_hash": model.hash, "seed": str(seed)}
        for name, value in told.items():
            setattr(file, name, value)
        file.wind_speed_m_per_s, file.rotor_speed_rad_per_s = model.wind_speed, model.rotor_speed
        steps = record.rbm.shape[1]
        sizes = {"time": steps, "blade": record.rbm.shape[2], "flap": record.flap_angle.shape[2]}
        for name, size in sizes.items():
            file.createDimension(name, size)
        time = file.createVariable("time", "f8", ("time",))
        time[:] = record.time_step * np.arange(1, steps + 1)
        time.units = "s"
        for name, values in series.items():
            across = () if values.ndim == 1 else ("flap",) if name.startswith("flap_") else ("blade",)
            variable = file.createVariable(name, "f4", ("time", *across))
            variable[:] = values
            variable.units = UNITS.get(name) or unit_of(name) or "1"
        file.flush()  # closing the file closes the buffer, too
        return content.getvalue()
