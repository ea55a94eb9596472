"""``camera-monitor report diff``: changed numbers of two reports, the largest first."""

from __future__ import annotations

import json
from pathlib import Path

from cli_makers import call

from pipeline.cli.commands.report import compare, metrics

ROOT = Path(__file__).resolve().parents[3]


def write(root, **content):
    for name, value in content.items():
        (root / "metrics").mkdir(parents=True, exist_ok=True)
        (root / f"metrics/{name}.json").write_text(json.dumps(value))
    return root


def test_report_diff_lists_the_largest_changes_first(tmp_path):
    old = write(tmp_path / "a", noise={"pca": {"mae": 1.0, "count": 9}}, blur={"amae": 2.0, "gone": 1, "zero": 0})
    new = write(tmp_path / "b", noise={"pca": {"mae": 1.5, "count": 9}}, blur={"amae": 1.9, "came": 1, "zero": 1})
    done = call("report", "diff", old, new)
    assert done.exit_code == 0, done.output
    assert done.output.splitlines()[0] == "1 equal, 3 changed, 1 added, 1 removed"
    names = [line.split()[-1] for line in done.output.splitlines() if line]
    order = [name for name in names if ":" in name and not name.endswith(":")]
    assert order == ["blur:zero", "noise:pca.mae", "blur:amae"]
    assert "+50.00" in done.output and "-5.00" in done.output
    assert call("report", "diff", old, new, "--fail").exit_code == 3
    assert call("report", "diff", old, old, "--fail").exit_code == 0
    tolerant = json.loads(call("report", "diff", old, new, "--tolerance-percent", 10, "--json").stdout)
    assert [row["name"] for row in tolerant["changes"]] == ["blur:zero", "noise:pca.mae"]
    assert tolerant["added_names"] == ["blur:came"] and tolerant["removed_names"] == ["blur:gone"]


def test_report_diff_lists_numbers_that_vanished_first_and_calls_no_change_smaller(tmp_path):
    nan, small = float("nan"), {f"small {number}": 1.0 for number in range(9)}
    old = {**small, "lost": 0.37, "was 0": 0, "no number": nan, "to no number": 2.0, "large": 1.0, "endless": 1.0}
    new = {**dict.fromkeys(small, 1.001), "lost": None, "was 0": 9, "no number": 1.0, "to no number": nan,
           "large": 3.0, "endless": float("inf")}  # fmt: skip
    changes = compare(old, new, 0.0)
    without_ratio = ["endless", "lost", "no number", "to no number", "was 0"]
    assert [row["name"] for row in changes] == [*without_ratio, "large", *small]
    assert [row["relative"] for row in changes][:6] == [*[None] * 5, 2.0]
    roots = (write(tmp_path / name, noise=content) for name, content in (("a", old), ("b", new)))
    done = call("report", "diff", *roots, "--most", 5)
    assert [line.split(":")[-1] for line in done.output.splitlines() if " noise:" in line] == without_ratio
    assert "... and 10 more changes (--most 0 lists all)" in done.output


def test_report_diff_takes_folders_of_metrics_and_single_files_and_refuses_others(tmp_path):
    old = write(tmp_path / "a", noise={"x": 1.0})
    assert metrics(old) == metrics(old / "metrics") == {"noise:x": 1.0}
    project = write(tmp_path / "project/reports", noise={"x": 1.0}).parent
    (project / "params.json").write_text('{"y": 2.0}')
    assert metrics(project) == {"noise:x": 1.0}
    assert metrics(old / "metrics/noise.json") == {":x": 1.0}
    assert compare({"a": float("nan")}, {"a": float("nan")}, 0.0) == []
    (old / "metrics/noise.json").write_text("{")
    assert "not readable JSON" in call("report", "diff", old, old).output
    for content, words in (
        ('{"c.d": 5, "c": {"d": 6}}', "two values have the name 'c.d'"),
        (f'{{"x": {"9" * 400}}}', "'x' is an integer of 400 digits"),
    ):
        (old / "metrics/noise.json").write_text(content)
        done = call("report", "diff", old, old)
        assert done.exit_code == 2 and f"noise.json: {words}" in done.output.replace("\n", " "), done.output
    (old / "metrics/noise.json").write_text('{"x": 1.0, "none": []}')
    (old / "metrics/.writing-a.json").write_text("{")
    assert metrics(old) == {"noise:x": 1.0, "noise:none": []}
    assert "no metrics" in call("report", "diff", tmp_path / "absent", old).output


def test_the_committed_report_equals_itself():
    assert call("report", "diff", ROOT / "reports", ROOT / "reports", "--fail").exit_code == 0
