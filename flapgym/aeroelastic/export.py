"""The model in the forms that control designers work with: python-control, scipy.signal, MATLAB."""

from __future__ import annotations

import io
import os
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.io
import scipy.signal

from flapgym.aeroelastic.model import TurbineModel
from flapgym.atomic import write_atomically
from flapgym.state_space import StateSpace

if TYPE_CHECKING:
    import control


def to_control(system: StateSpace) -> control.StateSpace:
    """The system as a python-control ``StateSpace`` with the same input and output names.

    Raises
    ------
    ImportError
        If python-control is not installed; it comes with ``flapgym[baselines]``.
    """
    import control  # only those who ask for it need it

    return control.ss(
        system.A,
        system.B,
        system.C,
        system.D,
        system.time_step,
        inputs=list(system.inputs),
        outputs=list(system.outputs),
    )


def to_dlti(system: StateSpace) -> scipy.signal.dlti:
    """The system as a ``scipy.signal.dlti``, which knows no names."""
    return scipy.signal.dlti(system.A, system.B, system.C, system.D, dt=system.time_step)


def save_mat(model: TurbineModel, path: str | os.PathLike[str]) -> None:
    """Write turbine and single blade as structs A, B, C, D, Ts, InputName, OutputName to a MATLAB file.

    With unequal blades `turbine` is the mean over azimuth, and a struct `periodic` holds what turns
    (`flapgym.aeroelastic.harmonics.PeriodicPart`).
    In MATLAB: ``m = load('model.mat'); sys = ss(m.turbine.A, m.turbine.B, m.turbine.C, m.turbine.D, m.turbine.Ts)``.
    """
    content: dict[str, Any] = {
        "turbine": _struct(model.turbine),
        "blade": _struct(model.blade),
        "name": model.name,
        "hash": model.hash,
        "wind_speed": model.wind_speed,
        "rotor_speed": model.rotor_speed,
    }
    if model.periodic is not None:
        names = ("left", "core", "right", "forcing")
        content["periodic"] = {name: getattr(model.periodic, name) for name in names}
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, content, oned_as="column")
    write_atomically(path, buffer.getvalue())


def _struct(system: StateSpace) -> dict[str, Any]:
    # As cell arrays: strings of one length, padded, are not what MATLAB takes for names.
    names = {
        "InputName": np.array(system.inputs, dtype=object),
        "OutputName": np.array(system.outputs, dtype=object),
    }
    return {"A": system.A, "B": system.B, "C": system.C, "D": system.D, "Ts": system.time_step, **names}
