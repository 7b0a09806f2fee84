"""The comparison as a table for people and as files: JSON, CSV, Markdown and a figure.

Names in JSON and CSV end in their SI unit, `rbm_rms_Nm`; without one they are of pure numbers, changes as fractions.
"""

from __future__ import annotations

import csv
import io
import json
import os
import textwrap
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from flapgym.control.linear_loop import LinearLoop
from flapgym.core.atomic import check_target, write_together
from flapgym.core.wording import number
from flapgym.envs.spec import plain
from flapgym.evaluation.bootstrap import Estimate
from flapgym.evaluation.channels import ChannelScore
from flapgym.evaluation.comparison import Comparison, Score
from flapgym.evaluation.figure import draw_figure, figure_is_possible
from flapgym.evaluation.metrics import EQUIVALENT_FREQUENCY
from flapgym.evaluation.published import METRICS, Bound
from flapgym.evaluation.published import score as share_of_bound
from flapgym.evaluation.tables import WIDTH, markdown_table, percent, plain_name, text_table

CHANGES = {
    "rbm_rms_change": "RBM rms",
    "rbm_del_change": "RBM DEL",
    "rbm_del_summed_change": "RBM DEL, damage summed",
    "tip_rms_change": "tip rms",
    "tower_rms_change": "tower rms",
}
SCORES = {"rbm_rms": "score rms", "rbm_del": "score DEL"}
"""Columns of the scores by metric of `flapgym.evaluation.published.METRICS`."""
_UNITS = {
    "rbm_rms": "Nm",
    "rbm_del": "Nm",
    "flap_angle_max": "rad",
    "flap_rate_max": "rad_per_s",
    "flap_travel": "rad_per_s",
    "pitch_travel": "rad_per_s",
}
"""With which the names of a score's numbers end in JSON and CSV."""
FEW = 10
"""Below this number of realisations the table calls its intervals indicative."""

CHANNELS_CAPTION = (
    "Every load channel by S-N slope. DEL [%]: mean of the realisations' ratios to open loop, each realisation of one "
    "weight. DEL and DEL, damage summed [%]: of the damage of all blades and realisations together."
)
STEADY_CAPTION = (
    "Turbulence alone: less what shear, tower and weight do to flaps at rest, the same under every agent. A flap that "
    "takes some of that off lowers all loads, and is charged for it in turbulence alone."
)

SHORT = (
    *(f"{label} [%]" for label in CHANGES.values()),
    *SCORES.values(),
    "RBM DEL [MN m]",
    "max angle [deg]",
    "travel [deg/s]",
    "pitch travel [deg/s]",
)
"""Columns of a table for a first look, beside the agent."""
CHANNEL_KEYS = 3
"""Columns that tell what a row of the channels is of."""

FILES = ("compare.json", "compare.csv", "compare.md", "compare.png")


def writable_folder(output: str | os.PathLike[str], files: Iterable[str] = ()) -> Path:
    """The folder for the results, made if missing; refused if nothing, or one of these files not, can be written."""
    folder = Path(output)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f"output {folder}: cannot make this folder ({error.strerror})") from None
    if not os.access(folder, os.W_OK):
        raise ValueError(f"output {folder}: cannot write in this folder; name another")
    for name in files:
        check_target(folder / name)
    return folder


def write_report(comparison: Comparison, folder: str | os.PathLike[str]) -> None:
    """Write compare.json, .csv, .md and, where matplotlib is installed, .png: all of them or none."""
    folder = Path(folder)
    document = json.dumps(as_json(comparison), indent=2, allow_nan=False) + "\n"
    contents = [document.encode(), as_csv(comparison).encode(), as_markdown(comparison).encode()]
    if figure_is_possible():
        contents.append(draw_figure(comparison))
    write_together({folder / name: content for name, content in zip(FILES, contents, strict=False)})


def as_json(comparison: Comparison) -> dict[str, Any]:
    """Plain values in SI units, which end their names; changes are fractions of open loop."""
    return {
        "model": {
            "name": comparison.model_name,
            "hash": comparison.model_hash,
            "turbine": comparison.nameplate.turbine,
            "rotor_radius_m": comparison.nameplate.rotor_radius,
            "hub_height_m": comparison.nameplate.hub_height,
        },
        "realisations": comparison.realisations,
        "seed": comparison.seed,
        "duration_s": comparison.duration,
        "wind_speed_m_per_s": comparison.wind_speed,
        "slope": comparison.slope,
        "environment": comparison.environment,
        "settings": plain(comparison.settings),
        "bounds": {
            metric: {name: getattr(bound, name) for name in ("value", "gap", "kind")}
            for metric, bound in comparison.bounds.items()
        },
        "agents": {
            name: _numbers(comparison, name) | _channels(comparison, name) for name in comparison.scores
        },
    }


def _numbers(comparison: Comparison, name: str) -> dict[str, Any]:
    """All that is told of an agent but its channels, by name with unit; None where something is not known."""
    found = comparison.scores[name]
    numbers = {
        f"{field}_{_UNITS[field]}" if field in _UNITS else field: value
        for field, value in asdict(found).items()
    }
    scores = {f"score_{metric}": _score(comparison, found, metric) for metric in METRICS}
    return numbers | scores | _loop(comparison.loops.get(name))


def _loop(loop: LinearLoop | None) -> dict[str, Any]:
    """Stability and margin of a linear loop; None where they are not known, and of growth where nothing grows."""
    grows, margin = (None, None) if loop is None else (loop.growth, loop.margin)
    values = {
        "growth_frequency_Hz": None if grows is None else grows.frequency,
        "doubling_time_s": None if grows is None else grows.doubling_time,
        "disk_margin": None if margin is None else margin.alpha,
        "disk_margin_frequency_Hz": None if margin is None else margin.frequency,
    }
    finite = {
        name: None if value is None or not np.isfinite(value) else value for name, value in values.items()
    }
    return {"linear_loop_stable": None if loop is None else loop.stable, **finite}


def _score(comparison: Comparison, found: Score, metric: str) -> float | None:
    """0 is open loop, 1 the bound; None where none is published."""
    bound = comparison.bounds.get(metric)
    change: Estimate = getattr(found, f"{metric}_change")
    return None if bound is None else share_of_bound(change.mean, bound)


def _channels(comparison: Comparison, name: str) -> dict[str, list[dict[str, Any]]]:
    """An agent's entry of channels, where they were scored."""
    scores = comparison.channels.get(name)
    return {} if scores is None else {"channels": [_channel(score) for score in scores]}


def _channel(score: ChannelScore) -> dict[str, Any]:
    """A channel's entry; `turbulence_alone` is in it where something else loads the turbine, too."""
    entry = asdict(score)
    alone = entry.pop("turbulence")
    if alone is not None:
        # Of the channel named above it.
        entry["turbulence_alone"] = {name: alone[name] for name in ("unit", "rms", "rms_change", "slopes")}
    return entry


def as_csv(comparison: Comparison) -> str:
    """One row an agent, the three numbers of a change in columns of their own."""
    rows = []
    for name in comparison.scores:
        row: dict[str, Any] = {"agent": plain_name(name)}
        for field, value in _numbers(comparison, name).items():
            if isinstance(value, dict):
                row |= {f"{field}_{key}": entry for key, entry in value.items()}
            else:
                row[field] = value
        rows.append(row)
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def as_markdown(comparison: Comparison) -> str:
    """The table with its caption and remarks, and that of the channels where they were scored."""
    lines = [_caption(comparison), "", *markdown_table(*cells(comparison)), "", *_remarks(comparison)]
    if comparison.channels:
        lines += ["", *_channels_caption(comparison), "", *markdown_table(*_channel_cells(comparison))]
    return "\n".join(lines) + "\n"


def as_text(comparison: Comparison, width: int = WIDTH) -> str:
    """The same for a terminal: lines are broken and tables cut into blocks of columns that fit into its width."""
    lines = [*textwrap.wrap(_caption(comparison), width), "", *text_table(*cells(comparison), width), ""]
    for remark in _remarks(comparison):
        lines += textwrap.wrap(remark, width)
    if comparison.channels:
        for line in _channels_caption(comparison):
            lines += ["", *textwrap.wrap(line, width)]
        lines += ["", *text_table(*_channel_cells(comparison), width, CHANNEL_KEYS)]
    return "\n".join(lines)


def cells(comparison: Comparison) -> tuple[list[str], list[list[str]]]:
    """Header and rows; what is asked for first stands first, as a terminal may show the table in blocks."""
    pitches = any(found.pitch_travel for found in comparison.scores.values())
    labels = [f"{label} [%]" for label in CHANGES.values()]
    header = ["agent", *labels[:3], *SCORES.values(), *labels[3:], "RBM rms [MN m]", "RBM DEL [MN m]"]
    header += ["max angle [deg]", "max rate [deg/s]", "travel [deg/s]"]
    header += ["pitch travel [deg/s]"] if pitches else []
    header += ["linear loop", "disk margin"]
    return header, [_row(comparison, name, found, pitches) for name, found in comparison.scores.items()]


def _told_apart(comparison: Comparison) -> bool:
    """Whether turbulence alone is told beside all loads."""
    return any(score.turbulence is not None for scores in comparison.channels.values() for score in scores)


def _channels_caption(comparison: Comparison) -> list[str]:
    return [CHANNELS_CAPTION, STEADY_CAPTION] if _told_apart(comparison) else [CHANNELS_CAPTION]


def _channel_cells(comparison: Comparison) -> tuple[list[str], list[list[str]]]:
    loads = ["rms", "rms [%]", "DEL", "DEL [%]", "DEL, damage summed [%]"]
    header = ["channel", "S-N slope", "agent"]
    if _told_apart(comparison):
        header += [f"{whose}: {load}" for whose in ("all loads", "turbulence alone") for load in loads]
    else:
        header += loads
    by_channel = zip(*comparison.channels.values(), strict=True)
    rows = []
    for agents in by_channel:
        for place in range(len(agents[0].slopes)):
            for name, score in zip(comparison.channels, agents, strict=True):
                row = [score.channel, number(score.slopes[place].slope), name]
                for each in (score, score.turbulence):
                    row += [] if each is None else _load_cells(each, place)
                rows.append(row)
    return header, rows


def _load_cells(score: ChannelScore, place: int) -> list[str]:
    at = score.slopes[place]
    return [
        _with_unit(score.rms, score.unit),
        percent(score.rms_change),
        _with_unit(at.equivalent_load, score.unit),
        percent(at.change),
        percent(at.summed_change),
    ]


def _with_unit(value: float, unit: str) -> str:
    if unit == "N m":
        return f"{value / 1e6:.3f} MN m"
    return f"{value:.4g} {unit}".rstrip()


def _row(comparison: Comparison, name: str, found: Score, pitches: bool) -> list[str]:
    changes = [percent(getattr(found, field)) for field in CHANGES]
    scores = [_score(comparison, found, metric) for metric in SCORES]
    told = ["" if value is None else f"{value:.2f}" for value in scores]
    cells = [name if found.made_for_this_model else f"{name} *", *changes[:3], *told, *changes[3:]]
    cells += [f"{value / 1e6:.3f}" for value in (found.rbm_rms, found.rbm_del)]
    motion = [found.flap_angle_max, found.flap_rate_max, found.flap_travel]
    cells += [f"{np.rad2deg(value):.2f}" for value in motion + ([found.pitch_travel] if pitches else [])]
    loop = comparison.loops.get(name)
    if loop is None:
        return [*cells, "", ""]
    return [*cells, _stability(loop), "" if loop.margin is None else f"{loop.margin.alpha:.2f}"]


def _stability(loop: LinearLoop) -> str:
    """What the table says of a loop in two words; the remarks tell the pace of what grows."""
    if loop.growth is None:
        return "stable" if loop.stable else ""
    place = "" if np.isnan(loop.growth.frequency) else f" at {loop.growth.frequency:.2f} Hz"
    return f"grows{place}"


def _caption(comparison: Comparison) -> str:
    count = comparison.realisations
    where = "" if comparison.environment is None else f"environment {comparison.environment}, "
    return (
        f"Change against open loop on the same {count} realisation{'s' if count > 1 else ''} of "
        f"{comparison.duration:.0f} s, {where}{_wind(comparison)}model {comparison.model_name} "
        f"({comparison.model_hash[:12]}), turbine {comparison.nameplate.size}: "
        "mean of the ratios over blades and realisations, 95 % paired bootstrap interval."
    )


def _wind(comparison: Comparison) -> str:
    """Mean wind, and what the settings say of turbulence, gust and field, each followed by a comma."""
    wind = plain(comparison.settings).get("wind", {})
    told = [f"wind {number(comparison.wind_speed)} m/s"]
    for entry in (wind, wind.get("field") or {}):
        intensity, length = entry.get("turbulence_intensity"), entry.get("length_scale")
        told += [] if intensity is None else [f"turbulence intensity {100 * intensity:.4g} %"]
        told += [] if length is None else [f"length scale {number(length)} m"]
    told += [
        f"file {entry['file']}" for name in ("gust", "field") if "file" in (entry := wind.get(name) or {})
    ]
    return "".join(f"{part}, " for part in told)


def _bound(column: str, bound: Bound) -> str:
    gap = "" if bound.gap is None else f" (the best sequence found stays {100 * bound.gap:.1f} points behind)"
    kind = "" if bound.kind == "bound" else ", the best sequence found, which is no bound"
    return f"{column} {100 * bound.value:+.1f} %{gap}{kind}"


def _remarks(comparison: Comparison) -> list[str]:
    remarks = [
        f"DEL: damage-equivalent load, S-N slope {number(comparison.slope)}, {number(EQUIVALENT_FREQUENCY)} Hz. With "
        "the damage summed over all realisations first, those of the largest loads decide, as in a lifetime."
    ]
    if comparison.loops:
        remarks.append(
            "Linear loop and disk margin: with the model alone; stops, sensors and actuators are left out."
        )
    if comparison.realisations == 1:
        remarks.append("One realisation gives no interval.")
    elif comparison.realisations < FEW:
        remarks.append(f"Intervals from {comparison.realisations} realisations are indicative.")
    if any(not score.made_for_this_model for score in comparison.scores.values()):
        remarks.append("* made for another model than this one.")
    for name, loop in comparison.loops.items():
        if loop.growth is not None:
            remarks.append(f"{name}: its linear loop {loop.growth}; here the stops bound it.")
    if comparison.bounds:
        told = [_bound(SCORES[metric], bound) for metric, bound in comparison.bounds.items()]
        remarks.append(f"Scores: 0 is open loop, 1 what no controller passes: {'; '.join(told)}.")
    if not figure_is_possible():
        remarks.append("No figure: matplotlib is not installed (pip install 'flapgym[baselines]').")
    return remarks
