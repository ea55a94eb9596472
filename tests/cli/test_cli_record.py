"""Records of noise from the command line: tables, provenance by hash, no path and no picture kept."""

import hashlib
import json

import cv2
import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from pipeline.cli import main
from pipeline.streams import stream


def call(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


@pytest.fixture
def folder(tmp_path):
    mean = np.tile(np.linspace(60, 180, 256), (256, 1))
    (tmp_path / "pairs").mkdir()
    cv2.imwrite(str(tmp_path / "pairs/a_mean.png"), np.rint(mean).astype(np.uint8))
    noisy = mean + stream(1, "record").normal(0, 4, mean.shape)
    cv2.imwrite(str(tmp_path / "pairs/a_real.png"), np.rint(noisy).astype(np.uint8))
    return tmp_path / "pairs"


def test_a_record_has_the_numbers_and_names_its_pictures_by_hash(tmp_path, folder):
    out = tmp_path / "record"
    options = ["--estimator", "pca", "--estimator", "bf", "--source", "made here", "--to", out]
    done = call("record", "noise", "--pairs", f"white={folder}", *options)
    assert done.exit_code == 0, done.output
    summary = pd.read_csv(out / "noise_summary.csv").set_index("estimator")
    assert (summary["dataset"] == "white").all() and set(summary.index) == {"pca", "bf"}
    assert summary.loc["pca", "true_mae_dn"] < 0.3 and summary.loc["pca", "true_mean_dn"] == pytest.approx(4, rel=0.03)
    assert len(pd.read_csv(out / "noise_patches.csv")) == 2 * 4
    text = (out / "noise_provenance.json").read_text()
    provenance = json.loads(text)
    expected = hashlib.sha256((folder / "a_real.png").read_bytes()).hexdigest()
    assert provenance["datasets"]["white"]["a_real.png"] == expected and provenance["source"] == "made here"
    assert str(tmp_path) not in text
    assert sorted(path.suffix for path in out.iterdir()) == [".csv", ".csv", ".json"]
    first = (out / "noise_patches.csv").read_bytes()
    assert call("record", "noise", "--pairs", f"white={folder}", *options).exit_code == 0
    assert (out / "noise_patches.csv").read_bytes() == first


@pytest.mark.parametrize(
    ("pairs", "estimator", "word"),
    [("white", "pca", "NAME=FOLDER"), ("white={}/absent", "pca", "no folder"), ("white={}", "pcaa", "pca")],
)
def test_mistakes_are_one_line_that_names_them(tmp_path, folder, pairs, estimator, word):
    pairs = pairs.replace("{}", str(folder))
    out = tmp_path / "record"
    done = call("record", "noise", "--pairs", pairs, "--estimator", estimator, "--source", "x", "--to", out)
    assert done.exit_code == 2 and word in done.output and len(done.output.splitlines()) == 1
    assert not out.exists()
