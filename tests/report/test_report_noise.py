"""The chapter of noise beyond its curves: local maps, single patches against both truths, saturated patches."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from report_makers import REPO, make_noise, picture

from pipeline import store
from pipeline.errors import InputError
from pipeline.experiments.patch_errors import saturated_patches
from pipeline.report.inputs import Arrays, ReportInputs
from pipeline.report.sections import noise
from pipeline.report.spec import Figure
from pipeline.report.tables import Estimate, Table


def add_maps(folder: Path, dataset: str, off_dn: float = 0.0, frame: str = "a") -> None:
    """Maps of two effects, the noise found differing from that added by a constant."""
    light = picture(f"maps {dataset}", (96, 128)).reshape(12, 8, 16, 8).mean((1, 3))
    arrays = {"photon_added": 2 + light / 16, "dcsn_added": np.full((12, 16), 15.0)}
    for noise_source in ("photon", "dcsn"):
        arrays[f"{noise_source}_seen"] = picture(f"maps {dataset}", (96, 128))
        arrays[f"{noise_source}_found"] = arrays[f"{noise_source}_added"] + off_dn
    arrays["dcsn_found"][:2] = np.nan
    store.write_arrays(folder / "maps.npz", **arrays)
    metadata = {
        "dataset": dataset,
        "frame": frame,
        "target_sigma_dn": 15.0,
        "cell_px": 8,
        "effects": ["photon", "dcsn"],
    }
    store.write_json(folder / "maps.json", {**metadata, "estimator": folder.name.removeprefix(f"{dataset}-")})


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> ReportInputs:
    root = tmp_path_factory.mktemp("noise")
    for estimator in ("pca", "cellwise"):
        make_noise(root / "noise", "sim", estimator)
    add_maps(root / "noise/sim-cellwise", "sim", 0.5)
    return ReportInputs(paper=REPO / "data/paper", data=root, members={"index": ("sim",)})


def rows(table: Table) -> list[dict[str, object]]:
    return [dict(row) for row in table.rows]


def test_maps_are_drawn_with_how_well_they_agree(inputs: ReportInputs) -> None:
    blocks = [block for block in noise.section(inputs).blocks if isinstance(block, Figure)]
    assert [block.name for block in blocks] == ["noise", "noise_maps_sim"]
    values = blocks[1].drawing.values
    assert values is not None
    photon, dcsn = values.to_dict("records")
    assert photon["mean_error_dn"] == pytest.approx(0.5) and photon["correlation"] == pytest.approx(1.0)
    assert dcsn["unknown"] == 32 and dcsn["cells"] == 160
    assert math.isnan(dcsn["correlation"])  # evenly spread noise has nothing to correlate with
    assert "mean error 0.50 DN" in blocks[1].drawing.alt
    assert blocks[1].stages == ("noise@sim-cellwise",)
    pictures = [image for axes in blocks[1].drawing.figure.axes for image in axes.get_images()]
    assert len(pictures) == 2 * (1 + 2 + 2)  # frame; frame and map twice


def test_maps_that_lack_a_part_or_show_another_frame_are_refused(tmp_path: Path, inputs: ReportInputs) -> None:
    with pytest.raises(InputError, match="photon_added"):
        noise.maps([({"effects": ["photon"]}, Arrays(photon_seen=np.zeros((8, 8), np.uint8)))])
    for estimator, frame in (("cellwise", "a"), ("pca", "b")):
        make_noise(tmp_path / "noise", "sim", estimator)
        add_maps(tmp_path / f"noise/sim-{estimator}", "sim", frame=frame)
    with pytest.raises(InputError, match="different frames"):
        noise.section(dataclasses.replace(inputs, data=tmp_path))
    store.write_json(tmp_path / "noise/sim-pca/maps.json", {"dataset": "sim"})
    with pytest.raises(InputError, match=r"maps\.json"):
        noise.section(dataclasses.replace(inputs, data=tmp_path))


def test_patches_are_judged_against_both_truths(inputs: ReportInputs) -> None:
    estimates = inputs.result("noise_estimates")
    table = rows(noise.single_patches(estimates, 0))
    assert len(table) == 2 * 4
    ours = next(row for row in table if row["estimator"] == "Cell-wise" and row["noise_source"] == "DCSN")
    selected = estimates[(estimates["estimator"] == "cellwise") & (estimates["noise_source"] == "dcsn")]
    present, added, held = ours["present_dn"], ours["added_dn"], ours["coverage_percent"]
    assert isinstance(present, Estimate) and isinstance(added, Estimate) and isinstance(held, Estimate)
    assert present.value == pytest.approx((selected["sigma_dn"] - selected["clipped_sigma_dn"]).abs().mean())
    assert added.value == pytest.approx((selected["sigma_dn"] - selected["unclipped_sigma_dn"]).abs().mean())
    noisy = selected[selected["target_sigma_dn"] > 0]
    inside = (noisy["low_dn"] <= noisy["unclipped_sigma_dn"]) & (noisy["unclipped_sigma_dn"] <= noisy["high_dn"])
    assert held.value == pytest.approx(100 * inside.mean()) and held.count == len(noisy)
    assert 50 < held.value < 100
    assert ours["width_dn"] == pytest.approx(3.0)
    theirs = next(row for row in table if row["estimator"] == "PCA")
    assert "coverage_percent" not in theirs
    assert theirs["abstained_percent"] == pytest.approx(100 * 2 / 12)


def test_the_interval_is_over_frames_not_over_patches(inputs: ReportInputs) -> None:
    estimates = inputs.result("noise_estimates")
    selected = estimates[estimates["estimator"] == "cellwise"].copy()
    selected["sigma_dn"] = selected["unclipped_sigma_dn"] + np.where(selected["patch"] % 2 == 0, 1.0, 3.0)
    one = rows(noise.single_patches(selected, 0))[0]["added_dn"]
    assert isinstance(one, Estimate) and not one.has_interval  # a single frame says nothing of others
    copies = [
        selected.assign(frame=f"sim-{number}", sigma_dn=selected["unclipped_sigma_dn"] + number) for number in range(8)
    ]
    many = rows(noise.single_patches(pd.concat(copies, ignore_index=True), 0))[0]["added_dn"]
    assert isinstance(many, Estimate)
    assert many.value == pytest.approx(3.5)
    assert many.high - many.low > 1.5


def test_saturated_patches_have_rows_of_their_own_at_the_highest_level(inputs: ReportInputs) -> None:
    estimates = inputs.result("noise_estimates")
    table = noise.saturated(estimates, 0)
    assert table is not None and "25 DN" in table.caption
    result = rows(table)
    assert [row["noise_source"] for row in result] == ["Photon", "DCSN", "Readout", "Combined"]
    assert all(row["patches"] == 1 and row["added_dn"] == 25 for row in result)
    chosen = estimates[
        (estimates["saturated_fraction"] > 0.8)
        & (estimates["target_sigma_dn"] == 25)
        & (estimates["noise_source"] == "dcsn")
        & (estimates["estimator"] == "cellwise")
    ]
    cell = result[1]["cellwise"]
    assert isinstance(cell, Estimate) and cell.value == pytest.approx(chosen["sigma_dn"].iloc[0])
    assert noise.saturated(estimates.assign(saturated_fraction=0.5), 0) is None


def test_the_noise_of_saturated_patches_is_that_of_each_estimators_own_patches(inputs: ReportInputs) -> None:
    """The last estimator is run on a second, noisier patch."""
    estimates = inputs.result("noise_estimates")
    chosen = (estimates["saturated_fraction"] > 0.8) & (estimates["target_sigma_dn"] == 25)
    chosen &= (estimates["noise_source"] == "dcsn") & (estimates["estimator"] == "pca")
    second = estimates[chosen].assign(patch=99, unclipped_sigma_dn=35.0, clipped_sigma_dn=20.0)
    cells = saturated_patches(pd.concat([estimates, second], ignore_index=True), 0)
    cells = cells[cells["noise_source"] == "dcsn"].set_index("estimator")
    present = float(estimates.loc[chosen, "clipped_sigma_dn"].iloc[0])
    assert cells.loc["pca", ["patches", "added_dn", "present_dn"]].tolist() == [2, 30.0, (present + 20.0) / 2]
    assert cells.loc["cellwise", ["patches", "added_dn"]].tolist() == [1, 25.0]
    table = noise.saturated(pd.concat([estimates, second], ignore_index=True), 0)
    assert table is not None
    of_dcsn = {row["patches"]: row for row in rows(table) if row["noise_source"] == "DCSN"}
    assert of_dcsn[2].get("pca") is not None and of_dcsn[2].get("cellwise") is None
    assert of_dcsn[1].get("cellwise") is not None and of_dcsn[1].get("pca") is None


def test_the_medians_stand_beside_noise_added_and_noise_present(inputs: ReportInputs) -> None:
    table = next(block for block in noise.section(inputs).blocks if isinstance(block, Table))
    last = rows(table)[-1]
    assert last["added_dn"] == 25 and last["present_dn"] == pytest.approx(0.95 * 25)
