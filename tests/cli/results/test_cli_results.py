"""Results are never lost or mixed up: unique names, nothing old beside new, rows kept on signals and full disks."""

from __future__ import annotations

import csv
import errno
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from data_makers import picture
from interrupts import heed_interrupts

from pipeline.cli import main
from pipeline.cli.calibration import camera_store
from pipeline.cli.calibration.camera_store import StoredCamera
from pipeline.cli.results.growing_files import RowFile, plain_text
from pipeline.cli.results.output_folder import LIST_NAME, OutputFolder
from pipeline.cli.results.refusals import OutputError, refuse_foreign

FULL_DISK = Path("/dev/full")

pytestmark = pytest.mark.usefixtures("plain_pictures")


def call(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def save(path: Path, name: str = "a", width_px: int = 256, height_px: int = 200) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), picture(name, width_px, height_px))
    return path


def film(path: Path, frames: int = 4, code: str = "MJPG") -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*code), 10, (256, 208))
    for number in range(frames):
        writer.write(cv2.cvtColor(np.roll(picture("film", 256, 208), 3 * number, axis=1), cv2.COLOR_GRAY2BGR))
    writer.release()
    return path


def test_corrupt_writes_one_picture_for_each_frame_of_a_video(tmp_path):
    done = call("corrupt", film(tmp_path / "v.avi"), "--out", tmp_path / "out", "--sigma-dn", 5)
    assert done.exit_code == 0, done.output
    pictures = sorted((tmp_path / "out").glob("*.png"))
    assert [file.stem for file in pictures] == [f"v.avi-{number:06d}" for number in range(4)]
    first, second = (json.loads(file.with_suffix(".json").read_text()) for file in pictures[:2])
    assert first["source"].endswith("v.avi#0") and second["source"].endswith("v.avi#1")
    one, other = (cv2.imread(str(file), 0).astype(float) for file in pictures[:2])
    clean = [np.roll(picture("film", 256, 208), 3 * number, axis=1).astype(float) for number in (0, 1)]
    noise = [(one - clean[0])[:, 10:].ravel(), (other - clean[1])[:, 10:].ravel()]
    assert abs(np.corrcoef(noise)[0, 1]) < 0.5  # each frame has noise of its own


def test_pictures_of_one_stem_keep_names_of_their_own(tmp_path):
    sources = [save(tmp_path / "1/a.png", "1"), save(tmp_path / "2/a.png", "2"), save(tmp_path / "2/a.bmp", "3")]
    assert call("corrupt", *sources, "--out", tmp_path / "out").exit_code == 0
    results = {json.loads(file.read_text())["source"]: file for file in (tmp_path / "out").glob("*.json")}
    assert set(results) == {str(source) for source in sources}
    for source in sources:
        assert (cv2.imread(str(results[str(source)].with_suffix(".png"))) == cv2.imread(str(source))).all()
    assert call("noise", *sources, "--map", tmp_path / "maps", "--estimator", "pca").exit_code == 0
    assert len(list((tmp_path / "maps").glob("*.noise.png"))) == 3


@pytest.mark.parametrize("options", [["--sigma-dn", 5], ["--pipeline", "phone", "--iso", 0]])
def test_a_picture_whose_name_needs_no_change_keeps_it(tmp_path, options):
    sources = [save(tmp_path / "in" / name, name) for name in ("a.jpg", "a.png", "a-2.png", "b.bmp")]
    assert call("corrupt", tmp_path / "in", "--out", tmp_path / "out", *options).exit_code == 0
    results = {json.loads(file.read_text())["source"]: file.stem for file in (tmp_path / "out").glob("*.json")}
    assert [results[str(source)] for source in sources] == ["a-3", "a", "a-2", "b"]


def test_names_with_line_breaks_are_listed_whole_and_break_no_table(tmp_path):
    source, out = save(tmp_path / "in" / "a\nb.png"), tmp_path / "out"
    for _ in range(2):
        done = call("health", source, "--out", out, "--map", "--noise", "pca")
        assert done.exit_code == 0, done.output
        assert len(list(out.glob("*.health.png"))) == 1
        (row,) = [line for line in done.output.splitlines() if "b.png" in line]
        assert r"a\nb.png" in row
    for command in (["noise", "--estimator", "pca"], ["corrupt", "--out", tmp_path / "noisy", "--sigma-dn", 3]):
        assert r"a\nb.png" in call(command[0], source, *command[1:]).stdout


def test_the_list_of_an_earlier_version_is_still_read(tmp_path):
    for name in ("a.png", 'b".png', '"c', "d\n.png", "foreign.png"):
        (tmp_path / name).touch()
    (tmp_path / LIST_NAME).write_text('a.png\nb".png\n"c\n"d\\n.png"\n')
    with OutputFolder(tmp_path, "corrupt"):
        assert sorted(file.name for file in tmp_path.iterdir()) == [LIST_NAME, "foreign.png"]


def test_a_list_that_names_a_file_outside_the_folder_has_it_left_alone(tmp_path):
    victim, out = tmp_path / "victim.txt", tmp_path / "out"
    out.mkdir()
    victim.touch()
    (out / LIST_NAME).write_text('["corrupt", "../victim.txt"]\n')
    with OutputFolder(out, "corrupt"):
        assert victim.is_file()


def test_a_folder_keeps_the_results_of_other_commands(tmp_path):
    a, out = save(tmp_path / "a.png"), tmp_path / "out"
    runs = [
        (["corrupt", a, "--out", out], {"a.png", "a.json"}),
        (["noise", a, "--map", out, "--estimator", "pca"], {"a.png.noise.png"}),
        (["health", a, "--out", out, "--noise", "pca"], {"health.csv", "health.jsonl", "health.json", "health.html"}),
    ]
    results = set()
    for arguments, written in runs:
        assert call(*arguments).exit_code == 0
        results |= written
        assert {file.name for file in out.iterdir()} == results | {LIST_NAME}
    assert call("corrupt", save(tmp_path / "b.png"), "--out", out).exit_code == 0  # replaces its own
    results |= {"b.png", "b.json", LIST_NAME}
    assert {file.name for file in out.iterdir()} == results - runs[0][1]


def test_a_result_of_another_command_is_not_overwritten_and_is_taken_as_input(tmp_path):
    out = tmp_path / "out"
    sources = [save(tmp_path / name) for name in ("a.png", "health.png")]
    assert call("corrupt", *sources, "--out", out).exit_code == 0  # health.json, which states the picture's noise
    truth = (out / "health.json").read_bytes()
    done = call("health", out / "a.png", "--out", out, "--noise", "pca")
    assert done.exit_code == 2 and "health.json, which no earlier run of this command wrote" in done.output
    assert (out / "health.json").read_bytes() == truth
    assert call("corrupt", sources[0], "--out", out).exit_code == 0
    assert call("health", out / "a.png", "--out", out, "--noise", "pca").exit_code == 0
    assert (out / "a.png").is_file()


def test_a_listed_file_that_was_replaced_by_another_command_is_its_own(tmp_path):
    with OutputFolder(tmp_path, "corrupt") as folder:
        folder.claim("a", ".png").write_text("corrupted")
    (tmp_path / "a.png").unlink()
    with OutputFolder(tmp_path, "health") as folder:
        folder.claim("a", ".png").write_text("measured")
    with OutputFolder(tmp_path, "corrupt"):
        assert (tmp_path / "a.png").read_text() == "measured"


def test_a_second_run_leaves_no_old_pictures_beside_a_new_table(tmp_path):
    a, b = save(tmp_path / "a.png"), save(tmp_path / "b.png")
    out = tmp_path / "out"
    assert call("corrupt", a, b, "--out", out).exit_code == 0
    (out / "notes.txt").write_text("kept")
    assert call("corrupt", b, "--out", out).exit_code == 0
    assert sorted(file.name for file in out.iterdir() if file.name[0] != ".") == ["b.json", "b.png", "notes.txt"]


def test_foreign_files_and_inputs_are_never_overwritten_or_removed(tmp_path):
    a = save(tmp_path / "a.png")
    out = tmp_path / "out"
    save(out / "a.png", "foreign")
    before = (out / "a.png").read_bytes()
    done = call("corrupt", a, "--out", out, "--sigma-dn", 5)
    assert done.exit_code == 2 and "would overwrite" in done.output
    assert (out / "a.png").read_bytes() == before
    assert call("corrupt", a, "--out", tmp_path / "chain").exit_code == 0
    done = call("corrupt", tmp_path / "chain/a.png", "--out", tmp_path / "chain")
    assert done.exit_code == 2 and "would overwrite its input" in done.output
    assert (tmp_path / "chain/a.png").is_file()
    done = call("noise", a, "--csv", a, "--estimator", "pca")
    assert done.exit_code == 2 and "would overwrite an input" in done.output and a.stat().st_size > 1000
    linked = tmp_path / "linked.csv"
    linked.hardlink_to(a)
    done = call("noise", a, "--csv", linked, "--estimator", "pca")
    assert done.exit_code == 2 and "would overwrite an input" in done.output and a.stat().st_size > 1000


def contents(folder):
    """Files of results, by name."""
    return {file.name: file.read_bytes() for file in folder.iterdir() if file.name != LIST_NAME}


def test_wrong_options_are_refused_before_the_results_of_the_last_run_go(tmp_path, monkeypatch):
    monkeypatch.setenv("CAMERA_MONITOR_HOME", str(tmp_path / "home"))
    camera_store.save(StoredCamera("front", "sharp frames", "gbb", {}, (200, 256), 1, [[1.0] * 8] * 2, None, "1"))
    a, grey, out = save(tmp_path / "a.png"), tmp_path / "grey.png", tmp_path / "out"
    assert cv2.imwrite(str(grey), np.full((200, 256), 128, np.uint8))
    assert call("health", a, "--out", out, "--noise", "pca").exit_code == 0
    before = contents(out)
    for option, value, words in (
        ("--noise", "adptive", "did you mean 'adaptive'"),
        ("--blur", "spektral", "did you mean 'spectral'"),
        ("--sharp", grey, "no patch has structure"),
        ("--exposure", 16, "--exposure"),
        ("--camera", "front", "was calibrated for the estimator gbb"),
    ):
        refused = call("health", a, "--out", out, option, value)
        assert refused.exit_code == 2 and words in refused.output, refused.output
        assert contents(out) == before and "health.json" in before, option
    assert call("health", a, "--out", out, "--noise", "pca").exit_code == 0
    assert contents(out).keys() == before.keys()


def test_a_folder_is_checked_before_a_calibration(tmp_path, monkeypatch):
    """Which may take minutes."""
    monkeypatch.setattr("pipeline.condition.ConditionMonitor.calibrate", lambda *given, **options: pytest.fail())
    a, out = save(tmp_path / "a.png"), tmp_path / "out"
    out.mkdir()
    (out / "health.json").write_text("{}")
    refused = call("health", a, "--sharp", a, "--out", out)
    assert refused.exit_code == 2 and "health.json, which no earlier run of this command wrote" in refused.output
    with OutputFolder(out, "corrupt"):
        assert "another run writes there" in call("health", a, "--sharp", a, "--out", out).output


def test_a_refused_table_leaves_the_maps_of_the_last_run(tmp_path):
    a, maps = save(tmp_path / "a.png"), tmp_path / "maps"
    assert call("noise", a, "--map", maps, "--estimator", "pca").exit_code == 0
    before = contents(maps)
    assert "would overwrite an input" in call("noise", a, "--map", maps, "--csv", a, "--estimator", "pca").output
    assert contents(maps) == before and len(before) == 1


def test_a_table_replaces_tables_of_the_same_command_only(tmp_path):
    a, table = save(tmp_path / "a.png"), tmp_path / "table.csv"
    for content in (None, "", "picture,x_px,y_px,size_px,old\n"):
        if content is not None:
            table.write_text(content)
        assert call("noise", a, "--csv", table, "--estimator", "pca").exit_code == 0
        assert table.read_text().startswith("picture,x_px,y_px,size_px,sigma_dn")
    for content in ("picture,note\n", "pic", "\x89PNG"):
        table.write_text(content)
        done = call("noise", a, "--csv", table, "--estimator", "pca")
        assert done.exit_code == 2 and "which no earlier run of this command wrote" in done.output
        assert table.read_text() == content


def test_two_runs_never_write_into_one_folder_at_once(tmp_path):
    with OutputFolder(tmp_path / "out", "corrupt"), pytest.raises(OutputError, match="another run"):
        OutputFolder(tmp_path / "out", "corrupt")
    OutputFolder(tmp_path / "out", "corrupt").__exit__(None, None, None)  # free again


def test_results_are_written_where_the_system_has_no_locks(tmp_path, monkeypatch):
    """Windows has no module `fcntl`."""
    monkeypatch.setitem(sys.modules, "fcntl", None)
    with OutputFolder(tmp_path / "out", "corrupt") as folder:
        folder.claim("a", ".png").write_text("first")
    with OutputFolder(tmp_path / "out", "corrupt") as folder:
        assert not (tmp_path / "out/a.png").exists()  # a result of the last run
        assert folder.claim("a", ".png").name == "a.png"


@pytest.mark.parametrize(
    "number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.full("one more takes 4 s"))]
)
def test_a_signal_keeps_the_rows_of_finished_frames(tmp_path, number):
    film(tmp_path / "long.avi", frames=400)
    command = [sys.executable, "-m", "pipeline.cli", "health", str(tmp_path / "long.avi"), "--noise", "pca"]
    started = subprocess.Popen(
        [*command, "--out", str(tmp_path / "out")],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=heed_interrupts,
    )
    table = tmp_path / "out/health.csv"
    deadline = time.monotonic() + 300
    while time.monotonic() < deadline and not (table.is_file() and table.read_text().count("\n") >= 3):
        time.sleep(0.05)
    started.send_signal(number)
    _, errors = started.communicate(timeout=300)
    assert started.returncode == 130, errors
    assert "interrupted" in errors and "Traceback" not in errors
    with table.open() as file:
        rows = list(csv.DictReader(file))
    content = json.loads((tmp_path / "out/health.json").read_text())
    assert 2 <= len(rows) < 400
    assert content["complete"] is False and len(content["pictures"]) == len(rows)
    lines = (tmp_path / "out/health.jsonl").read_text().splitlines()
    assert [json.loads(line)["picture"] for line in lines] == [row["picture"] for row in rows]


def end_after_row(number, monkeypatch):
    """Have SIGTERM come right after this row of a table, counted from 1, was written."""
    write, written = RowFile.write, []

    def write_and_end(file, row):
        write(file, row)
        written.append(row)
        if len(written) == number:
            signal.raise_signal(signal.SIGTERM)

    monkeypatch.setattr(RowFile, "write", write_and_end)


@pytest.mark.parametrize(
    ("error", "code"),
    [(BrokenPipeError(errno.EPIPE, "Broken pipe"), 1), (OSError(errno.ENOSPC, "full"), 2), (KeyboardInterrupt(), 130)],
)
def test_files_of_a_run_whose_output_cannot_be_printed_are_complete(tmp_path, monkeypatch, error, code):
    def refuse(*given):
        raise error

    monkeypatch.setattr("pipeline.cli.commands.health._print_run", refuse)
    done = call("health", save(tmp_path / "a.png"), "--noise", "pca", "--out", tmp_path / "out")
    assert done.exit_code == code
    content = json.loads((tmp_path / "out/health.json").read_text())
    assert content["complete"] is True and len(content["pictures"]) == 1
    assert "run interrupted" not in (tmp_path / "out/health.html").read_text()


def test_a_signal_while_a_frame_is_written_leaves_all_files_with_the_same_frames(tmp_path, monkeypatch):
    film(tmp_path / "long.avi", frames=6)
    end_after_row(2, monkeypatch)
    done = call("health", tmp_path / "long.avi", "--noise", "pca", "--out", tmp_path / "out")
    assert done.exit_code == 130, done.output
    content = json.loads((tmp_path / "out/health.json").read_text())
    assert content["complete"] is False and len(content["pictures"]) == 2
    for name in ("health.csv", "health.jsonl"):
        assert len((tmp_path / "out" / name).read_text().splitlines()) == 2 + (name == "health.csv"), name


def test_a_signal_while_a_frame_s_tiles_are_written_leaves_all_of_them(tmp_path, monkeypatch):
    film(tmp_path / "long.avi", frames=6)
    end_after_row(1, monkeypatch)
    table = tmp_path / "tiles.csv"
    done = call("noise", tmp_path / "long.avi", "--estimator", "pca", "--tile", 32, "--csv", table)
    assert done.exit_code == 130, done.output
    with table.open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) > 1 and {row["picture"] for row in rows} == {rows[0]["picture"]}


@pytest.mark.skipif(not FULL_DISK.exists(), reason="the system has no /dev/full to stand for a full disk")
def test_a_full_disk_is_named(tmp_path):
    with pytest.raises(OutputError, match="No space left on device"):
        RowFile(FULL_DISK, ("a",))
    done = call("noise", save(tmp_path / "a.png"), "--csv", FULL_DISK, "--estimator", "pca")
    assert done.exit_code == 2 and "No space left on device" in done.output and "picture format" not in done.output


@pytest.mark.parametrize("command", [["health", "--out"], ["noise", "--map"], ["noise", "--csv"], ["corrupt", "--out"]])
def test_results_that_cannot_be_written_are_refused_before_anything_is_computed(tmp_path, command):
    a, (name, option) = save(tmp_path / "a.png"), command
    blocked = a / "folder" / "file" if option == "--csv" else a / "folder"  # below a file nothing can be made
    done = call(name, a, option, blocked)
    assert done.exit_code == 2
    assert len(done.output.splitlines()) == 1, done.output
    assert str(blocked) in done.output and "Not a directory" in done.output


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_permission_is_refused(tmp_path):
    (tmp_path / "closed").mkdir(mode=0o500)
    done = call("corrupt", save(tmp_path / "a.png"), "--out", tmp_path / "closed/out")
    assert done.exit_code == 2 and "Permission denied" in done.output


def test_names_in_tables_are_quoted_and_no_formulas(tmp_path):
    odd = save(tmp_path / '=1+2,"x".png')
    assert call("noise", odd, "--csv", tmp_path / "t.csv", "--estimator", "pca").exit_code == 0
    with (tmp_path / "t.csv").open() as file:
        assert {row["picture"] for row in csv.DictReader(file)} == {str(odd)}
    assert plain_text("=cmd()") == "'=cmd()" and plain_text("@x") == "'@x" and plain_text("a=b") == "a=b"
    with RowFile(tmp_path / "u.csv", ("name", "value")) as rows:
        rows.write({"name": '=HYPERLINK("x")', "value": -1.5})
    assert (tmp_path / "u.csv").read_text() == 'name,value\n"\'=HYPERLINK(""x"")",-1.5\n'


def test_corrupt_goes_on_past_a_bad_file_and_reports_what_it_reached(tmp_path):
    good = save(tmp_path / "in/b.png")
    (tmp_path / "in/a.png").write_bytes(good.read_bytes()[:900])
    done = call("corrupt", tmp_path / "in", "--out", tmp_path / "out", "--noise-source", "readout", "--sigma-dn", 8)
    assert done.exit_code == 2
    assert "set aside" in done.output and "a.png" in done.output
    line = next(text for text in done.output.splitlines() if text.endswith("-> b.png"))
    requested, reached, clipped = (float(word) for word in line.split()[:3])
    truth = json.loads((tmp_path / "out/b.json").read_text())
    assert (
        requested == 8
        and abs(reached - truth["unclipped_sigma_dn"]) < 0.006
        and abs(clipped - truth["clipped_sigma_dn"]) < 0.006
    )


@pytest.mark.parametrize(
    ("option", "value"),
    [("--size-px", "1e9"), ("--size-px", "nan"), ("--sigma-dn", "inf"), ("--mtf50", "nan"), ("--angle-deg", "nan")],
)
def test_numbers_without_bound_are_refused_at_once(tmp_path, option, value):
    start = time.perf_counter()
    done = call("corrupt", save(tmp_path / "a.png"), "--out", tmp_path / "out", "--blur", "defocus", option, value)
    assert done.exit_code == 2 and option in done.output
    assert len(done.output.splitlines()) == 1
    assert time.perf_counter() - start < 5


def test_a_kernel_larger_than_the_picture_is_refused(tmp_path):
    small = save(tmp_path / "a.png", width_px=64, height_px=64)
    done = call("corrupt", small, "--out", tmp_path / "out", "--blur", "defocus", "--size-px", 101)
    assert done.exit_code == 2 and "larger than the picture" in done.output


RESULTS = ("provenance.json", "table.csv", "surface-*.npz")


@pytest.mark.parametrize("names", [(), ("provenance.json",), ("provenance.json", "table.csv", "surface-car.npz")])
def test_an_empty_folder_and_an_earlier_result_may_be_replaced(tmp_path, names):
    for name in names:
        (tmp_path / name).write_text("x")
    refuse_foreign(tmp_path, "--to", RESULTS, [])
    refuse_foreign(tmp_path / "absent", "--to", RESULTS, [])
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted(names)


@pytest.mark.parametrize(
    ("names", "word"),
    [(("table.csv",), "has no provenance.json"), (("provenance.json", "a.png"), "a.png"), ((".hidden",), ".hidden")],
)
def test_a_folder_with_anything_else_is_not_replaced(tmp_path, names, word):
    for name in names:
        (tmp_path / name).write_text("x")
    with pytest.raises(OutputError, match=rf"^--to .*{word}.* another folder$"):
        refuse_foreign(tmp_path, "--to", RESULTS, [])


def test_links_and_folders_in_place_of_results_are_not_replaced(tmp_path):
    (tmp_path / "out/provenance.json").mkdir(parents=True)
    (tmp_path / "link").symlink_to(tmp_path / "out")
    with pytest.raises(OutputError, match=r"provenance\.json, which no earlier run"):
        refuse_foreign(tmp_path / "out", "--to", RESULTS, [])
    with pytest.raises(OutputError, match="is a link"):
        refuse_foreign(tmp_path / "link", "--to", RESULTS, [])
