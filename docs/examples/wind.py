"""A wind of one's own, a bell-shaped gust, and what of its loads the shipped LQG takes off."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from flapgym.control import OpenLoop, load_agent
from flapgym.core.fields import Quantity, check_fields
from flapgym.evaluation import measure, simulate
from flapgym.model import load_model
from flapgym.wind.gusts import GUSTS


@dataclass(frozen=True)
class Bell:
    """A rise to `size` [m/s] at `middle` [s] and a fall, each some `width` [s] long."""

    kind: ClassVar[str] = "bell"
    size: Annotated[float, Quantity("speed", at_least=-20.0, at_most=20.0)]
    middle: Annotated[float, Quantity("time", at_least=0.0)] = 10.0
    width: Annotated[float, Quantity("time", above=0.0)] = 2.0

    def __post_init__(self):
        check_fields(self, "gust")  # numbers out of range are refused by name

    def wind(self, time, mean):
        """Perturbation [m/s] at times [s] about the mean wind speed [m/s]."""
        return self.size * np.exp(-0.5 * ((time - self.middle) / self.width) ** 2)


GUSTS[Bell.kind] = Bell  # only so that a mapping may name it, {"kind": "bell", "size": 3.0}
wind = {"gust": Bell(3.0), "turbulence_intensity": 0.0}  # on top of the model's turbulence, if that is left
model = load_model()
records = [simulate(each, model, [0], 30.0, wind=wind) for each in (OpenLoop(), load_agent("lqg", model))]
for name, loads in zip(("rest", "lqg"), map(measure, records), strict=True):  # (realisations, blades), N m
    print(f"{name}: rms {loads.rbm_rms.mean() / 1e6:.2f} MN m, DEL {loads.rbm_del.mean() / 1e6:.2f} MN m")
