"""Registers the environments with Gymnasium; string entry points, so nothing heavy is loaded before `make`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import gymnasium

TURBINE_ID = "flapgym/NREL5MW-v1"


@dataclass(frozen=True)
class Registered:
    """An environment with an id of its own.

    Attributes
    ----------
    id : str
    summary : str
        What it is, for its page: one sentence, then what a reader has to know.
    keywords : mapping
        Keywords that differ from the defaults of its class.
    manual : str
        What its page says in place of the manual of its class, which holds for all else.
    entry_point, vector_entry_point : str
        Of its classes.
    agents : str
        The set of shipped agents made for its turbine: a folder of `flapgym/control/agents`; empty if there is none.
    """

    id: str
    summary: str
    keywords: Mapping[str, Any] = field(default_factory=dict)
    manual: str = ""
    entry_point: str = "flapgym.envs.single:FlapEnv"
    vector_entry_point: str = "flapgym.envs.vector:FlapVectorEnv"
    agents: str = "nrel5mw-corrected"


BLADE_MANUAL = """\
The design model of Ng et al., on which their controllers are made: a rotating blade, clamped at its root, in
homogeneous turbulence with one trailing-edge flap over 20 % of its lifting span and 10 % of its chord, without tower,
shaft and neighbours. It has a third of the turbine's states and one of everything, for quick study; what is learnt on
it can be tried on the turbine, blade by blade. Any model gives its blade with `single_blade=True`, several flaps
included.

- **Actions** and what is **observed** are one in place of three: `rbm`, `flap_angle`, `flap_rate`, `tip_deflection`,
  and `wind`. A blade does not know `azimuth` and `tower_top`.
- **Reward**: the moment's constant is the open-loop rms of this blade in the model's reference turbulence, so that
  doing nothing earns about -1 a step on average here too. `task.tower_weight` must be zero.
- **Information**: without `azimuth` and `tower_top`; what is one a blade on the turbine has shape (1,).
- **Faults**: `actuators.stuck` and `actuators.effectiveness` have three entries here too, of which the first counts.
- The option `azimuth` of `reset` has no effect."""

RANGE_MANUAL = """\
Each episode has a mean wind of its own, for which the set of models has one: its rotor speed, torque and collective
pitch, linear about that operating point. [From cut-in to cut-out](../range.md) tells where each model holds, and what
wind and loads are there.

- **Keywords**: `model` is the name of a set of models, or a file of `flapgym build --wind-speeds`. `wind_speed=(low,
  high)` [m/s] bounds what is drawn: the speeds of the set within, each as likely as another; by default all.
- **Observed**, if `task.observe` has it: `wind_speed`, 1 entry [m/s], bound 100. It is what rotor speed and pitch tell
  of the mean wind, slowly; an agent is told it in no other way.
- **Observation space**: bounds of `rbm` are the widest of all models.
- **Reward**: the moment's constant is that of the episode's model, so that doing nothing earns about as much at each
  wind speed.
- **Starting state**: an episode is that of one wind speed with the same seed, `FlapEnv(model="nrel5mw-range",
  wind_speed=...)`. The option `wind_speed` of `reset` chooses it: a number, or in a vector one for each.
- **Information**: `wind_speed`, from both [m/s].
- **Vectors**: `FlapRangeVectorEnv`. Each turbine draws a wind speed at each of its resets; those at one wind speed are
  stepped together."""

_FAMILIES = (
    Registered("flapgym/NREL5MW", "The turbine of three blades in homogeneous turbulence."),
    Registered(
        "flapgym/NREL5MWBlade",
        "The clamped single blade, the paper's design model: one flap, one moment.",
        {"single_blade": True},
        manual=BLADE_MANUAL,
    ),
    Registered(
        "flapgym/NREL5MWGust",
        "The turbine in an extreme operating gust, in still air otherwise. The gust is that of IEC 61400-1 (2005) for "
        "class IA; it begins after 5 s and raises the wind by 4.2 m/s at its peak. Azimuth is all that differs between "
        "episodes.",
        {"wind": {"gust": {"kind": "extreme_operating_gust", "start": 5.0}, "turbulence_intensity": 0.0}},
    ),
    Registered(
        "flapgym/NREL5MWNoisyDelayed",
        "The turbine whose moments are measured late and with noise. White noise of 20 kN m rms (some 2 % of the "
        "open-loop rms) and a delay of 49 ms, seven plant steps.",
        {"sensors": {"noise": 2e4, "delay": 0.049}},
    ),
    Registered(
        "flapgym/NREL5MWActuatorLag",
        "The turbine whose flaps lag behind their commands. A flap's acceleration follows its command with a "
        "first-order lag of 50 ms; a controller that does not know of it loses phase.",
        {"actuators": {"lag": 0.05}},
    ),
    Registered(
        "flapgym/NREL5MWStuckFlap",
        "The turbine with the flap of blade 2 stuck at 5 deg. Its commands are ignored. The blade carries the steady "
        "load of that angle, which no other flap can take off: doing nothing earns about -1.05 a step here.",
        {"actuators": {"stuck": [None, 0.08726646259971647, None]}},
    ),
    Registered(
        "flapgym/NREL5MWFloatingFlap",
        "The turbine with the flap of blade 2 floating. Its actuator moves as commanded, but the flap has come loose "
        "and aligns itself with the flow: it does nothing to the air.",
        {"actuators": {"effectiveness": [1.0, 0.0, 1.0]}},
    ),
    Registered(
        "flapgym/NREL5MWWeakFlap",
        "The turbine whose flap on blade 3 does 60 % of what the others do.",
        {"actuators": {"effectiveness": [1.0, 1.0, 0.6]}},
    ),
    Registered(
        "flapgym/NREL5MWHeavyBlade",
        "The turbine with blade 1 heavier by 5 %, as ice can make it. The rotor is out of balance: the model follows "
        "the azimuth, and in still air the tower top moves 26 mm to either side once a revolution, the root moments "
        "hardly. It is stepped sample by sample in numpy, whatever `backend` and `precision` say, at about a hundredth "
        "of the others' speed.",
        {"model": "nrel5mw-corrected-heavy-blade"},
    ),
)
_PAPER = "nrel5mw-rated"
_PAPER_MODELS = {"nrel5mw-corrected-heavy-blade": "nrel5mw-heavy-blade"}


def _of_the_paper(entry: Registered) -> Registered:
    """Version 0 of an environment: the same on the turbine as the paper reads it."""
    model = entry.keywords.get("model")
    keywords = {**entry.keywords, "model": _PAPER if model is None else _PAPER_MODELS[model]}
    summary = (
        f"{entry.summary} Version 0 is the turbine as the paper reads it, its beam at the quarter chords."
    )
    return replace(entry, id=f"{entry.id}-v0", summary=summary, keywords=keywords, agents=_PAPER)


_SITE: Mapping[str, Any] = {
    "wind": {
        "field": {"kind": "kaimal", "turbulence_class": "B"},
        "inflow": {"shear_exponent": 0.2, "tower_shadow": True},
    },
    "gravity": True,
}
_AT_A_SITE = (
    Registered(
        "flapgym/NREL5MWField-v0",
        "The turbine in a field of turbulence, which each blade meets for itself. It is von Karman's, with the base "
        "case's intensity and length; a turning blade meets slow eddies again at every turn, so part of the load comes "
        "once, twice and three times a revolution.",
        {"model": "nrel5mw-site", "wind": {"field": {"kind": "von_karman"}}},
    ),
    Registered(
        "flapgym/NREL5MWSite-v0",
        "The turbine at a site: a field of turbulence, shear, the tower ahead of the blades, gravity. It is the one to "
        "report on. The turbulence is the normal one of IEC 61400-1 (2005), class B, with its Kaimal spectrum and "
        "exponential coherence; the shear exponent is 0.2. Loads are told about their steady means.",
        {"model": "nrel5mw-site", **_SITE},
    ),
    Registered(
        "flapgym/NREL5MWThreeFlaps-v0",
        "The same site with three flaps a blade, each over 15 % of the lifting span, from 50 to 95 % of it.",
        {"model": "nrel5mw-three-flaps", **_SITE},
        agents="",
    ),
    Registered(
        "flapgym/NREL5MWPitch-v0",
        "The same site, and beside its flap each blade pitches by itself. Six actions: accelerations of the flaps of "
        "blades 1 to 3, then pitch demanded of them, from -1 to 1 for 5 deg to either side of the operating point's. "
        "The pitch actuator is of second order with 0.5 Hz and at most 8 deg/s. The shipped agents move the flaps "
        "alone.",
        {"model": "nrel5mw-site", **_SITE, "pitch": True},
    ),
)
_RANGE = Registered(
    "flapgym/NREL5MWRange-v0",
    "The same site from cut-in to cut-out. Each episode has a mean wind of its own, 5, 7, 9 to 25 m/s, or those within "
    "`wind_speed=(low, high)`; torque and collective pitch hold the rotor's speed, which moves about the operating "
    "point's.",
    {"model": "nrel5mw-range", **_SITE},
    manual=RANGE_MANUAL,
    entry_point="flapgym.envs.operating_range:FlapRangeEnv",
    vector_entry_point="flapgym.envs.range_vector:FlapRangeVectorEnv",
    agents="",
)
ENVIRONMENTS = (
    *(replace(entry, id=f"{entry.id}-v1") for entry in _FAMILIES),
    *_AT_A_SITE,
    _RANGE,
    *(_of_the_paper(entry) for entry in _FAMILIES),
)
"""Every environment of the package: version 1 on the turbine held to OpenFAST, version 0 on the paper's."""


def register_environments() -> None:
    """Register every environment of the package, once."""
    for entry in ENVIRONMENTS:
        if entry.id not in gymnasium.registry:
            gymnasium.register(
                id=entry.id,
                entry_point=entry.entry_point,
                vector_entry_point=entry.vector_entry_point,
                kwargs=dict(entry.keywords),
                # The environment itself sees to the order of calls and checks its actions; the wrappers that do it for
                # others would take a tenth of a step.
                order_enforce=False,
                disable_env_checker=True,
            )
