"""Draws the record of a finished `lacuna gap` run: data, model before and after, and what both leave.

    python3 figure.py RUN FIGURE.svg [SCENARIO]

RUN is the run directory of the study; that of the study with the effects lies beside it. Needs numpy and matplotlib.
"""
import json
import pathlib
import sys

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt
import numpy as np

plt.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "records", "font.size": 8, "axes.spines.top": False, "axes.spines.right": False})
BEFORE, AFTER = "#b5483a", "#2a6f97"


def curves(run, scenario):
    """Times, data and model of one curve; name and units of response and time."""
    block = json.loads((run / "3-read" / "measurements.json").read_text())["read"]
    model = json.loads((run / "6-validate" / "validation.json").read_text())["cases"][0]["response"]
    begin = 0
    for part in block:
        layout = part["layout"]
        axes = layout["axes"]
        time = axes[-1]["coordinates"]["grid"]
        length = len(time["values"])
        labels = axes[0]["coordinates"].get("labels", [""]) if len(axes) > 1 else [layout.get("scenario", "")]
        values = part["replicates"][0]["values"]
        for k, label in enumerate(labels):
            if scenario in (None, label):
                own = slice(k * length, (k + 1) * length)
                data = np.array([np.nan if v is None else v for v in values[own]], dtype=float)
                simulated = np.array(model[begin + k * length: begin + (k + 1) * length], dtype=float)
                return np.array(time["values"]), data, simulated, layout, axes[-1]
        begin += len(values)
    sys.exit(f"no scenario `{scenario}`")


def main():
    run = pathlib.Path(sys.argv[1])
    scenario = sys.argv[3] if len(sys.argv) > 3 else None
    with_effects = json.loads((run / "summary.json").read_text())["gap"].get("run")
    time, data, before, layout, axis = curves(run, scenario)
    figure, (top, bottom) = plt.subplots(2, 1, figsize=(6.4, 3.6), sharex=True, height_ratios=[3, 2], layout="constrained")
    top.plot(time, data, ".", color="0.55", markersize=2, label="measured")
    top.plot(time, before, color=BEFORE, linewidth=0.8, label="model")
    bottom.plot(time, data - before, color=BEFORE, linewidth=0.7)
    if with_effects:
        after = curves(pathlib.Path(with_effects), scenario)[2]
        top.plot(time, after, color=AFTER, linewidth=0.8, label="with what was missing")
        bottom.plot(time, data - after, color=AFTER, linewidth=0.7)
    unit = f", {layout['unit']}" if layout.get("unit") else ""
    top.set_ylabel(layout["name"] + unit)
    bottom.set_ylabel("measured - model")
    bottom.set_xlabel(axis["name"] + f", {axis['coordinates']['grid'].get('unit', axis.get('unit', ''))}")
    top.legend(frameon=False, ncols=3, fontsize=7)
    figure.savefig(sys.argv[2], metadata={"Date": None})


main()
