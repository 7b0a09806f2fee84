"""What blows over the disk and pulls at the blades: a turbulent field, steady inflow, gravity."""

from __future__ import annotations

from dataclasses import dataclass

from flapgym.model.nameplate import nameplate
from flapgym.model.turbine_model import TurbineModel
from flapgym.wind import Inflow
from flapgym.wind.box_field import BoxField
from flapgym.wind.turbulence import Turbulence


@dataclass(frozen=True)
class Surroundings:
    """Beside, or in place of, a homogeneous wind.

    Attributes
    ----------
    field : Turbulence, BoxField or None
        Which replaces the homogeneous turbulence; it knows its intensity and scale.
    inflow : Inflow or None
        What is steady of the wind over the disk.
    gravity : bool
        Whether the blades feel it.
    """

    field: Turbulence | BoxField | None = None
    inflow: Inflow | None = None
    gravity: bool = False

    @property
    def steady(self) -> bool:
        """Whether there is what depends on the azimuth alone."""
        return self.inflow is not None or self.gravity

    @property
    def turns(self) -> bool:
        """Whether it takes blades that turn."""
        return self.steady or self.field is not None

    def require(self, model: TurbineModel) -> None:
        """Refuse a model without the inputs that this takes (`require_inputs`)."""
        require_inputs(model, self.field is not None, self.inflow is not None, self.gravity)


def require_inputs(model: TurbineModel, field: bool, inflow: bool, gravity: bool) -> None:
    """Refuse a model without the inputs that a field, steady inflow or gravity take.

    Raises
    ------
    ValueError
        The message names the setting and a model that has them.
    """
    wants = [
        ("wind.field", field, "winds by strip", model.strips > 0),
        ("wind.inflow", inflow, "winds by strip", model.strips > 0),
        ("gravity", gravity, "gravity as an input", "gravity" in model.turbine.inputs),
    ]
    for name, wanted, what, there in wants:
        if not wanted:
            continue
        if not there:
            raise ValueError(
                f"{name}: expected a model with {what}, such as nrel5mw-site, got {model.name}; "
                "see [signals] in the case file"
            )
        if name != "gravity" and nameplate(model.case).disk is None:
            raise ValueError(f"{name}: expected a model whose case tells rotor and tower, got {model.name}")
