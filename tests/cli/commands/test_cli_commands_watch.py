"""``camera-monitor watch`` on a video played as a stream and on a folder that fills: lines, alarms, clean stops."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import av
import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from data_makers import picture
from interrupts import heed_interrupts

from pipeline.camera.processing.codec import video_file
from pipeline.cli import main
from pipeline.cli.analysis.frame import Thresholds
from pipeline.cli.watching.alarms import alarm_words
from pipeline.cli.watching.folder import filling_folder
from pipeline.cli.watching.loop import STATED, Watch
from pipeline.cli.watching.source_frame import SourceFrame
from pipeline.cli.watching.sources import live
from pipeline.cli.watching.video_file import played_video
from pipeline.condition.trend import ConditionTrend
from pipeline.streams import stream


def film(path, frames, fault_from=None, size=(224, 208)):
    """A panning video; from a frame on its pictures are blurred."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 10, size)
    scene = picture("watch", *size)
    for number in range(frames):
        image = np.roll(scene, 5 * number, axis=1)
        if fault_from is not None and number >= fault_from:
            image = cv2.GaussianBlur(image, (0, 0), 4.0)
        writer.write(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR))
    writer.release()
    return path


def watch(*arguments):
    done = CliRunner().invoke(main, ["watch", *(str(argument) for argument in arguments), "--noise", "pca"])
    return done, [json.loads(line) for line in done.stdout.splitlines()]


def test_every_frame_of_a_video_becomes_a_line_and_a_threshold_an_alarm(tmp_path):
    done, lines = watch(film(tmp_path / "v.avi", 5, 3), "--no-wait", "--alarm-mtf50", "0.2", "--window", 3)
    assert done.exit_code == 3, done.output
    events = [line["event"] for line in lines]
    assert events[0] == "start" and events[-1] == "stop" and events.count("frame") == 5
    assert len(lines[0]["weights_sha256"]["mtf_spectral.safetensors"]) == 64
    alarms = [line for line in lines if line["event"] == "alarm"]
    assert {line["alarm"] for line in alarms} == {"blur horizontal", "blur vertical"}
    assert all(line["picture"].endswith("#3") for line in alarms)
    for line in alarms:
        axis = line["alarm"].removeprefix("blur ")
        mtf50 = next(part for part in lines if part.get("picture") == line["picture"])[f"mtf50_{axis}"]
        assert line["words"] == f"MTF50 {axis} {mtf50:.3f}, below 0.2 of Nyquist"
    frames = [line for line in lines if line["event"] == "frame"]
    assert [line["state"]["frames"] for line in frames] == [1, 2, 3, 3, 3]
    assert "blurred" in frames[-1]["state"]["words"] and frames[-1]["trend"] == "learning"
    assert frames[-1]["trend_of"] == []
    assert lines[-1] == {**lines[-1], "frames": 5, "alarms": 2, "reason": "end", "set_aside": 0}


def test_noise_and_blur_are_measured_on_as_many_tiles_and_patches_as_asked_for(tmp_path, monkeypatch):
    from pipeline import condition

    taken = []

    class Monitor(condition.ConditionMonitor):
        def frame(self, *arguments, **named):
            taken.append(answer := super().frame(*arguments, **named))
            return answer

    monkeypatch.setattr(condition, "ConditionMonitor", Monitor)
    source = film(tmp_path / "v.avi", 1, size=(640, 480))
    done, _ = watch(source, "--no-wait", "--tiles", 4, "--patches", 2)
    assert done.exit_code == 0, done.output
    (answer,) = taken
    assert len(answer.noise.patches) == 4 and len(answer.blur.patches) == 2


def test_it_stops_after_the_frames_asked_for_without_alarm(tmp_path):
    done, lines = watch(film(tmp_path / "v.avi", 4), "--no-wait", "--frames", 2)
    assert done.exit_code == 0, done.output
    assert lines[-1]["reason"] == "frames" and lines[-1]["frames"] == 2


@pytest.mark.parametrize("speed", [[], ["--no-wait"]])
def test_a_video_cut_short_is_reported_after_its_last_frame(tmp_path, speed):
    path = film(tmp_path / "v.avi", 10)
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * 0.6)])
    command = [sys.executable, "-m", "pipeline.cli", "watch", str(path), "--noise", "pca", "--rate", "3", *speed]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert [line["event"] for line in lines[-2:]] == ["set_aside", "stop"]
    assert lines[-1]["frames"] > 0 and lines[-1]["set_aside"] == 1 and lines[-1]["reason"] == "end"
    reason = lines[-2]["reason"]
    assert "of the 10 frames it declares are missing" in reason
    assert done.stderr.splitlines() == [f"error: {reason}"] and reason.startswith(str(path))
    assert done.returncode == 2


def test_of_a_video_without_a_frame_that_is_all_it_reports(tmp_path):
    (tmp_path / "v.avi").write_bytes(b"RIFF" + bytes(100))
    for speed in [], ["--no-wait"]:
        done, lines = watch(tmp_path / "v.avi", *speed)
        assert done.exit_code == 2 and [line["event"] for line in lines] == ["start", "set_aside", "stop"]
        assert "not a video" in lines[1]["reason"] and lines[-1]["frames"] == 0


def test_alarms_count_for_more_than_missing_frames(tmp_path):
    path = film(tmp_path / "v.avi", 10, 1)
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * 0.6)])
    done, lines = watch(path, "--no-wait", "--alarm-mtf50", "0.2")
    assert done.exit_code == 3 and lines[-1]["set_aside"] == 1


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals_stop_it_with_whole_lines(tmp_path, number):
    film(tmp_path / "v.avi", 600)
    command = [sys.executable, "-m", "pipeline.cli", "watch", str(tmp_path / "v.avi"), "--noise", "pca", "--rate", "2"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, preexec_fn=heed_interrupts)
    assert process.stdout is not None
    lines = [process.stdout.readline() for _ in range(2)]  # started, and a frame analysed
    process.send_signal(number)
    lines = [json.loads(line) for line in [*lines, *process.communicate(timeout=120)[0].splitlines()]]
    assert process.returncode == 0 and lines[1]["event"] == "frame"
    assert lines[-1]["event"] == "stop" and lines[-1]["reason"] == "signal"


def test_a_folder_that_fills_is_read_once_per_file_and_broken_files_are_reported(tmp_path):
    for name in ("a", "b"):
        cv2.imwrite(str(tmp_path / f"{name}.png"), picture(name, 224, 208))
    (tmp_path / "bad.png").write_bytes(b"none")
    (tmp_path / "notes.txt").write_text("no picture")
    done, lines = watch(tmp_path, "--idle-stop", 0.5)
    assert done.exit_code == 0, done.output
    assert sorted(line["picture"][-5:] for line in lines if line["event"] == "frame") == ["a.png", "b.png"]
    assert ["bad.png" in line["reason"] for line in lines if line["event"] == "set_aside"] == [True]
    assert lines[-1]["reason"] == "idle" and lines[-1]["set_aside"] == 1


def test_pictures_that_are_too_small_are_told_what_the_estimator_needs(tmp_path):
    for name, side in (("a", 1), ("b", 20)):
        cv2.imwrite(str(tmp_path / f"{name}.png"), picture("a", 224, 208)[:side, :side])
    _, lines = watch(tmp_path, "--idle-stop", 0.5)
    aside = sorted(line["reason"] for line in lines if line["event"] == "set_aside")
    assert aside == [
        f"{tmp_path / name}.png: too small: {side}x{side} px, expected at least 32 px on either side"
        for name, side in (("a", 1), ("b", 20))
    ]


def test_values_of_twelve_bits_in_a_folder_are_pointed_out(tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), picture("a", 224, 208).astype(np.uint16) * 16)
    done, lines = watch(tmp_path, "--idle-stop", 0.5)
    assert lines[-1]["frames"] == 1 and "a.png: all values are below 4096" in done.stderr


def test_a_file_of_a_format_that_is_not_read_is_set_aside_with_the_reason(tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), picture("a", 224, 208))
    (tmp_path / "b.dng").write_bytes(b"II*\0")
    (tmp_path / "notes.txt").write_text("no picture")
    _, lines = watch(tmp_path, "--idle-stop", 0.5)
    aside = [line for line in lines if line["event"] == "set_aside"]
    assert len(aside) == 1 and "b.dng: .dng files are not read; convert it" in aside[0]["reason"]
    assert lines[-1]["frames"] == 1 and lines[-1]["set_aside"] == 1


def test_files_that_are_still_written_wait_and_new_ones_come_in_order(tmp_path):
    stop = threading.Event()
    source = filling_folder(tmp_path, stop)
    whole = cv2.imencode(".png", picture("late", 224, 208))[1].tobytes()
    assert next(source).image is None
    (tmp_path / "late.png").write_bytes(whole[:100])
    assert next(source).image is None  # its size is not known to be stable yet
    (tmp_path / "late.png").write_bytes(whole)
    assert next(source).image is None
    frame = next(source)
    assert frame.image is not None and frame.image.shape == (208, 224)
    stop.set()
    assert [frame.image for frame in source] == []


def looks(source, count):
    """Names of the pictures that come at so many looks, empty where none does."""
    frames = [next(source) for _ in range(count)]
    assert not any(frame.problem for frame in frames)
    return ["" if frame.image is None else Path(frame.name).name for frame in frames]


def test_a_file_that_is_written_again_is_a_new_frame_once_it_has_settled(tmp_path):
    """As of a camera that overwrites one file; pictures of the same size differ in their time only."""
    source, path = filling_folder(tmp_path, threading.Event()), tmp_path / "latest.bmp"
    for second in (1, 2, 3):
        cv2.imwrite(str(path), picture(f"{second}", 224, 208))
        os.utime(path, (second, second))
        assert looks(source, 4) == ["", "latest.bmp", "", ""], second
    path.write_bytes(path.read_bytes()[:1000])  # written anew, and not whole yet
    assert looks(source, 1) == [""]
    cv2.imwrite(str(path), picture("4", 224, 208))
    assert looks(source, 3) == ["", "latest.bmp", ""]


@pytest.mark.parametrize("renamed", [True, False])
def test_a_file_that_is_replaced_before_each_look_is_read_all_the_same(tmp_path, renamed):
    """A renamed picture has another inode, or the one of the picture before last: then only sizes tell."""
    source, path = filling_folder(tmp_path, threading.Event()), tmp_path / "latest.png"
    pictures = [cv2.imencode(".png", picture(f"{n}", 224, 208)[: 208 - 8 * (n % 3)])[1].tobytes() for n in range(12)]
    assert all(a != b for a, b in zip(map(len, pictures), map(len, pictures[1:]), strict=False))
    frames = []
    for content in pictures:
        if renamed:
            (tmp_path / ".new").write_bytes(content)
            (tmp_path / ".new").replace(path)
        else:
            path.write_bytes(content)
        frames.append(next(source))
    assert not any(frame.problem for frame in frames)
    read = [number for number, frame in enumerate(frames) if frame.image is not None]
    assert read == [2, 5, 8, 11] if renamed else len(read) >= 2
    assert all(frames[number].image.shape == (208 - 8 * (number % 3), 224) for number in read)


@pytest.mark.parametrize("anew", [True, False])
def test_a_file_that_is_written_slowly_again_and_again_is_never_read_half(tmp_path, anew):
    """In place, or removed and made anew; every part of it is another look."""
    source, path = filling_folder(tmp_path, threading.Event()), tmp_path / "slow.png"
    for number in range(6):
        content = cv2.imencode(".png", picture(f"{number}", 224, 208))[1].tobytes()
        if anew:
            path.unlink(missing_ok=True)
        for part in (3, 2, 1):
            with path.open("wb" if part == 3 else "ab") as file:
                file.write(content[len(content) * (3 - part) // 3 : len(content) * (4 - part) // 3])
            assert looks(source, 1) == [""], (number, part)
    assert looks(source, 1) == ["slow.png"]


def test_a_file_that_was_read_half_written_is_read_again_when_it_is_whole(tmp_path):
    source, path = filling_folder(tmp_path, threading.Event()), tmp_path / "slow.png"
    whole = cv2.imencode(".png", picture("slow", 224, 208))[1].tobytes()
    path.write_bytes(whole[: len(whole) // 2])
    first = [next(source) for _ in range(3)]
    assert [bool(frame.problem) for frame in first] == [False, True, False] and "slow.png: trunc" in first[1].problem
    path.write_bytes(whole)
    assert looks(source, 3) == ["", "slow.png", ""]


def test_videos_and_files_that_stay_empty_are_reported_once_each(tmp_path):
    source = filling_folder(tmp_path, threading.Event())
    film(tmp_path / "v.avi", 3)
    (tmp_path / "begun.png").touch()
    (tmp_path / "loop.png").symlink_to(tmp_path / "loop.png")
    problems = [frame.problem for frame in (next(source) for _ in range(12)) if frame.problem]
    assert problems[0].startswith(f"{tmp_path / 'v.avi'}: a video; of a folder only pictures are watched")
    assert problems[1:] == [f"{tmp_path / 'begun.png'}: empty file (0 bytes); copy or download the file again"]
    cv2.imwrite(str(tmp_path / "begun.png"), picture("begun", 224, 208))
    assert looks(source, 3) == ["", "begun.png", ""]


def test_names_that_come_again_are_new_frames(tmp_path):
    """As of a camera that stores a few files in turn, removing the oldest: also of the same size and time."""
    source, paths = filling_folder(tmp_path, threading.Event()), [tmp_path / name for name in ("a.bmp", "b.bmp")]
    for _ in range(2):
        for path in paths:
            cv2.imwrite(str(path), picture("same", 224, 208))
            os.utime(path, (1, 1))
            assert looks(source, 3) == ["", path.name, ""]
            path.unlink()
            assert looks(source, 1) == [""]


def test_a_folder_that_disappears_is_reported_once_and_watched_again(tmp_path):
    folder, stop = tmp_path / "share", threading.Event()
    folder.mkdir()
    source = filling_folder(folder, stop)
    assert not next(source).signal_lost
    folder.rmdir()
    lost = [next(source) for _ in range(3)]
    assert [frame.signal_lost for frame in lost] == [True, False, False]
    assert "cannot be listed" in lost[0].problem and not lost[1].problem
    folder.mkdir()
    cv2.imwrite(str(folder / "a.png"), picture("late", 224, 208))
    assert any(next(source).image is not None for _ in range(4))
    folder.joinpath("a.png").unlink()
    folder.rmdir()
    assert [next(source).signal_lost for _ in range(3)].count(True) == 1
    stop.set()


def test_a_video_played_as_a_stream_keeps_its_speed_and_drops_frames(tmp_path):
    path, stop, numbers = film(tmp_path / "v.avi", 20), threading.Event(), []
    start = time.monotonic()
    for frame in played_video(path, 5.0, stop):
        numbers.append(int(frame.name.split("#")[1]))
        time.sleep(0.35)  # slower than the frames come
    assert time.monotonic() - start > 1.5  # 20 frames at 10 per second
    assert numbers[0] == 0 and numbers == sorted(set(numbers)) and min(np.diff(numbers)) >= 2 and len(numbers) < 9


def test_a_lost_signal_is_reported_once(tmp_path):
    """A file stands for a device here: after its last frame it delivers nothing."""
    stop = threading.Event()
    frames = []
    for frame in live(str(film(tmp_path / "v.avi", 5)), "device", 100.0, stop):
        frames.append(frame)
        if frame.signal_lost:
            stop.set()
    assert [frame.signal_lost for frame in frames].count(True) == 1 and frames[-1].signal_lost
    assert frames[-1].problem


def test_frames_of_a_stream_carry_its_codec_and_quantiser(tmp_path):
    path, stop = tmp_path / "v.mkv", threading.Event()
    scene = np.repeat(picture("watch", 224, 208)[..., None], 3, axis=2)
    path.write_bytes(video_file([scene] * 5, "hevc", 30))
    for frame in live(str(path), "device", 100.0, stop):
        if frame.image is not None:
            stop.set()
            assert frame.coding.codec == "hevc" and 20 < frame.coding.quantiser < 45


def test_a_device_that_has_gone_silent_counts_as_idle(tmp_path):
    """A file stands for a device here: after its last frame it delivers nothing."""
    stop, analysis = threading.Event(), SimpleNamespace()
    loop = Watch("device", analysis, 5)
    loop._frame = lambda frame: None
    clock = threading.Timer(20.0, stop.set)
    clock.start()
    try:
        assert loop.run(live(str(film(tmp_path / "v.avi", 5)), "device", 100.0, stop), None, 0.5) == "idle"
    finally:
        stop.set()
        clock.cancel()


def test_files_that_cannot_be_used_are_not_idle_time(capsys, monkeypatch):
    """Each takes a second here; it stopped as idle among them, and later pictures were never read."""
    loop, nothing = Watch("folder", SimpleNamespace(), 5), [SourceFrame("folder", None)] * 9
    monkeypatch.setattr("pipeline.cli.watching.loop.time.monotonic", iter(range(99)).__next__)
    loop._frame = lambda frame: setattr(loop, "frames", 1)
    came = [*(SourceFrame(name, None, "truncated") for name in "abc"), SourceFrame("d", np.ones((9, 9)))]
    assert loop.run(iter(came + nothing), None, 2.5) == "idle" and (loop.set_aside, loop.frames) == (3, 1)


def coded(path, frames=5, interlaced=False, curve=None):
    """The panning scene by FFmpeg's encoder of H.264."""
    with av.open(str(path), "w") as container:
        options = {"flags": "+ilme+ildct", "x264-params": "tff=1"} if interlaced else {}
        stream = container.add_stream("libx264", rate=10, options=options)
        stream.width, stream.height, stream.pix_fmt = 224, 208, "yuv420p"
        if curve is not None:
            stream.codec_context.color_trc = curve
        for number in range(frames):
            image = np.roll(picture("watch", 224, 208), 5 * number, axis=1)
            frame = av.VideoFrame.from_ndarray(image, format="gray").reformat(format="yuv420p")
            if curve is not None:
                frame.color_trc = curve
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


@pytest.mark.parametrize("address", ["", "file://"])
def test_interlaced_frames_are_reported_once_and_never_measured(tmp_path, address):
    path = coded(tmp_path / "v.ts", interlaced=True)
    done, lines = watch(f"{address}{path}", "--rate", 5, "--idle-stop", 3)
    aside = [line["reason"] for line in lines if line["event"] == "set_aside"]
    assert len(aside) == 1 and "interlaced" in aside[0] and "ffmpeg -vf yadif" in aside[0]
    assert not [line for line in lines if line["event"] in ("frame", "alarm")] and lines[-1]["frames"] == 0
    assert len(done.stderr.splitlines()) == (0 if address else 1)  # a file that is damaged ends with an error


def test_a_stream_of_another_transfer_curve_is_measured_with_one_warning(tmp_path):
    path = coded(tmp_path / "v.ts", curve=18)
    for source in (f"file://{path}", path):
        done, lines = watch(source, "--frames", 1)
        assert done.stderr.count("its transfer curve is HLG (ARIB STD-B67), not that of sRGB") == 1
        assert lines[-1]["frames"] == 1


def test_it_runs_where_its_output_was_closed(monkeypatch):
    monkeypatch.setattr(sys, "stdout", None)  # as behind ``>&-``
    Watch("device", SimpleNamespace(), 5).emit("start")


VIOLATED, UNDECIDED, KEPT = ("noise", ""), ("", "noise"), ("", "")


def changes_of(seen, window, capsys):
    """Events but frames, each with the number of its frame; each frame by its alarms and undecided limits."""
    trend = SimpleNamespace(state=lambda: "learning", watched=(), drifts={})
    analysis = SimpleNamespace(trend_alarms=[], trends={"device 40x40": trend}, thresholds=Thresholds(0.1))
    loop = Watch("device", analysis, window)
    loop.state = SimpleNamespace(add=lambda row: {})
    for number, (alarms, undecided) in enumerate(seen):
        row = {**dict.fromkeys(STATED, 0.2), "picture": number, "alarms": alarms, "undecided": undecided}
        analysis.analyse = lambda *_, coding, row=row: (row, None)
        loop._frame(SourceFrame(str(number), np.zeros((40, 40), np.float32)))
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    return [(line["event"], line["picture"]) for line in lines if line["event"] != "frame"], loop


def test_an_alarm_stays_while_it_is_undecided(capsys):
    """Undecided frames between three good ones do not keep it for ever: the next violation is an event again."""
    seen = [VIOLATED, UNDECIDED, VIOLATED, UNDECIDED, KEPT, UNDECIDED, KEPT, UNDECIDED, KEPT, UNDECIDED, VIOLATED]
    changes, loop = changes_of(seen, 5, capsys)
    assert changes == [("alarm", 0), ("cleared", 8), ("alarm", 10)] and loop.alarms == 2


def test_a_value_about_its_threshold_does_not_flap(capsys):
    seen = [VIOLATED, KEPT, KEPT, VIOLATED, KEPT, VIOLATED, KEPT, KEPT, KEPT, KEPT, VIOLATED]
    changes, loop = changes_of(seen, 5, capsys)
    assert changes == [("alarm", 0), ("cleared", 8), ("alarm", 10)] and loop.alarms == 2


def test_every_kind_of_alarm_has_words():
    row = {"sigma_dn": 8.26, "mtf50_horizontal": 0.1996}
    limits = Thresholds(8.0, 0.2, True)
    assert alarm_words("noise", row, limits) == "noise 8.26 DN, above 8 DN"
    assert alarm_words("blur horizontal", row, limits) == "MTF50 horizontal 0.200, below 0.2 of Nyquist"
    assert alarm_words("over_exposed", row, limits) == "frame flagged over-exposed"


def test_a_reference_in_which_blur_changed_is_warned_of_once_and_a_trend_alarm_has_its_own_words(capsys):
    trend = ConditionTrend(100)
    analysis = SimpleNamespace(trend_alarms=[], trends={"device 40x40": trend}, thresholds=Thresholds())
    loop = Watch("device", analysis, 5)
    loop.state = SimpleNamespace(add=lambda row: {})
    draws = stream(0, "watch drift")
    for number in range(150):
        mtf = np.full((2, 8), 0.8 * np.exp(-0.005 * min(number, 100) + 0.01 * draws.standard_normal()))
        trend.step(2.0, mtf)
        row = {**dict.fromkeys(STATED, 0.2), "picture": number, "alarms": "", "undecided": ""}
        if number == 140:
            row["alarms"] = "trend noise"
            analysis.trend_alarms.append({"sequence": "device 40x40", "quantity": "noise", "words": "noise 2 to 9 DN"})
        analysis.analyse = lambda *_, coding, row=row: (row, None)
        loop._frame(SourceFrame(str(number), np.zeros((40, 40), np.float32)))
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    warnings = [line for line in lines if line["event"] == "warning"]
    assert [line["picture"] for line in warnings] == [99, 99]
    assert warnings[0]["reason"].startswith("no reliable trend, changed within the reference: blur horizontal: mean")
    frames = [line for line in lines if line["event"] == "frame"]
    assert frames[98]["trend_of"] == [] and frames[99]["trend_of"] == ["noise"]
    assert [line["words"] for line in lines if line["event"] == "alarm"] == ["noise 2 to 9 DN"]


def test_a_limit_that_no_frame_of_a_window_decides_is_stated_once(capsys):
    seen = [UNDECIDED, UNDECIDED, KEPT, *[UNDECIDED] * 6, KEPT, *[UNDECIDED] * 3]
    changes, _ = changes_of(seen, 3, capsys)
    assert changes == [("undecided", 5), ("undecided", 12)]


@pytest.mark.parametrize("source", ["absent", "97", "rtsp://127.0.0.1:9/none"])
def test_a_source_that_cannot_be_opened_is_one_line(source, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(main, ["watch", source, "--noise", "pca"])
    assert done.exit_code == 2 and done.stdout == ""  # nothing has started
    assert [line for line in done.output.splitlines() if line.startswith("error: ")] and "Traceback" not in done.output
