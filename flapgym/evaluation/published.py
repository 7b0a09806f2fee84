"""Bounds that the package ships: how far any controller at all can get, by environment, realisations and metric.

`python -m baselines.bounds` computes them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Annotated

from flapgym.core.fields import Choice, Count, OrNone, Quantity, Text, from_plain
from flapgym.core.files import MEGABYTE, parse_json, read_text
from flapgym.core.wording import shown
from flapgym.model.turbine_model import TurbineModel

METRICS = ("rbm_rms", "rbm_del")
"""Of which there may be bounds: the changes of `flapgym.evaluation.Score` that begin so."""
LARGEST = 4 * MEGABYTE
SAME_DURATION = 1e-6
"""To which durations are one, relative: they are written in decimals."""


@dataclass(frozen=True)
class Bound:
    """How far a metric can be changed at all, on some realisations.

    Attributes
    ----------
    environment : str
        Id.
    model, model_hash : str
    seed, realisations : int
        Of the first, and how many.
    duration : float
        Of each [s].
    metric : {"rbm_rms", "rbm_del"}
        DEL at S-N slope 10.
    value : float
        Change against open loop, a fraction, below zero: mean of the realisations' ratios, as of `Score`.
    gap : float or None
        By which the best sequence that was found stays behind it; None where it is not known.
    kind : {"bound", "feasible"}
        What no controller can pass, or the best sequence that was found, which a better one may.
    """

    environment: Annotated[str, Text()]
    model: Annotated[str, Text()]
    model_hash: Annotated[str, Text()]
    seed: Annotated[int, Count(at_least=0)]
    realisations: Annotated[int, Count(at_least=1)]
    duration: Annotated[float, Quantity("time", above=0.0)]
    metric: Annotated[str, Choice(METRICS)]
    value: Annotated[float, Quantity("fraction", at_least=-1.0, below=0.0)]
    gap: Annotated[float | None, OrNone(Quantity("fraction", at_least=0.0))] = None
    kind: Annotated[str, Choice(("bound", "feasible"))] = "bound"


def read_bounds(path: Path) -> tuple[Bound, ...]:
    """The bounds of a file, none if there is no such file: a JSON list of objects with the fields of `Bound`.

    What else an object says is left to whoever wrote it.

    Raises
    ------
    ValueError
        If the file holds anything else; the message names the entry.
    """
    if not path.is_file():
        return ()
    content = parse_json(f'{{"bounds": {read_text(path, LARGEST)}}}', f"bounds {path}")["bounds"]
    if not isinstance(content, list) or not all(isinstance(entry, dict) for entry in content):
        raise ValueError(f"bounds {path}: expected a list of objects, got {shown(content)}")
    names = {each.name for each in fields(Bound)}
    return tuple(
        from_plain(Bound, {name: entry[name] for name in entry if name in names}, f"bounds[{place}]")
        for place, entry in enumerate(content)
    )


@cache
def _shipped() -> tuple[Bound, ...]:
    return read_bounds(Path(str(resources.files("flapgym.evaluation") / "data" / "bounds.json")))


def bounds_for(
    environment: str | None,
    model: TurbineModel,
    seeds: Sequence[int],
    duration: float,
    bounds: Sequence[Bound] | None = None,
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
    bounds : sequence of Bound, optional
        By default what the package ships.
    """
    asked = (environment, model.name, model.hash, seeds[0], len(seeds))
    return {
        bound.metric: bound
        for bound in (_shipped() if bounds is None else bounds)
        if (bound.environment, bound.model, bound.model_hash, bound.seed, bound.realisations) == asked
        and math.isclose(bound.duration, duration, rel_tol=SAME_DURATION)
    }


def score(change: float, bound: Bound) -> float:
    """A change against open loop as a share of the bound's: 0 is open loop, 1 the bound."""
    return change / bound.value
