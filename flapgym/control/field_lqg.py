"""LQG that knows what turning blades meet of a field over the disk: slow eddies again at every turn, and shear.

All that differs from `flapgym.control.lqg` is the disturbance its observer believes in. The winds by strip are replaced
by one, that which makes the same root moment: they are so alike that the moment's spectrum, open loop, is met to half a
decibel up to twice the rotor's speed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flapgym.control.blade_controller import BladeController
from flapgym.control.lqg import DesignModel, Weights, design_model, lqg_agent
from flapgym.control.rotor_controller import RotorController
from flapgym.core.arrays import Array
from flapgym.core.state_space import StateSpace
from flapgym.core.wording import shown
from flapgym.model.nameplate import nameplate
from flapgym.model.signals import strip_inputs
from flapgym.model.turbine_model import TurbineModel
from flapgym.wind import EffectiveField, Inflow, blade_filter, component_filter, effective_field
from flapgym.wind.field_filter import HARMONICS
from flapgym.wind.turbulence import Turbulence

LEFT_OUT = 1e-6
"""Share of the steady inflow's variance in each strip that its harmonics may leave out: those kept here are few."""


def field_lqg(
    name: str,
    model: TurbineModel,
    field: Turbulence,
    weights: Weights,
    inflow: Inflow | None = None,
    multiblade: bool = True,
) -> BladeController | RotorController:
    """The LQG for a field, of one blade for three copies, or of the whole turning turbine.

    Parameters
    ----------
    name : str
        What tables call it.
    model : TurbineModel
        With winds by strip; any number of flaps, any wind speed.
    field : Turbulence
        What the model's case does not tell otherwise is the field's own (`Turbulence.on_turbine`).
    weights : Weights
        An observer that expects much noise, of the size of the open-loop moment in every sample, leans on the
        filter's peaks and bears more than one that follows every measurement.
    inflow : Inflow, optional
        What is steady beside it; the controller expects loads of that size, not of that phase.
    multiblade : bool
        Of the whole turbine, or of each clamped blade alone.

    Raises
    ------
    ValueError
        If the model has no winds by strip, or its case does not tell rotor and tower; or as `design_model`.
    """
    return lqg_agent(name, model, weights, field_design(model, field, inflow, multiblade))


def field_design(
    model: TurbineModel, field: Turbulence, inflow: Inflow | None = None, multiblade: bool = True
) -> DesignModel:
    """What `field_lqg` solves its Riccati equations on, whatever the weights."""
    met = field_met(model, field, inflow)
    plant = model.turbine if multiblade else model.blade
    return design_model(model, plant, field_disturbance(model, met, multiblade))


def field_met(
    model: TurbineModel, field: Turbulence, inflow: Inflow | None = None, harmonics: int = HARMONICS
) -> EffectiveField:
    """The effective wind of a field for the root moments of a model's blades; errors as of `field_lqg`."""
    if not isinstance(field, Turbulence):
        raise ValueError(f"field: expected a turbulence over the disk with spectra, got {shown(field)}")
    if inflow is not None and not isinstance(inflow, Inflow):
        raise ValueError(f"inflow: expected an Inflow or None, got {shown(inflow)}")
    plate = nameplate(model.case)
    if not model.strips or plate.disk is None:
        raise ValueError(
            "field: expected a model with winds by strip whose case tells rotor and tower, such as nrel5mw-site, got "
            f"{model.name}"
        )
    known = field.on_turbine(model.turbulence_intensity, model.length_scale, plate.hub_height)
    radii = plate.strip_radii
    steady = (
        None if inflow is None else inflow.harmonics(radii, plate.disk, model.wind_speed, left_out=LEFT_OUT)
    )
    return effective_field(
        known, radii, moment_shares(model), model.wind_speed, model.rotor_speed, steady, harmonics
    )


def moment_shares(model: TurbineModel) -> Array:
    """Shares (strips,) of the strips' winds in a blade's root moment, whose sum is one.

    Of the cyclic components, steady: to the collective one a loop on the rotor's speed may answer.
    """
    cyclic = [name for name in strip_inputs(model.strips) if name.endswith("_c")]
    gain = np.linalg.norm(model.turbine.select(cyclic, ["rbm_c", "rbm_s"]).dc_gain(), axis=0)
    return np.asarray(gain / gain.sum())


def field_disturbance(model: TurbineModel, met: EffectiveField, multiblade: bool = True) -> StateSpace:
    """From white noise to the disturbance inputs of the turbine, all strips in the effective wind, or of the blade."""
    if not multiblade:
        return blade_filter(met, model.time_step)
    components = component_filter(met, model.time_step)
    # Strip by strip the three components, as the model's inputs stand.
    each = np.tile(np.eye(3), (model.strips, 1))
    return replace(
        components, C=each @ components.C, D=each @ components.D, outputs=strip_inputs(model.strips)
    )
