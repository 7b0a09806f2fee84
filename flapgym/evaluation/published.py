"""Bounds that the package ships: how far any controller at all can get, by environment, realisations and metric."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

from flapgym.core.fields import Choice, Count, OrNone, Quantity, Text, from_plain
from flapgym.core.files import MEGABYTE, read_json
from flapgym.core.wording import shown
from flapgym.model.turbine_model import TurbineModel, builtin_models, load_model

METRICS = ("rbm_rms", "rbm_del")
"""Of which there may be bounds: the changes of `flapgym.evaluation.Score` that begin so."""
LARGEST = 4 * MEGABYTE
SAME_DURATION = 1e-6
"""To which durations are one, relative: they are written in decimals."""


@dataclass(frozen=True)
class Bound:
    """The least that a metric can be changed to, on some realisations.

    Attributes
    ----------
    model : str
        Name of the shipped model.
    seed, realisations : int
        Of the first, and how many.
    duration : float
        Of each [s].
    metric : {"rbm_rms", "rbm_del"}
        DEL at S-N slope 10.
    value : float
        Change against open loop, a fraction, below zero.
    gap : float or None
        By which the change may be off, a fraction of open loop; None where it is not known.
    kind : {"bound", "feasible"}
        What no controller can pass, or the best sequence that was found, which a better one may.
    """

    model: Annotated[str, Text()]
    seed: Annotated[int, Count(at_least=0)]
    realisations: Annotated[int, Count(at_least=1)]
    duration: Annotated[float, Quantity("time", above=0.0)]
    metric: Annotated[str, Choice(METRICS)]
    value: Annotated[float, Quantity("fraction", at_least=-1.0, below=0.0)]
    gap: Annotated[float | None, OrNone(Quantity("fraction", at_least=0.0))] = None
    kind: Annotated[str, Choice(("bound", "feasible"))] = "bound"


def read_bounds(path: Path) -> dict[str, tuple[Bound, ...]]:
    """The bounds of a file by id of their environment; none if there is no such file.

    The file is a JSON object of lists: `{"flapgym/NREL5MW-v1": [{"model": ..., "seed": ..., ...}, ...]}`.

    Raises
    ------
    ValueError
        If it holds anything else; the message names the entry.
    """
    if not path.is_file():
        return {}
    content = read_json(path, LARGEST)
    if not isinstance(content, Mapping):
        raise ValueError(f"bounds {path}: expected an object of lists by environment, got {shown(content)}")
    return {name: _entries(name, entries) for name, entries in content.items()}


def _entries(name: str, entries: Any) -> tuple[Bound, ...]:
    if not isinstance(entries, list):
        raise ValueError(f"bounds.{name}: expected a list, got {shown(entries)}")
    return tuple(from_plain(Bound, entry, f"bounds.{name}[{place}]") for place, entry in enumerate(entries))


@cache
def _shipped() -> dict[str, tuple[Bound, ...]]:
    return read_bounds(Path(str(resources.files("flapgym.evaluation") / "data" / "bounds.json")))


def bounds_for(
    environment: str | None,
    model: TurbineModel,
    seeds: Sequence[int],
    duration: float,
    bounds: Mapping[str, Sequence[Bound]] | None = None,
) -> dict[str, Bound]:
    """The bounds of just these realisations by metric; empty where there is none.

    Parameters
    ----------
    environment : str or None
        Id of the environment whose own wind, sensors and actuators they are; None where they are of none.
    model : TurbineModel
    seeds : sequence of int
        Consecutive.
    duration : float
        Of each realisation [s].
    bounds : mapping, optional
        By default what the package ships.
    """
    if environment is None:
        return {}
    found = {
        bound.metric: bound
        for bound in (_shipped() if bounds is None else bounds).get(environment, ())
        if (bound.model, bound.seed, bound.realisations) == (model.name, seeds[0], len(seeds))
        and math.isclose(bound.duration, duration, rel_tol=SAME_DURATION)
    }
    # A model that was changed after it was read keeps its name.
    if found and not (model.name in builtin_models() and load_model(model.name).hash == model.hash):
        return {}
    return found


def score(change: float, bound: Bound) -> float:
    """A change against open loop as a share of the bound's: 0 is open loop, 1 the bound."""
    return change / bound.value
