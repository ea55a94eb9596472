"""What trainings leave beside their weights: the released files' form, the same bytes when resumed."""

import json
from pathlib import Path

import pandas as pd
import pytest

from pipeline.learning import training_record

RELEASED = Path(__file__).resolve().parents[1] / "data/weights"
CURVE = [
    {"step": 100.0, "loss": 1.23456789, "error_percent": 20.0},
    {"step": 200.0, "loss": 0.5, "error_percent": 1e-7, "validation_error_percent": 12.0},
]


@pytest.mark.parametrize("path", sorted(RELEASED.glob("*.csv")), ids=lambda path: path.stem)
def test_released_curves_are_what_is_written(path):
    rows = [
        {name: float(value) for name, value in row.items() if pd.notna(value)}
        for row in pd.read_csv(path).to_dict("records")
    ]
    assert training_record.curve_text(rows) == path.read_text(encoding="utf-8")


def test_a_run_that_was_interrupted_writes_the_same_bytes():
    read_back = json.loads(json.dumps(CURVE[:1], sort_keys=True))
    text = training_record.curve_text(CURVE)
    assert training_record.curve_text(read_back + CURVE[1:]) == text
    assert text.splitlines() == [
        "step,error_percent,loss,validation_error_percent", "100,20,1.23457,", "200,1e-07,0.5,12",
    ]  # fmt: skip


def test_curve_and_measures_lie_where_the_graph_expects_them(tmp_path):
    training_record.write(tmp_path, "mtf_mine", CURVE, CURVE[1])
    table = pd.read_csv(tmp_path / "data/weights/mtf_mine.csv")
    assert table.columns.tolist() == ["step", "error_percent", "loss", "validation_error_percent"]
    content = json.loads((tmp_path / "reports/metrics/train/mtf_mine.json").read_text(encoding="utf-8"))
    assert content == CURVE[1]
    training_record.write_measures(tmp_path / "one.json", {"loss": 1.23456789})
    assert json.loads((tmp_path / "one.json").read_text(encoding="utf-8")) == {"loss": 1.23457}
