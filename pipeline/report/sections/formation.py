"""The section of image formation: the chain step by step, effects at levels, and how well a level is reached."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipeline import tables
from pipeline.errors import InputError
from pipeline.report import formation_gallery, photon_transfer_figure
from pipeline.report.inputs import ReportInputs, existing, optional_arrays, optional_json, optional_table
from pipeline.report.sections.base import Block, NotRun, Run, Section, ShownFigure, missing, overview
from pipeline.report.tables import Cell, Column, Estimate, Table
from pipeline.report.wording import EFFECTS, in_order, word
from pipeline.statistics import robust
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd

STAGE, SENSOR_STAGE = "corrupt@{dataset}", "sensor"


def _galleries(dataset: str, inputs: ReportInputs) -> list[Block]:
    folder = inputs.corrupt[dataset]
    order = optional_json(folder, "gallery.json")
    if order is None:
        return []
    if not isinstance(order, dict) or not set(order) >= {"chain", "effects"}:
        raise InputError(f"{folder / 'gallery.json'}: expected an object with lists 'chain' and 'effects'")
    arrays = optional_arrays(folder, "gallery.npz")
    stages = (STAGE.format(dataset=dataset),)
    blocks: list[Block] = []
    if order["chain"]:
        captions = " ".join(str(entry.get("caption", "")) for entry in order["chain"]).strip()
        caption = f"Image formation on {word(dataset)}, in the order light meets the camera. {captions}"
        drawing = formation_gallery.draw_chain(arrays, order["chain"])
        blocks.append(ShownFigure(f"formation_chain_{dataset}", drawing, caption.strip(), stages))
    if order["effects"]:
        caption = (
            f"Noise effects and levels on {word(dataset)}. Each frame is brought to the standard deviation above its "
            "column; beneath each patch, the part shown, stands what it received itself after clipping."
        )
        drawing = formation_gallery.draw_effects(arrays, order["effects"])
        blocks.append(ShownFigure(f"formation_effects_{dataset}", drawing, caption, stages))
    return blocks


def _sensor(inputs: ReportInputs) -> list[Block]:
    curve = optional_json(inputs.sensor, "photon_transfer.json")
    if curve is None:
        return [NotRun("Photon transfer of the sensor", "stage absent", inputs.line(SENSOR_STAGE))]
    caption = (
        "Photon transfer. Variance over mean of evenly lit frames drawn from the sensor: the slope is its gain, so "
        "photon noise, conversion and scale fit together."
    )
    return [ShownFigure("photon_transfer", photon_transfer_figure.draw(curve), caption, (SENSOR_STAGE,))]


def _level_table(dataset: str, corruption: pd.DataFrame) -> Table:
    rows: list[dict[str, Cell]] = []
    effects = in_order(corruption["effect"], EFFECTS)
    for level in sorted(set(corruption["level_dn"])):
        here = corruption[corruption["level_dn"] == level]
        row: dict[str, Cell] = {"level_dn": level, "off_percent": None}
        if level > 0:
            row["off_percent"] = 100.0 * float((here["sigma_dn"] / level - 1.0).abs().max())
        for effect in effects:
            values = here.loc[here["effect"] == effect, "sigma_clipped_dn"]
            found = robust(values, stream(0, "report", "levels", dataset, effect, float(level)))
            row[effect] = Estimate(found.median, found.low, found.high, found.count or None)
        rows.append(row)
    columns = [Column("level_dn", "Level", "DN"), Column("off_percent", "Missed before clipping", "%", 2)]
    columns += [Column(effect, word(effect), "DN", 2) for effect in effects]
    notes = (
        "Standard deviation of the noise over a whole frame after clipping to 0..255 and rounding: median over frames "
        "with bootstrap 95 % interval and number of frames. Missed before clipping: by how much, at most, the noise as "
        "added misses the level in any frame. At level 0 the frame is left as it is.",
    )
    caption = f"Noise really present on {word(dataset)} at each level."
    return Table(f"noise_levels_{dataset}", caption, columns, rows, notes, STAGE.format(dataset=dataset))


def section(inputs: ReportInputs) -> Section:
    """Image formation: galleries and the table of levels, per dataset."""
    blocks: list[Block] = []
    level_tables: list[Block] = []
    ran = []
    for dataset in inputs.datasets:
        if existing(inputs.corrupt.get(dataset)) is None:
            continue
        corruption = optional_table(inputs.corrupt[dataset], "corruption.parquet", tables.CORRUPTION)
        if corruption is None:
            continue
        ran.append(dataset)
        blocks += _galleries(dataset, inputs)
        level_tables.append(_level_table(dataset, corruption))
    runs = overview("Image formation", STAGE, ran, inputs)
    done = existing(inputs.sensor) is not None
    sensor_run = Run("Sensor", "", done, "" if done else "stage absent", inputs.line(SENSOR_STAGE))
    text = (
        "Frames are corrupted at the level of electrons, in the order light meets the camera: photon noise, blur by "
        "the optics, dark-current shot noise, readout noise, quantisation.",
    )
    return Section(
        "formation",
        "Image formation",
        text,
        [*blocks, *level_tables, *_sensor(inputs), *missing("Image formation", runs)],
        [sensor_run, *runs],
    )
