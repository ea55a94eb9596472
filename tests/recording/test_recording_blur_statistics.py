"""Statistics of a record of blur computed again: the same as when it was measured, and from its estimates only."""

from __future__ import annotations

import shutil
from pathlib import Path

import composed
import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from data_makers import make_folder

from pipeline import store
from pipeline.cli import main
from pipeline.config.schema import Config
from pipeline.errors import InputError
from pipeline.experiments.condition import SHARP
from pipeline.experiments.tables import BLUR_ESTIMATES
from pipeline.recording.blur import record
from pipeline.recording.blur_statistics import summarise_again
from pipeline.recording.frames import Request
from pipeline.recording.kept_results import keeping
from pipeline.recording.provenance import write_csv

REPO = Path(__file__).resolve().parents[2]
FILES = ("summary.csv", "sharp.csv", "metrics.json", "patches.csv")


def configured(root: Path) -> Config:
    overrides = ["+dataset@datasets.mine=folder", f"datasets.mine.root={root}", "psf.kinds=[defocus]"]
    overrides += ["psf.sizes_px=[7]", "blur.bootstrap_draws=20"]
    return composed.config(*overrides)


def measured(root: Path, out: Path, *names: str, kept: Path | None = None) -> None:
    record(Request(configured(root), "mine", out, "made up (CC0)", keeping(kept)), names, join=True)


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_folder(tmp_path_factory.mktemp("pictures") / "mine", 3)


@pytest.fixture(scope="module")
def recorded(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record of two estimators beside ``kept``, the finished frames behind it."""
    top = tmp_path_factory.mktemp("recorded")
    for name in ("spectral", "generic_lens"):
        measured(root, top / "mine-blur", name, kept=top / "kept")
    return top


@pytest.fixture
def narrowed(recorded: Path, tmp_path: Path) -> Path:
    """The record with the intervals of one estimator narrowed, as former statistics may have given them."""
    out = tmp_path / "mine-blur"
    shutil.copytree(recorded / "mine-blur", out)
    for file, value in (("summary.csv", "amae_percent"), ("sharp.csv", "median")):
        table = pd.read_csv(out / file, dtype={"frame": str}, keep_default_na=False)
        rows = table["estimator"] == "spectral"
        for end in table.columns.intersection(["low_percent", "high_percent", "low", "high"]):
            table.loc[rows, end] = 0.5 * (table[end] + table[value])
        table.to_csv(out / file, index=False, float_format="%.6g", lineterminator="\n")
        assert (out / file).read_bytes() != (recorded / "mine-blur" / file).read_bytes()
    return out


def test_the_statistics_are_those_of_the_measurement(recorded: Path, narrowed: Path) -> None:
    assert summarise_again(narrowed) == ["spectral"]
    for file in (*FILES, "estimates.parquet"):
        assert (narrowed / file).read_bytes() == (recorded / "mine-blur" / file).read_bytes(), file
    before, after = (store.read_json(item / "provenance.json") for item in (recorded / "mine-blur", narrowed))
    assert after == before | {"summarised_again": ["spectral"]}
    assert summarise_again(narrowed) == [] and store.read_json(narrowed / "provenance.json") == after


def test_columns_in_another_order_are_no_change(recorded: Path, narrowed: Path) -> None:
    """As in records made before the interval stood beside its median."""
    shutil.copytree(recorded / "mine-blur", narrowed, dirs_exist_ok=True)
    table = pd.read_csv(narrowed / "sharp.csv")
    table[list(table.columns[::-1])].to_csv(narrowed / "sharp.csv", index=False, float_format="%.6g")
    before = (narrowed / "sharp.csv").read_bytes()
    assert summarise_again(narrowed) == [] and (narrowed / "sharp.csv").read_bytes() == before


def test_finished_frames_take_the_place_of_estimates_that_a_record_lacks(recorded: Path, narrowed: Path) -> None:
    (narrowed / "estimates.parquet").unlink()
    with pytest.raises(InputError, match="no estimates.parquet to compute statistics from; measure it again"):
        summarise_again(narrowed)
    assert summarise_again(narrowed, recorded / "kept") == ["spectral"]
    for file in FILES:
        assert (narrowed / file).read_bytes() == (recorded / "mine-blur" / file).read_bytes(), file


def test_an_estimator_measured_again_is_no_longer_named(root: Path, recorded: Path, narrowed: Path) -> None:
    summarise_again(narrowed)
    measured(root, narrowed, "generic_lens")
    assert store.read_json(narrowed / "provenance.json")["summarised_again"] == ["spectral"]
    measured(root, narrowed, "spectral")
    assert not store.read_json(narrowed / "provenance.json").get("summarised_again")


def test_estimates_that_are_not_behind_the_record_are_refused(recorded: Path, narrowed: Path) -> None:
    text = (narrowed / "summary.csv").read_text()
    amae = pd.read_csv(narrowed / "summary.csv")["amae_percent"][0]
    (narrowed / "summary.csv").write_text(text.replace(f",{amae:.6g},", f",{amae + 0.1:.6g},", 1))
    before = {path.name: path.read_bytes() for path in narrowed.iterdir()}
    with pytest.raises(InputError, match="estimates of 'spectral' give another AMAE than that recorded"):
        summarise_again(narrowed)
    assert {path.name: path.read_bytes() for path in narrowed.iterdir()} == before


def test_a_cell_in_which_every_estimate_abstained_is_no_obstacle(narrowed: Path) -> None:
    """Its AMAE is NaN, recorded and computed again."""
    estimates = store.read_table(narrowed / "estimates.parquet", BLUR_ESTIMATES)
    blurred = (estimates["estimator"] == "spectral") & (estimates["kernel"] != SHARP)
    estimates.loc[blurred, ["mtf", "low", "high"]] = np.nan
    estimates.loc[blurred, "abstained"] = True
    store.write_table(narrowed / "estimates.parquet", estimates, BLUR_ESTIMATES)
    summary = pd.read_csv(narrowed / "summary.csv")
    rows = (summary["estimator"] == "spectral") & (summary["blur_kind"] != SHARP)
    summary.loc[rows, "abstained"] += summary.loc[rows, "count"]
    summary.loc[rows, "count"] = 0
    summary.loc[rows, ["amae_percent", "low_percent", "high_percent"]] = np.nan
    write_csv(narrowed / "summary.csv", summary)
    summarise_again(narrowed)
    again = pd.read_csv(narrowed / "summary.csv")
    assert rows.any() and again["amae_percent"].isna().equals(rows)
    summary.loc[rows, "amae_percent"] = 1.0
    write_csv(narrowed / "summary.csv", summary)
    with pytest.raises(InputError, match="estimates of 'spectral' give another AMAE than that recorded"):
        summarise_again(narrowed)


def test_frames_that_are_incomplete_or_absent_are_refused(recorded: Path, narrowed: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such folder; give the one that --keep wrote"):
        summarise_again(narrowed, tmp_path / "none")
    kept = tmp_path / "kept"
    shutil.copytree(recorded / "kept", kept)
    for estimator in ("spectral", "generic_lens"):
        tables = {path: store.read_arrays(path) for path in kept.glob("*.npz")}
        next(path for path, table in tables.items() if estimator in table.get("estimator", ())).unlink()
    with pytest.raises(InputError, match="no estimator of .* with all its frames and kernels"):
        summarise_again(narrowed, kept)


def test_the_command_names_what_changed(narrowed: Path, tmp_path: Path) -> None:
    done = CliRunner().invoke(main, ["blur", "summarise", str(narrowed)])
    assert done.exit_code == 0 and "changed: spectral" in done.stdout, done.output
    again = CliRunner().invoke(main, ["blur", "summarise", str(narrowed)])
    assert again.exit_code == 0 and "nothing changed" in again.stdout
    absent = CliRunner().invoke(main, ["blur", "summarise", str(tmp_path / "none")])
    assert absent.exit_code == 2 and "no record of blur there" in absent.output and "Traceback" not in absent.output
