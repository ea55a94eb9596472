"""Metrics of blur and noise at once: counts always, means where there are answers."""

import pandas as pd

from pipeline.condition.combined_metrics import metrics


def test_a_cell_without_any_answer_has_counts_but_no_mean():
    rows = {
        "experiment": "defocus_dcsn", "estimator": "mine", "calibrated": False, "filter_px": 0.0,
        "level_dn": [0.0, 15.0], "amae_percent": [2.0, float("nan")], "count": [3, 0], "abstained": [0, 3],
    }  # fmt: skip
    found = metrics(pd.DataFrame(rows))["blur"]["defocus_dcsn"]["mine"]["raw"]
    assert found == {"0": {"amae_percent": 2.0, "count": 3, "abstained": 0}, "15": {"count": 0, "abstained": 3}}
