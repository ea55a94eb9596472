"""The command line as people meet it: quick help, and one clear line for mistakes."""

import os
import signal
import subprocess
import sys
import time

import click
import pytest
from cli_makers import call, noisy

from pipeline.cli import COMMANDS
from pipeline.signals import handled


def test_help_names_every_command_and_is_quick():
    start = time.perf_counter()
    done = subprocess.run([sys.executable, "-m", "pipeline.cli", "--help"], capture_output=True, text=True)
    assert time.perf_counter() - start < 10  # a second on an idle machine; see benchmarks for the figure
    assert done.returncode == 0
    assert all(name in done.stdout for name in COMMANDS)


@pytest.mark.parametrize(("before", "exit_code"), [(signal.SIG_IGN, 0), (signal.SIG_DFL, 130)])
def test_the_end_of_its_terminal_ends_a_command_unless_nohup_started_it(monkeypatch, before, exit_code):
    @click.command
    def waiting():
        signal.raise_signal(signal.SIGHUP)

    monkeypatch.setattr("pipeline.cli.commands.doctor.command", waiting)
    with handled([signal.SIGHUP], before):
        assert call("doctor").exit_code == exit_code


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_explains_itself(name):
    done = call(name, "--help")
    assert done.exit_code == 0
    assert len(done.output.splitlines()) > 5


def test_a_module_that_python_has_kept_in_part_is_one_line(tmp_path):
    """As a full disk leaves it; click says "Aborted!" where the end of a file is met."""
    environment = {**os.environ, "PYTHONPYCACHEPREFIX": str(tmp_path)}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    command = [sys.executable, "-m", "pipeline.cli", "doctor", "--help"]
    subprocess.run(command, capture_output=True, check=True, env=environment)
    (compiled,) = tmp_path.rglob("cli/commands/doctor.*.pyc")
    compiled.write_bytes(compiled.read_bytes()[:1024])
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    line = f"error: {compiled}: cut short, as by a full disk; delete it\n"
    assert (done.returncode, done.stdout, done.stderr) == (2, "", line)


def test_a_typo_gets_a_hint():
    done = call("nois", "x.png")
    assert done.exit_code == 2
    assert "did you mean 'noise'" in done.output


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["noise", "absent.png"], "absent.png"),
        (["noise", "{}", "--estimator", "pcaa"], "did you mean 'pca'"),
        (["noise", "{}", "--tile", "47"], "--tile 47: the noise estimator adaptive takes tiles of at least 48 px"),
        (["noise", "{}", "--tile", "31", "--estimator", "pca"], "pca takes tiles of at least 32 px"),
        (["corrupt", "{}", "--out", "{}/out", "--noise-source", "fotons"], "photon"),
        (["corrupt", "{}", "--out", "{}/out", "--blur", "defocus"], "--size-px"),
        (["corrupt", "{}", "--out", "{}/out", "--size-px", "3"], "--blur"),
        (["corrupt", "{}", "--out", "{}/out", "--sigma-dn", "-3"], "--sigma-dn"),
        (["dataset", "kity", "{}"], "did you mean 'kitti'"),
        (["dataset", "kitti", "{}/nothing"], "nothing"),
        (["health", "absent\r\x85.png"], r"absent\r\x85.png: no such file"),
        (["dataset", "kitti", "{}", "one\r\x85more"], r"one\r\x85more"),
    ],
)
def test_mistakes_are_one_line_that_names_them(tmp_path, arguments, word):
    noisy(tmp_path / "a.png", 5.0)
    done = call(*(argument.replace("{}", str(tmp_path)) for argument in arguments))
    assert done.exit_code == 2
    assert word in done.output
    assert "Traceback" not in done.output
    assert len(done.output.splitlines()) <= 2  # a table's header may come before
