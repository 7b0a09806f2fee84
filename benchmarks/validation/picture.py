"""Step, turbulence and spectra in one picture, legible also when it is 400 pixels wide. Needs matplotlib."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.validation.comparison import PROGRAMS, Comparison
from benchmarks.validation.measures import BANDS, spectrum
from benchmarks.validation.reference import Series
from flapgym.core.arrays import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = {"BeamDyn": "black", "ElastoDyn": "#e08214"}
OURS = ("#1f6fb4", "#d6308f", "#2a9d5c")  # model after model, again from the first after the last
WIDTHS = (2.6, 1.3)  # of the first model, of the others
STEP_WINDOW = (-1.0, 9.0)  # s, about the step
TURBULENCE_WINDOW = (80.0, 115.0)  # s
MEGA = 1e6


def draw(comparisons: Sequence[Comparison]) -> bytes:
    """The picture as a PNG of 1280 pixels' width: OpenFAST, the first model over it, the others thinner."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    # 13 points on 6.4 inches are still 11 pixels high when the picture is shown 400 pixels wide.
    with rc_context({"font.size": 13.0, "axes.titlesize": 13.0}):
        figure = Figure(figsize=(6.4, 9.6), layout="constrained")
        step, turbulence, spectra = figure.subplots(3, 1)
        draw_step(step, comparisons)
        draw_turbulence(turbulence, comparisons)
        draw_spectra(spectra, comparisons)
        for axis in (step, turbulence, spectra):
            axis.grid(color="0.9")
            axis.set_axisbelow(True)
        handles, labels = step.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=2, frameon=False)
        content = io.BytesIO()
        figure.savefig(content, format="png", dpi=200)
    return content.getvalue()


def curves(
    axis: Axes,
    pairs: Mapping[str, Mapping[str, tuple[Series, Series]]],
    of: Callable[[Series], tuple[Array, Array]],
) -> None:
    """OpenFAST's two programs, and the models, by name, under the first one's wind on top."""
    theirs = next(iter(pairs.values()))
    for name in PROGRAMS:
        axis.plot(*of(theirs[name][1]), label=name, color=COLOURS[name], linewidth=2.0)
    for index, (name, ours) in enumerate(pairs.items()):
        axis.plot(
            *of(ours[PROGRAMS[0]][0]),
            label=name,
            color=OURS[index % len(OURS)],
            linewidth=WIDTHS[min(index, 1)],
            zorder=3.0 - 0.1 * index,
        )


def draw_step(axis: Axes, comparisons: Sequence[Comparison]) -> None:
    """Root moment from its value before the step."""

    def moved(series: Series) -> tuple[Array, Array]:
        at = series.time[np.argmax(np.diff(series.wind))]
        shown = series.between(at + STEP_WINDOW[0], at + STEP_WINDOW[1])
        before = shown.rbm[shown.time <= at].mean()
        return shown.time - at, (shown.rbm - before) / MEGA

    curves(axis, {each.model: each.step for each in comparisons}, moved)
    axis.set(title="Wind steps from 11 to 12 m/s", xlabel="time [s]", ylabel="RBM [MN m]", xlim=STEP_WINDOW)


def draw_turbulence(axis: Axes, comparisons: Sequence[Comparison]) -> None:
    """Some half a minute of root moment about its mean."""

    def about_mean(series: Series) -> tuple[Array, Array]:
        shown = series.between(*TURBULENCE_WINDOW)
        return shown.time, (shown.rbm - series.rbm.mean()) / MEGA

    curves(axis, {each.model: each.turbulence for each in comparisons}, about_mean)
    axis.set(title="The same turbulence", xlabel="time [s]", ylabel="RBM [MN m]", xlim=TURBULENCE_WINDOW)


def draw_spectra(axis: Axes, comparisons: Sequence[Comparison]) -> None:
    """Power spectral densities over the bands of the table."""

    def density(series: Series) -> tuple[Array, Array]:
        frequency, power = spectrum(series.rbm, series.time_step)
        return frequency[1:], power[1:] / MEGA**2

    curves(axis, {each.model: each.turbulence for each in comparisons}, density)
    edges = [BANDS[0][0], *(high for _, high in BANDS)]
    axis.set(
        title="Spectrum of the moment",
        xlabel="frequency [Hz]",
        ylabel="[(MN m)$^2$/Hz]",
        xscale="log",
        yscale="log",
        xlim=(BANDS[0][0], BANDS[-1][1]),
        ylim=(1e-5, 30.0),
    )
    # The bands of the table are what one looks for here.
    axis.set_xticks(edges, [f"{edge:g}" for edge in edges])
    axis.set_xticks([], minor=True)
