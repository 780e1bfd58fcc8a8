# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Figures of a campaign: error, distance and coverage against time; maps, variance and paths of examples."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import InputError, optional_module
from soilmoist_ros.lab.campaign_data import CampaignData, Case, strategies_in
from soilmoist_ros.lab.mission_store import CampaignRun
from soilmoist_ros.reporting import (
    BLUE,
    FAINT,
    INK,
    ORANGE,
    RATE,
    SOFT,
    UNCERTAIN,
    colour_ramp,
    data_uri,
    dwell_text,
    robust_range,
    strategy_text,
    strategy_traits,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
Look = tuple[str, Any, float]  # colour, dashes and width of a line

WIDTH_IN = 10.0
OTHER: Look = (INK, "-.", 1.5)
ERROR = "Mean squared error [(counts/s)²]"
STATED = "95 %, as stated"
MAX_EXAMPLES = 5
KEYS_PER_ROW = 5
GREEN = "#009e73"
SMALL, NORMAL = 8.5, 9.5  # sizes of text [pt]
PNG_DPI = 190
LARGEST_SVG = 250_000  # larger drawings become pictures of pixels [bytes]
TEXT_IN = 174 / 25.4  # width of the text of a journal page [in]
HEIGHTENED, ENLARGED = 1.12, 1.07
"""Height and text of a figure grow by more than the share of the width, to be read on paper."""
FORMATS: Final = ("svg", "pdf")
FOLDER: Final = "figures"
"""Folder of the figures in an output folder."""
_VECTOR: Final[dict[str, Any]] = {
    "pdf.fonttype": 42,  # TrueType, embedded: journals refuse Type 3
    "svg.fonttype": "path",  # needs no fonts of the reader
}
_DATE: Final = {"svg": "Date", "pdf": "CreationDate"}
"""Metadata key of the creation date by format; left out, so that equal figures are equal files."""


def _look(strategy: str) -> Look:
    kind = strategy_traits(strategy)
    return (kind.colour, kind.dashes, kind.width) if kind is not None and kind.colour else OTHER


def _is_baseline(strategy: str) -> bool:
    kind = strategy_traits(strategy)
    return kind is not None and kind.is_baseline


def campaign_figures(data: CampaignData) -> Iterator[tuple[str, Figure]]:
    """Names and figures for publications, without the maps of examples; the number is that of the case, from 1."""
    for case in data.strategy_cases:
        yield f"strategies_{case.number + 1}", of_text_width(strategies_figure(data, case))
    for case in data.cases:
        if interval_strategies(data, case):
            yield f"intervals_{case.number + 1}", of_text_width(intervals_figure(data, case))
    yield "coverage", of_text_width(coverage_figure(data, data.strategy_cases or data.cases))


class _Panel(NamedTuple):
    """One chart of a column of the results against mission time."""

    title: str
    measure: str
    hours: float
    column: str
    lines: Sequence[tuple[str, pd.DataFrame, Look]]  # name, rows and look of each line
    scale: float = 1.0


def strategies_figure(data: CampaignData, case: Case) -> Figure:
    """Distance and error against time, one line per strategy: mean and standard deviation over the runs."""
    rows = data.over_time(case, data.main_dwell(case))
    lines = _by_strategy(rows)
    scale, unit = (1e-3, "km") if rows["distance_m"].max() >= 3000 else (1.0, "m")
    distance = _Panel("Distance driven", f"Distance [{unit}]", case.hours, "distance_m", lines, scale)
    return _charts([distance, _Panel("Error of the map", ERROR, case.hours, "mse", lines)], 2)


def intervals_figure(data: CampaignData, case: Case) -> Figure:
    """Error against time: one panel per strategy, one line per counting interval."""
    rows = data.over_time(case)
    dwells = sorted(rows["dwell"].unique(), key=_dwell_order)
    panels = []
    for strategy in interval_strategies(data, case):
        some = rows[rows["strategy"] == strategy]
        of_dwell = {dwell: some[some["dwell"] == dwell] for dwell in dwells}
        lines = [(dwell_text(d), its, _dwell_look(d, dwells)) for d, its in of_dwell.items() if len(its)]
        panels.append(_Panel(strategy_text(strategy), ERROR, case.hours, "mse", lines))
    return _charts(panels, 3)


def coverage_figure(data: CampaignData, cases: Sequence[Case]) -> Figure:
    """Share of the field whose truth lies in the 95 % interval, against time; one panel per field."""
    measure = "Truth in the interval [% of area]"
    panels = [
        _Panel(case.title, measure, case.hours, "coverage95",
               _by_strategy(data.over_time(case, data.main_dwell(case))), 100)
        for case in cases
    ]  # fmt: skip
    return _charts(panels, 4 if len(cases) == 4 else 3)


def _by_strategy(rows: pd.DataFrame) -> list[tuple[str, pd.DataFrame, Look]]:
    return [(strategy_text(name), rows[rows["strategy"] == name], _look(name)) for name in strategies_in(rows)]


def _charts(panels: Sequence[_Panel], columns: int) -> Figure:
    """Charts in rows, with equal limits for equal quantities, and one legend above them."""
    columns = min(len(panels), columns)
    deep = -(-len(panels) // columns)
    titles = [textwrap.fill(panel.title, 30) for panel in panels]
    row_in = 2.9 + 0.2 * max(title.count("\n") + 1 for title in titles)
    key = {text: look for panel in panels for text, _, look in panel.lines}
    if any(panel.column == "coverage95" for panel in panels):
        key[STATED] = (INK, (0, (4, 3)), 0.9)
    high, step = row_in * deep + 0.2 * (1 + _key_rows(len(key))), 0.94 / columns
    figure = new_figure(WIDTH_IN, high)
    drawn: list[Axes] = []
    for number, panel in enumerate(panels):
        row, column = divmod(number, columns)
        place = (0.065 + step * column, (row_in * (deep - 1 - row) + 0.5) / high, step - 0.06, 2.25 / high)
        axes = _plain(figure.add_axes(place), "y")
        _lines(axes, panel)
        _hours(axes, panel.hours)
        repeated = column > 0 and panel.measure == panels[number - 1].measure
        label(axes, "Mission time [h]", "" if repeated else panel.measure, titles[number])
        drawn.append(axes)
    for axes, panel in zip(drawn, panels, strict=True):
        limits = [one.get_ylim() for one, other in zip(drawn, panels, strict=True) if other.column == panel.column]
        low, top = min(low for low, _ in limits), max(top for _, top in limits)
        if panel.column == "mse":
            axes.set_ylim(low, top)
            _log_axis(axes)
        elif panel.column == "coverage95":
            axes.axhline(95, color=INK, linewidth=0.9, linestyle=(0, (4, 3)), zorder=2)
            axes.set_ylim(max(0.0, 10 * np.floor(min(low, 50.0) / 10)), 101)
        else:
            axes.set_ylim(bottom=0)
    _shared_key(figure, key)
    return figure


def _shared_key(figure: Figure, drawn: dict[str, Look]) -> None:
    """Legend of all panels, above them."""
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=colour, linestyle=dashes, linewidth=width, label=text)
        for text, (colour, dashes, width) in drawn.items()
    ]
    figure.legend(
        handles=handles, loc="upper left", bbox_to_anchor=(0.057, 1.0), frameon=False, fontsize=SMALL,
        ncols=-(-len(handles) // _key_rows(len(handles))), labelcolor=INK, columnspacing=1.4, handlelength=2.2,
    )  # fmt: skip


def _key_rows(count: int) -> int:
    return -(-count // KEYS_PER_ROW)


def interval_strategies(data: CampaignData, case: Case) -> list[str]:
    """Strategies with missions of more than one counting interval."""
    rows = data.over_time(case)
    return [name for name in strategies_in(rows) if rows[rows["strategy"] == name]["dwell"].nunique() > 1]


def examples_figure(data: CampaignData, case: Case) -> Figure | None:
    """The truth, then one mission per strategy: map, path and stops above, kriging variance below."""
    examples = [
        (name, stored)
        for name in example_strategies(data, case)
        if (stored := data.example(case, name)) is not None
    ]
    if not examples:
        return None
    first = examples[0][1]
    width_m, height_m = (float(axis[-1] - axis[0]) for axis in (first.x_m, first.y_m))
    across = min((WIDTH_IN - 0.9) / (len(examples) + 1) - 0.1, 2.6 * width_m / height_m)
    figure = new_figure(WIDTH_IN, 2 * (across * height_m / width_m + 0.3) + 0.6)
    figure.set_layout_engine("constrained")
    cells = figure.subplots(2, len(examples) + 1, squeeze=False)
    truth = _inside(first.truth_rate, first)
    pooled = np.concatenate([truth.ravel(), *(_inside(stored.rate, stored).ravel() for _, stored in examples)])
    low, high = robust_range(pooled, 0.98)
    variances = [_inside(stored.rate_sd, stored) ** 2 for _, stored in examples]
    every = np.concatenate([v.ravel() for v in variances])
    most = robust_range(every, 0.98)[1]
    image = _panel(cells[0, 0], first, truth, RATE, (low, high), "Truth")
    for column, ((name, stored), variance) in enumerate(zip(examples, variances, strict=True), start=1):
        above, below = cells[:, column]
        _panel(above, stored, _inside(stored.rate, stored), RATE, (low, high), strategy_text(name))
        _path(above, stored)
        shade = _panel(below, stored, variance, UNCERTAIN, (0.0, most), "")
        _stops(below, stored)
    cells[1, 0].set_axis_off()
    _bar(figure, image, cells[0], "Rate [counts/s]", extension(pooled, low, high))
    _bar(figure, shade, cells[1], "Kriging variance [(counts/s)²]", extension(every, 0, most))
    return figure


def example_strategies(data: CampaignData, case: Case) -> list[str]:
    """Strategies of the example missions: the exploring ones, or the baselines if there are no others."""
    present = strategies_in(data.final(case))
    return ([name for name in present if not _is_baseline(name)] or present)[:MAX_EXAMPLES]


def _lines(axes: Axes, panel: _Panel) -> None:
    """Draw mean lines with bands of one standard deviation over the runs, but for a coverage.

    The band of an error does not go below the lowest run: mean minus deviation may be negative.
    """
    for _, rows, (colour, dashes, width) in panel.lines:
        by_time = rows.groupby("time_s")[panel.column]
        count, mean = by_time.count(), panel.scale * by_time.mean()
        sd = panel.scale * by_time.std(ddof=1).fillna(0.0)
        good = (count >= 0.5 * count.max()) & mean.notna()
        hours, middle, spread = mean.index[good].to_numpy(float) / 3600, mean[good].to_numpy(), sd[good].to_numpy()
        if not len(hours):
            continue
        lowest = middle - spread
        if panel.column == "mse":
            lowest = np.maximum(lowest, np.minimum((panel.scale * by_time.min())[good].to_numpy(), middle))
        if panel.column != "coverage95":
            axes.fill_between(hours, lowest, middle + spread, color=colour, alpha=0.13, linewidth=0)
        axes.plot(hours, middle, color=colour, linestyle=dashes, linewidth=width, solid_capstyle="round", zorder=3)
    if panel.column == "mse":
        axes.set_yscale("log")


def _log_axis(axes: Axes) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = axes.get_ylim()
    steps = (1.0, 2.0, 5.0) if high / low < 200 else (1.0,)
    axes.yaxis.set_major_locator(LogLocator(subs=steps))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.6g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_minor_locator(LogLocator(subs=()))


def _hours(axes: Axes, hours: float) -> None:
    from matplotlib.ticker import MaxNLocator

    axes.set_xlim(0, hours)
    axes.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))


def _dwell_order(dwell: str) -> tuple[int, float]:
    """Sort key: fixed intervals, adaptive intervals, others; fixed and adaptive from longest to shortest."""
    kind, _, number = dwell.partition(":")
    if kind == "fmi":
        return 0, -float(number)
    return (1, float(number)) if kind == "ami" else (2, 0.0)


def _dwell_look(dwell: str, dwells: Sequence[str]) -> Look:
    """Fixed intervals orange, adaptive blue, others green; the longest solid, shorter ones dashed."""
    kind = dwell.partition(":")[0]
    kin = [other for other in dwells if other.partition(":")[0] == kind]
    dashes = ("-", (0, (4, 1.5)), (0, (1.2, 1.4)), "-.")[min(kin.index(dwell), 3)]
    return {"fmi": ORANGE, "ami": BLUE}.get(kind, GREEN), dashes, 2.0


def _inside(values: Array, stored: CampaignRun) -> Array:
    return np.where(np.isfinite(stored.truth_rate), values, np.nan)


def _panel(
    axes: Axes, stored: CampaignRun, values: Array, cmap: str, limits: tuple[float, float], title: str
) -> Any:
    half = (stored.x_m[1] - stored.x_m[0]) / 2 if len(stored.x_m) > 1 else 0.5
    extent = (stored.x_m[0] - half, stored.x_m[-1] + half, stored.y_m[0] - half, stored.y_m[-1] + half)
    image = axes.imshow(
        values, origin="lower", extent=extent, cmap=colour_map(cmap), vmin=limits[0], vmax=limits[1],
        interpolation="nearest", aspect="equal",
    )  # fmt: skip
    for ring in stored.outlines:
        axes.plot(*np.vstack([ring, ring[:1]]).T, color=INK, linewidth=0.9)
    axes.set(xticks=[], yticks=[])
    for spine in axes.spines.values():
        spine.set_visible(False)
    if title:
        axes.set_title(title, fontsize=NORMAL, color=INK, loc="left", fontweight="bold")
    return image


def _path(axes: Axes, stored: CampaignRun) -> None:
    for track in stored.tracks:
        axes.plot(*track.T, color="white", linewidth=2.2, alpha=0.7, zorder=2)
        axes.plot(*track.T, color=INK, linewidth=0.8, zorder=2.1)
        x, y = track[:1].T
        axes.scatter(x, y, s=34, marker="s", color=INK, edgecolors="white", linewidths=0.8, zorder=4)
    _stops(axes, stored)


def _stops(axes: Axes, stored: CampaignRun) -> None:
    xy = np.array([(visit.x_m, visit.y_m) for visit in stored.visits]).reshape(-1, 2)
    axes.scatter(xy[:, 0], xy[:, 1], s=13, facecolors="white", edgecolors=INK, linewidths=0.7, zorder=3)


def _bar(figure: Figure, image: Any, row: Any, text: str, extend: str) -> None:
    """Draw the colour bar of a row of maps."""
    bar = figure.colorbar(image, ax=list(row), extend=extend, pad=0.01, fraction=0.05)
    bar.set_label(text, fontsize=SMALL, color=INK)
    bar.ax.tick_params(colors=SOFT, labelcolor=INK, labelsize=SMALL, length=3, width=0.8, pad=2)
    bar.ax.locator_params(nbins=5)
    bar.outline.set(edgecolor=FAINT, linewidth=0.8)


class Picture(NamedTuple):
    """One figure as a data URI, and its description in words."""

    uri: str
    alt: str


class FigureSection(NamedTuple):
    """One figure of a page with its texts: anchor, heading, the figure, and what to see in it."""

    key: str
    title: str
    picture: Picture
    caption: str


def new_figure(width_in: float, height_in: float) -> Figure:
    """An empty white figure that does not use pyplot."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def label(axes: Axes, x: str = "", y: str = "", title: str = "") -> None:
    """Axis labels and a title at the left."""
    axes.set_xlabel(x, fontsize=NORMAL, color=INK)
    axes.set_ylabel(y, fontsize=NORMAL, color=INK)
    if title:
        axes.set_title(title, fontsize=NORMAL, color=INK, loc="left", fontweight="bold")


def of_text_width(figure: Figure) -> Figure:
    """A figure for the screen, made as wide as the text of a journal page: smaller, with thinner lines."""
    from matplotlib.lines import Line2D
    from matplotlib.text import Text

    width_in, height_in = figure.get_size_inches()
    share = TEXT_IN / width_in
    figure.set_size_inches(TEXT_IN, HEIGHTENED * share * height_in)
    for text in figure.findobj(Text):
        text.set_fontsize(ENLARGED * share * text.get_fontsize())
    for line in figure.findobj(Line2D):
        line.set_linewidth(share * line.get_linewidth())
    return figure


def picture(figure: Figure, alt: str, vector: bool = False) -> Picture:
    """Render as SVG if requested and small, else as PNG at twice the screen's resolution."""
    if vector:
        svg = _render(figure, "svg")
        if len(svg) <= LARGEST_SVG:
            return Picture(data_uri("image/svg+xml", svg), alt)
    return Picture(data_uri("image/png", _render(figure, "png")), alt)


def _render(figure: Figure, kind: str) -> bytes:
    stream = io.BytesIO()
    metadata: dict[str, Any] = {"Date": None} if kind == "svg" else {"Software": None}
    figure.savefig(stream, format=kind, dpi=PNG_DPI if kind == "png" else 72, metadata=metadata)
    return stream.getvalue()


def _plain(axes: Axes, grid: str = "") -> Axes:
    """Plain axes with small text, and lines behind the data."""
    plain_axes(axes).tick_params(labelsize=SMALL)
    if grid:
        axes.grid(axis=grid, color=FAINT, linewidth=0.7)  # type: ignore[arg-type]
        axes.set_axisbelow(True)
    return axes


def write_figures(out: Path, figures: Iterable[tuple[str, Figure]], formats: Iterable[str]) -> list[Path]:
    """Write figures to the folder ``figures``, and remove figures of an earlier run.

    :param formats: of :data:`FORMATS`; none writes nothing
    :raises InputError: if the folder cannot be written, or matplotlib is missing
    """
    folder, chosen = out / FOLDER, list(dict.fromkeys(formats))
    try:
        for path in [path for ending in FORMATS for path in folder.glob(f"*.{ending}")]:
            path.unlink()
        if not chosen:
            return []
        matplotlib = optional_module("matplotlib", "reports")
        folder.mkdir(parents=True, exist_ok=True)
        written = []
        with matplotlib.rc_context(_VECTOR):
            for name, figure in figures:
                for ending in chosen:
                    path = folder / f"{name}.{ending}"
                    figure.savefig(path, format=ending, metadata={_DATE[ending]: None})
                    written.append(path)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", "choose another output folder", folder) from None
    return written


def plain_axes(axes: Axes) -> Axes:
    """Axes without the upper and right spines, and with light ticks."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(SOFT)
    axes.tick_params(colors=SOFT, labelcolor=INK, length=3, width=0.8)
    return axes


def colour_map(name: str) -> Any:
    """The colours of :func:`.colour_ramp`, as matplotlib takes them."""
    from matplotlib.colors import ListedColormap

    return ListedColormap(colour_ramp(name, 256) / 255, name)


def extension(values: ArrayLike, low: float, high: float) -> str:
    """The ends of a colour bar that need an arrow, as matplotlib's ``extend``."""
    below, above = bool(np.nanmin(values, initial=low) < low), bool(np.nanmax(values, initial=high) > high)
    return {(0, 0): "neither", (1, 0): "min", (0, 1): "max", (1, 1): "both"}[below, above]
