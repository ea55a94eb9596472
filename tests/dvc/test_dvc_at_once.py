"""``python -m pipeline.dvc repro``: stages at once, from one server, with the results, messages and file of DVC."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import psutil
import pytest
import yaml
from interrupts import heed_interrupts

from pipeline.dvc import at_once as parallel
from pipeline.dvc import preloaded
from pipeline.dvc.at_once import stages_at_once, startable
from pipeline.dvc.lock_file import LockFileWriter

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/recorder"))
import compare  # noqa: E402

MEETING = """
import sys, time
from pathlib import Path
name, other = sys.argv[1:3]
Path(f"{name}.begun").write_text("")
deadline = time.monotonic() + 60
while not Path(f"{other}.begun").exists():  # ends only if the other runs meanwhile
    assert time.monotonic() < deadline, "the other never began"
    time.sleep(0.05)
print("met", other)
print("a bar 10%\\rbar 100%")
Path(f"{name}.txt").write_text(name)
"""
STAGE = """
import os, sys
import pipeline
from pathlib import Path
print("loaded before:", "torch" in sys.modules, "pins:", pipeline._processor.status(), "argv:", *sys.argv[1:])
print("main:", __name__, "stage:", os.environ["DVC_STAGE"])
if "+job.sleep=yes" in sys.argv:
    with open("begun", "a") as begun:
        begun.write("served\\n")
    __import__("time").sleep(100)
if "+job.fail=yes" in sys.argv:
    sys.exit(7)
Path(sys.argv[1].partition("=")[2]).write_text("x")
"""


def make(folder, stages, *, modules=False):
    """A project with these stages; with `modules` also a package whose ``stages/show.py`` can be served."""
    folder.mkdir(exist_ok=True)
    (folder / "a.txt").write_text("a")
    (folder / "meeting.py").write_text(MEETING)
    (folder / "dvc.yaml").write_text(yaml.safe_dump({"stages": stages}, sort_keys=False))
    (folder / "params.yaml").write_text("executor: {workers: 1}\n")
    if modules:
        (folder / "pipeline/stages").mkdir(parents=True)
        for name in ("__init__.py", "processor.py", "freed_memory.py", "dvc"):
            copy = shutil.copytree if (ROOT / "pipeline" / name).is_dir() else shutil.copy
            copy(ROOT / "pipeline" / name, folder / "pipeline" / name)
        (folder / "pipeline/stages/__init__.py").write_text("")
        (folder / "pipeline/stages/show.py").write_text(STAGE)
        (folder / "pipeline/stages/release.py").write_text(f"# release_torch\n{STAGE}")
    (folder / ".dvc").mkdir()
    (folder / ".dvc/config").write_text("[core]\n    no_scm = True\n")  # as `dvc init --no-scm` does, in no time
    return folder


def environment(folder, at_once):
    package = folder if (folder / "pipeline").exists() else ROOT
    return {
        "PYTHONPATH": str(package),
        "PATH": f"{Path(sys.executable).parent}:/usr/bin:/bin",
        "HOME": str(folder),
        "STAGES_AT_ONCE": str(at_once),
        **{name: os.environ[name] for name in ("RECORD_STAGES",) if name in os.environ},
    }


def run(folder, module, *arguments, at_once=2, status=0, **more):
    command = [sys.executable, "-m", module, *arguments]
    result = subprocess.run(
        command, cwd=folder, env=environment(folder, at_once) | more, capture_output=True, text=True, check=False
    )
    assert result.returncode == status, result.stdout + result.stderr
    return result


def meeting(name, other, **more):
    return {"cmd": f"python meeting.py {name} {other}", "deps": ["meeting.py"], "outs": [f"{name}.txt"], **more}


def show(out, *job, module="show", **more):
    words = " ".join([f"+job.out={out}", *job])
    return {"cmd": f"python -m pipeline.stages.{module} {words}", "deps": ["a.txt"], "outs": [out], **more}


def test_two_stages_run_at_once_and_their_lines_bear_their_names(tmp_path):
    folder = make(tmp_path, {"one": meeting("one", "two"), "two": meeting("two", "one")})
    lines = run(folder, "pipeline.dvc", "repro").stdout.splitlines()
    assert {"one | met two", "two | met one", "one | bar 100%"} <= set(lines)
    assert not any("10%\r" in line for line in lines)
    assert "up to date" in run(folder, "dvc", "status").stdout
    assert "didn't change" in run(folder, "pipeline.dvc", "repro").stdout


@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="needs two cores")
def test_an_experiment_runs_stages_at_once_by_the_parameters_it_sets(tmp_path):
    folder = make(
        tmp_path, {"one": meeting("one", "two", params=["top"]), "two": meeting("two", "one", params=["top"])}
    )
    (folder / "params.yaml").write_text("executor: {workers: 99}\ntop: 1\n")
    shutil.rmtree(folder / ".dvc")
    (folder / ".gitignore").write_text("*.begun\n.config\n.cache\n.local\n.gitconfig\n")
    person = ("-c", "user.name=a", "-c", "user.email=a@localhost")
    for arguments in (("init", "-q", "."), ("add", "."), (*person, "commit", "-qm", "a")):
        if arguments[0] == "add":
            run(folder, "dvc", "init", "-q")
        subprocess.run(["git", *arguments], cwd=folder, check=True, capture_output=True)
    names = {f"GIT_{role}_{key}": "a" for role in ("AUTHOR", "COMMITTER") for key in ("NAME", "EMAIL")}
    setting = ("-S", "executor.workers=1", "-S", "top=2")
    lines = run(folder, "pipeline.dvc", "exp", "run", *setting, at_once="", **names).stdout.splitlines()
    assert {"one | met two", "two | met one"} <= set(lines)


@pytest.mark.full("DVC, six times, takes 8 s")
def test_the_lock_file_is_that_of_dvc_though_stages_end_in_another_order(tmp_path):
    slow = {"cmd": "sleep 2; echo s > slow.txt", "deps": ["a.txt"], "outs": ["slow.txt"]}
    after = {"cmd": "cat slow.txt > after.txt", "deps": ["slow.txt"], "outs": ["after.txt"]}
    quick = {"cmd": "echo q > quick.txt", "deps": ["a.txt"], "outs": [{"quick.txt": {"cache": False}}]}
    more = {"cmd": "cat quick.txt > more.txt", "deps": ["quick.txt"], "outs": ["more.txt"]}
    last = {"cmd": "cat after.txt more.txt > last.txt", "deps": ["after.txt", "more.txt"], "outs": ["last.txt"]}
    graph = {"slow": slow, "after": after, "quick": quick, "more": more, "last": last}
    locks, lines = [], []
    for name, module in (("at_once", "pipeline.dvc"), ("plain", "dvc")):
        folder = make(tmp_path / name, graph)
        lines.append(run(folder, module, "repro").stdout.splitlines())
        locks.append((folder / "dvc.lock").read_text())
        (folder / "a.txt").write_text("b")
        run(folder, module, "repro")
        locks.append((folder / "dvc.lock").read_text())
    assert locks[:2] == locks[2:]
    assert lines[0].index("Running stage 'more':") < lines[0].index("Running stage 'after':")
    assert lines[1].index("Running stage 'more':") > lines[1].index("Running stage 'after':")


@pytest.mark.parametrize("at_once", [1, 2])
def test_a_failing_stage_ends_with_its_message_and_no_other_begins(tmp_path, at_once):
    failing = {"cmd": "echo reason >&2; exit 3", "outs": ["never.txt"], "deps": ["a.txt"]}
    beside = {"cmd": "sleep 2; echo b > beside.txt", "outs": ["beside.txt"], "deps": ["a.txt"]}
    later = {"cmd": "echo l > later.txt", "outs": ["later.txt"], "deps": ["beside.txt"]}
    folder = make(tmp_path, {"failing": failing, "beside": beside, "later": later})
    result = run(folder, "pipeline.dvc", "repro", at_once=at_once, status=255)
    assert "reason" in result.stdout + result.stderr
    assert "failed to reproduce 'failing': failed to run: echo reason >&2; exit 3, exited with 3" in result.stderr
    assert (folder / "beside.txt").exists() == (at_once == 2)  # what runs beside it ends, and is kept
    assert not (folder / "later.txt").exists()
    if at_once == 2:
        assert "beside" in (folder / "dvc.lock").read_text()


def test_a_stage_without_outputs_ends_before_later_ones_begin(tmp_path):
    check = {"cmd": "sleep 1; exit 1", "always_changed": True}
    later = {"cmd": "echo l > later.txt", "outs": ["later.txt"], "deps": ["a.txt"]}
    folder = make(tmp_path, {"check": check, "later": later})
    run(folder, "pipeline.dvc", "repro", status=255)
    assert not (folder / "later.txt").exists()


@pytest.mark.full("DVC, interrupted and run again, takes 10 s")
@pytest.mark.parametrize("served", [False, True])
@pytest.mark.parametrize("at_once", [1, 2])
def test_an_interrupt_ends_the_commands_and_dvc_and_leaves_the_repository_usable(tmp_path, at_once, served):
    command = "echo {name} > {name} && echo {name} >> begun && exec sleep 100"
    if served:
        stages = {name: show(name, "+job.sleep=yes") for name in "xyz"}
    else:
        stages = {name: {"cmd": command.format(name=name), "outs": [name], "deps": ["a.txt"]} for name in "xyz"}
    folder = make(tmp_path, stages, modules=served)
    process = subprocess.Popen(
        [sys.executable, "-m", "pipeline.dvc", "repro"], cwd=folder, env=environment(folder, at_once),
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True, preexec_fn=heed_interrupts,
    )  # fmt: skip
    deadline = time.monotonic() + 120
    while not (folder / "begun").exists() or len((folder / "begun").read_text().split()) < at_once:
        assert time.monotonic() < deadline and process.poll() is None
        time.sleep(0.1)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does
    output, _ = process.communicate(timeout=60)
    assert process.returncode not in (0, None), output
    assert served or "Traceback" not in output
    assert not (folder / "dvc.lock").exists()
    assert len((folder / "begun").read_text().split()) == at_once
    (folder / "dvc.yaml").write_text(yaml.safe_dump({"stages": {"w": {"cmd": "echo w > w", "outs": ["w"]}}}))
    run(folder, "pipeline.dvc", "repro")


@pytest.mark.parametrize("at_once", [pytest.param(1, marks=pytest.mark.full("one more takes 4 s")), 2])
def test_a_served_command_runs_as_python_runs_it(tmp_path, at_once):
    folder = make(
        tmp_path, {"one": show("1.txt"), "two": show("2.txt"), "alone": show("3.txt", module="release")}, modules=True
    )
    output = run(folder, "pipeline.dvc", "repro", at_once=at_once).stdout
    plain = run(folder, "pipeline.stages.show", "+job.out=4.txt", DVC_STAGE="one").stdout
    status = plain.partition("pins: ")[2].partition(" argv")[0]
    assert "loaded before: False" in plain
    assert output.count(f"loaded before: True pins: {status} argv: +job.out=") == 2
    assert output.count(f"loaded before: False pins: {status} argv: +job.out=3.txt") == 1
    for name in ("one", "two", "alone"):
        assert f"main: __main__ stage: {name}" in output


@pytest.mark.parametrize("at_once", [pytest.param(1, marks=pytest.mark.full("one more takes 5 s")), 2])
def test_a_served_command_that_fails_gives_its_exit_status(tmp_path, at_once):
    folder = make(tmp_path, {"one": show("1.txt", "+job.fail=yes"), "two": show("2.txt")}, modules=True)
    result = run(folder, "pipeline.dvc", "repro", at_once=at_once, status=255)
    assert "+job.fail=yes, exited with 7" in result.stderr


def test_a_served_stage_is_recorded_like_a_process_of_its_own(tmp_path):
    folder = make(tmp_path, {"one": show("1.txt"), "alone": show("2.txt", module="release")}, modules=True)
    records = folder / "records"
    records.mkdir()
    run(folder, "pipeline.dvc", "repro", PYTHONPATH=f"{ROOT}/tests/recorder:{folder}", RECORD_STAGES=str(records))
    by_module = {record["stage"][0]: record for record in compare.records(records)}
    assert set(by_module) == {"pipeline.stages.show", "pipeline.stages.release"}
    for module, out in (("show", "1.txt"), ("release", "2.txt")):
        record = by_module[f"pipeline.stages.{module}"]
        assert record["stage"] == [f"pipeline.stages.{module}", f"+job.out={out}"]
        executed = {path for path in record["executed"] if path.endswith(".py") and not path.startswith(compare.STARTS)}
        names = ("__init__", "processor", "stages/__init__", f"stages/{module}")
        assert executed == {f"pipeline/{name}.py" for name in names}
        assert out in record["opened"]


@pytest.mark.parametrize(
    ("command", "expected"),
    [
        ("python -m pipeline.dvc.at_once --params +job.a=b-c", ["pipeline.dvc.at_once", "--params", "+job.a=b-c"]),
        ("python -m pipeline.dvc.at_once > a.txt", None),
        ("python -m pipeline.dvc.at_once; true", None),
        ("python -m pipeline.dvc.at_once $HOME", None),
        ("python -m pipeline.stages.train_mtf --params", None),  # lifts the pins of torch
        ("python -m pipeline.stages.absent", None),
        ("python setup.py", None),
    ],
)
def test_only_plain_commands_are_served(monkeypatch, command, expected):
    monkeypatch.chdir(ROOT)
    here = {"PATH": str(Path(sys.executable).parent)}
    assert preloaded.words(command, ROOT, here) == expected
    assert preloaded.words(command, ROOT, {"PATH": "/nowhere"}) is None
    assert preloaded.words(command, ROOT / "tests", here) is None


def test_the_server_loads_libraries_that_are_dependencies_and_nothing_of_the_package():
    dependencies = (ROOT / "pyproject.toml").read_text()
    names = {"cv2": "opencv-python-headless", "yaml": "pyyaml"}
    for library in preloaded.LIBRARIES:
        package = library.partition(".")[0]
        assert package != "pipeline"
        assert f'"{names.get(package, package)}' in dependencies.lower(), library


def test_how_many_stages_run_at_once():
    assert stages_at_once(2, 1, None) == 2
    assert stages_at_once(2, 0, None) == 2
    assert stages_at_once(2, 2, None) == 1
    assert stages_at_once(1, 0, None) == 1
    assert stages_at_once(64, 1, None) == 4
    assert stages_at_once(64, 1, "9") == 9
    assert stages_at_once(2, 1, "0") == stages_at_once(2, 1, "many") == 1


def test_stages_begin_in_order_behind_their_dependencies_and_checks():
    def stage(outs=("out",)):
        return SimpleNamespace(outs=outs)

    class Node(SimpleNamespace):
        __hash__ = object.__hash__

    a, b, check, c, d = (Node(outs=outs) for outs in (["a"], ["b"], [], ["c"], ["d"]))
    upstream = {a: set(), b: {a}, check: set(), c: set(), d: {b}}
    assert startable([a, b, check, c, d], [], set(), upstream) == [a, check]
    assert startable([b, c, d], [check], {a}, upstream) == []
    assert startable([b, c, d], [], {a, check}, upstream) == [b, c]
    assert startable([d], [c], {a, b, check}, upstream) == [d]


def test_of_stages_that_fail_together_the_first_is_named(monkeypatch, tmp_path):
    class Node(SimpleNamespace):
        __hash__ = object.__hash__

    def fail(stage):
        raise ValueError(stage.addressing)

    real = parallel.wait
    monkeypatch.setattr(parallel, "wait", lambda running, return_when: real(running))
    nodes = [Node(addressing=f"stage-{number}", outs=["a"]) for number in range(8)]
    for _ in range(5):
        stages = parallel.Stages(LockFileWriter(lambda *lock, **options: None), tmp_path / "params.yaml")
        stages._slots.count = len(nodes)
        _, failed = stages._run_all(nodes, {node: set() for node in nodes}, fail)
        assert failed is not None and failed[1] is nodes[0]


LINUX = pytest.mark.skipif(sys.platform != "linux", reason="the kernel ends a child with its parent on Linux only")
SLEEPING = """
import os, time
import pipeline
from pathlib import Path
with open("begun", "a") as begun:
    begun.write(f"{os.getpid()}\\n")
time.sleep(100)
"""


@pytest.mark.parametrize(
    ("number", "at_once", "served"),
    [(signal.SIGTERM, 2, True), (signal.SIGTERM, 2, False), (signal.SIGKILL, 2, True),
     pytest.param(signal.SIGKILL, 2, False, marks=LINUX),
     *(pytest.param(number, 1, served, marks=pytest.mark.full("one more takes 3 s"))
       for number, served in ((signal.SIGTERM, True), (signal.SIGTERM, False), (signal.SIGKILL, True)))],
)  # fmt: skip
def test_no_stage_outlives_the_one_that_runs_it(tmp_path, number, at_once, served):
    """It would write its results over those of a later run."""
    module = "show" if served else "release"
    folder = make(tmp_path, {name: show(name, module=module) for name in "xyz"}, modules=True)
    (folder / f"pipeline/stages/{module}.py").write_text(SLEEPING + ("" if served else "# release_torch\n"))
    process = subprocess.Popen(
        [sys.executable, "-m", "pipeline.dvc", "repro"], cwd=folder, env=environment(folder, at_once),
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    deadline = time.monotonic() + 120
    while not (folder / "begun").exists() or len((folder / "begun").read_text().split()) < at_once:
        assert time.monotonic() < deadline and process.poll() is None
        time.sleep(0.1)
    stages = [int(word) for word in (folder / "begun").read_text().split()]
    process.send_signal(number)
    output, _ = process.communicate(timeout=60)
    assert process.returncode == (128 + number if number == signal.SIGTERM else -number), output
    assert "Traceback" not in output
    deadline = time.monotonic() + 40  # they would sleep longer
    while any(running(stage) for stage in stages):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    assert len((folder / "begun").read_text().split()) == at_once and not (folder / "dvc.lock").exists()


def running(pid):
    with contextlib.suppress(psutil.NoSuchProcess):
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    return False
