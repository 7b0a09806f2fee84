"""The loads of a life as tables for people and as files: JSON, CSV, Markdown and a figure."""

from __future__ import annotations

import csv
import io
import json
import textwrap
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from flapgym.control import OpenLoop
from flapgym.core.atomic import write_together
from flapgym.core.wording import number
from flapgym.envs.linear_range import LINEAR_SHARE
from flapgym.evaluation.figure import CLOSED, INFLOW, OPEN, figure_is_possible
from flapgym.evaluation.lifetime_loads import WEIBULL_SHAPE, YEAR
from flapgym.evaluation.lifetime_study import Lifetime, LifetimeLoad
from flapgym.evaluation.metrics import EQUIVALENT_FREQUENCY, FATIGUE_SLOPE
from flapgym.evaluation.tables import WIDTH, markdown_table, percent, plain_name, text_table

FILES = ("lifetime.json", "lifetime.csv", "lifetime.md", "lifetime.png")
STEEL = 4.0
"""S-N slope of welded steel, which the tower's columns have."""
COLUMNS = {
    "rbm": ("flapwise", FATIGUE_SLOPE),
    "rbm_edge": ("edgewise", FATIGUE_SLOPE),
    "tower_base_fore_aft": ("tower base", STEEL),
    "tilt_moment": ("tower top tilt", STEEL),
    "yaw_moment": ("tower top yaw", STEEL),
    "tower_top_acceleration_fore_aft": ("tower top acceleration", STEEL),
}
"""Columns of the first table, those that a model tells: label and slope by channel."""
HEADLINE = "rbm"
"""Channel whose damage is shown by wind speed."""

DUTY = {
    "flap_travel": ("flap travel [deg/s]", 2, True),
    "flap_cycles": ("flap cycles over the life [million]", 2, False),
    "flap_rate_max": ("largest flap rate [deg/s]", 1, True),
    "flap_power": ("flap power per inertia [W/(kg m^2)]", 3, False),
    "pitch_travel": ("pitch travel [deg/s]", 3, True),
    "pitch_cycles": ("pitch cycles over the life [million]", 3, False),
    "pitch_rate_max": ("largest pitch rate [deg/s]", 2, True),
}
"""Columns of the table of actuators: label, decimals, and whether it is an angle."""
UNITS = {
    "flap_travel": "rad_per_s",
    "flap_cycles": "",
    "flap_rate_max": "rad_per_s",
    "flap_power": "w_per_kg_m2",
    "pitch_travel": "rad_per_s",
    "pitch_cycles": "",
    "pitch_rate_max": "rad_per_s",
}
"""With which their names end in files."""


def write_lifetime(life: Lifetime, folder: Path) -> None:
    """Write lifetime.json, .csv, .md and, where matplotlib is installed, .png: all of them or none."""
    document = json.dumps(lifetime_json(life), indent=2, allow_nan=False) + "\n"
    contents = [document.encode(), _csv(life).encode(), lifetime_markdown(life).encode()]
    if figure_is_possible():
        contents.append(draw_lifetime(life))
    write_together({folder / name: content for name, content in zip(FILES, contents, strict=False)})


def lifetime_json(life: Lifetime) -> dict[str, Any]:
    """Plain values in SI units, units in the names; changes are fractions of open loop."""
    return {
        "design_load_case": "IEC 61400-1 1.2",
        "wind_class": life.wind_class,
        "turbulence_class": life.turbulence_class,
        "mean_wind_m_per_s": life.mean_wind,
        "lifetime_years": life.years,
        "running_share": life.running,
        "equivalent_frequency_hz": EQUIVALENT_FREQUENCY,
        "duration_s": life.duration,
        "gravity": life.gravity,
        "speed_loop": life.speed_loop,
        "bins": [
            {
                "wind_speed_m_per_s": each.wind_speed,
                "low_m_per_s": each.low,
                "high_m_per_s": each.high,
                "probability": each.probability,
                "seeds": list(seeds),
                "model": name,
                "model_hash": of_model,
            }
            for each, seeds, name, of_model in zip(
                life.bins, life.seeds, life.model_names, life.model_hashes, strict=True
            )
        ],
        "agents": {
            name: {
                "designed_for": life.designed[name],
                "loads": [_load(each) for each in loads],
                "duty": {_named(key): value for key, value in asdict(life.duties[name]).items()},
            }
            for name, loads in life.loads.items()
        },
    }


def _load(load: LifetimeLoad) -> dict[str, Any]:
    return {
        "channel": load.channel,
        "unit": load.unit,
        "slope": load.slope,
        "equivalent_load": load.equivalent_load,
        "change": asdict(load.change),
        "damage_by_bin": list(load.damage),
    }


def _named(duty: str) -> str:
    return f"{duty}_{UNITS[duty]}".rstrip("_")


def _csv(life: Lifetime) -> str:
    """One row an agent, channel and slope; damage by wind speed in columns."""
    rows = []
    for name, loads in life.loads.items():
        for load in loads:
            row: dict[str, Any] = {"agent": plain_name(name), "designed_for": life.designed[name]}
            row |= {
                key: value for key, value in _load(load).items() if key not in ("change", "damage_by_bin")
            }
            row |= {
                "change": load.change.mean,
                "change_low": load.change.low,
                "change_high": load.change.high,
            }
            row |= {
                f"damage_at_{number(each.wind_speed)}_m_per_s": part
                for each, part in zip(life.bins, load.damage, strict=True)
            }
            rows.append(row | {_named(key): value for key, value in asdict(life.duties[name]).items()})
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def lifetime_markdown(life: Lifetime) -> str:
    """All tables with captions and remarks."""
    lines = ["# Loads over the life", ""]
    for caption, header, rows in _tables(life):
        lines += [caption, "", *markdown_table(header, rows), ""]
    return "\n".join([*lines, *(f"- {remark}" for remark in _remarks(life))]) + "\n"


def lifetime_text(life: Lifetime, width: int = WIDTH) -> str:
    """The same for a terminal: lines are broken and tables cut into blocks of columns that fit into its width."""
    lines = []
    for caption, header, rows in _tables(life):
        lines += [*textwrap.wrap(caption, width), "", *text_table(header, rows, width), ""]
    for remark in _remarks(life):
        lines += textwrap.wrap(remark, width)
    return "\n".join(lines)


def _tables(life: Lifetime) -> list[tuple[str, list[str], list[list[str]]]]:
    """Loads, damage by wind speed, actuators: caption, header and rows of each."""
    return [
        (_caption(life), *_changes(life)),
        (_damage_caption(), *_damage(life)),
        (_duty_caption(life), *_duties(life)),
    ]


def _changes(life: Lifetime) -> tuple[list[str], list[list[str]]]:
    told = {load.channel for load in life.loads[OpenLoop.name]}
    columns = {channel: column for channel, column in COLUMNS.items() if channel in told}
    header = ["agent", "designed for"]
    header += [f"{label}, m {number(slope)} [%]" for label, slope in columns.values()]
    header += ["flapwise [MN m]", "pitch travel [deg/s]"]
    rows = []
    for name in life.loads:
        row = [name, life.designed[name]]
        row += [percent(_at(life, name, channel, slope).change) for channel, (_, slope) in columns.items()]
        row.append(f"{_at(life, name, HEADLINE, FATIGUE_SLOPE).equivalent_load / 1e6:.3f}")
        row.append(f"{np.rad2deg(life.duties[name].pitch_travel):.3f}")
        rows.append(row)
    return header, rows


def _damage(life: Lifetime) -> tuple[list[str], list[list[str]]]:
    header = ["agent", *(f"{number(each.wind_speed)} m/s" for each in life.bins), "all"]
    rows = [["share of the life", *(f"{each.probability:.1%}" for each in life.bins), f"{life.running:.1%}"]]
    for name in life.loads:
        parts = _at(life, name, HEADLINE, FATIGUE_SLOPE).damage
        rows.append([name, *(f"{100 * part:.1f}" for part in (*parts, sum(parts)))])
    return header, rows


def _duties(life: Lifetime) -> tuple[list[str], list[list[str]]]:
    rows = []
    for name, duty in life.duties.items():
        row = [name]
        for key, (label, digits, angle) in DUTY.items():
            value = getattr(duty, key)
            value = np.rad2deg(value) if angle else value / 1e6 if "million" in label else value
            row.append(f"{value:.{digits}f}")
        rows.append(row)
    return ["agent", *(label for label, _, _ in DUTY.values())], rows


def _at(life: Lifetime, agent: str, channel: str, slope: float) -> LifetimeLoad:
    return next(each for each in life.loads[agent] if each.channel == channel and each.slope == slope)


def _caption(life: Lifetime) -> str:
    first, last, count = life.bins[0], life.bins[-1], len(life.seeds[0])
    return (
        "Change of the lifetime damage-equivalent load against open loop at S-N slope m, 95 % bootstrap interval over "
        f"seeds: {number(life.years)} years of wind class {life.wind_class} (mean {number(life.mean_wind)} m/s, "
        f"Weibull shape {number(WEIBULL_SHAPE)}), turbulence class {life.turbulence_class}, {count} "
        f"realisation{'s' if count > 1 else ''} of {number(life.duration)} s at each of {len(life.bins)} wind speeds "
        f"from {number(first.wind_speed)} to {number(last.wind_speed)} m/s. Flapwise and edgewise: root moments."
    )


def _damage_caption() -> str:
    return (
        f"Where the damage comes from: flapwise root moment, slope {number(FATIGUE_SLOPE)}, by wind speed [% of all of "
        "open loop's damage]."
    )


def _duty_caption(life: Lifetime) -> str:
    return (
        f"What the actuators do: means while the turbine runs, {life.running:.0%} of the life. A cycle is the path "
        "from stop to stop and back."
    )


def _remarks(life: Lifetime) -> list[str]:
    first, last, count = life.bins[0], life.bins[-1], sum(len(each) for each in life.seeds)
    remarks = [
        f"Left out: wind below {number(first.low)} and above {number(last.high)} m/s, {1.0 - life.running:.1%} of the "
        "life, starts, stops, faults and the parked turbine.",
        f"Loads are referred to {number(EQUIVALENT_FREQUENCY)} Hz over the whole life, "
        f"{EQUIVALENT_FREQUENCY * life.years * YEAR:.3g} cycles; their changes do not depend on it.",
        "Flap power is what speeds the flap up, per moment of inertia about its hinge, none of it given back. The "
        "hinge moment of the air is not in the model, and neither is the power against it.",
    ]
    if not life.gravity:
        remarks.append("Without gravity, no input of these models: most of the edgewise load is not there.")
    if not life.speed_loop:
        remarks.append(
            "The rotor's speed is held: without a speed-and-pitch loop, slow collective loads above rated wind are "
            "overstated, and so is what an agent takes off them."
        )
    if len(life.seeds[0]) == 1:
        remarks.append("One realisation a wind speed gives no interval.")
    if life.beyond:
        remarks.append(
            f"In {life.beyond} of {count} realisations the wind over the rotor departs from its mean by more than "
            f"{LINEAR_SHARE:.0%} of it, where linear loads are rough."
        )
    if life.taken_up:
        remarks.append(f"Taken up from an earlier run, in whole or in part: {', '.join(life.taken_up)}.")
    if life.not_kept:
        remarks.append(
            f"Not kept for a later run, as they cannot be told from others: {', '.join(life.not_kept)}."
        )
    if not figure_is_possible():
        remarks.append("No figure: matplotlib is not installed (pip install 'flapgym[baselines]').")
    return remarks


def draw_lifetime(life: Lifetime, file_format: str = "png") -> bytes:
    """Changes of the lifetime load by agent above, its damage by wind speed below; png, svg or pdf."""
    from matplotlib.figure import Figure

    names = [name for name in life.loads if name != OpenLoop.name] or [OpenLoop.name]
    figure = Figure(figsize=(8.0, 3.6 + 0.28 * len(names) + 0.4), layout="constrained")
    above, below = figure.subplots(2, 1, height_ratios=(0.28 * len(names) + 0.6, 2.6))
    for place, name in enumerate(names):
        change = _at(life, name, HEADLINE, FATIGUE_SLOPE).change
        above.barh(place, 100 * change.mean, color=CLOSED, height=0.6)
        if change.low is not None and change.high is not None:
            above.plot([100 * change.low, 100 * change.high], [place, place], color=INFLOW, linewidth=2.0)
    above.set_yticks(range(len(names)), names, parse_math=False)
    above.invert_yaxis()
    above.axvline(0.0, color=OPEN, linewidth=0.8)
    above.set_xlabel("change of the lifetime load [%]")
    figure.suptitle(  # of the figure: long names leave the axes too narrow for it
        f"Flapwise root moment, slope {number(FATIGUE_SLOPE)}: {number(life.years)} years, "
        f"wind class {life.wind_class}, turbulence class {life.turbulence_class}",
        fontsize=10,
    )
    best = min(names, key=lambda name: _at(life, name, HEADLINE, FATIGUE_SLOPE).change.mean)
    speeds = np.array([each.wind_speed for each in life.bins])
    widths = np.array([each.high - each.low for each in life.bins])
    pair = ((OpenLoop.name, OPEN, -0.2), (best, CLOSED, 0.2))
    for name, colour, aside in pair:
        parts = 100 * np.array(_at(life, name, HEADLINE, FATIGUE_SLOPE).damage)
        below.bar(speeds + aside * widths, parts, 0.36 * widths, color=colour, label=name)
    figure.legend(*below.get_legend_handles_labels(), frameon=False, loc="outside lower center", ncols=2)
    below.set_xlabel("mean wind speed [m/s]")
    below.set_ylabel("damage [% of open loop's]")
    below.set_xticks(speeds)
    for axis in (above, below):
        axis.grid(True, linewidth=0.4, alpha=0.5)
        axis.set_axisbelow(True)
    content = io.BytesIO()
    figure.savefig(content, format=file_format, dpi=150)
    return content.getvalue()
