"""Files and folders that commands are given: order, formats, names and orientation of their pictures."""

from __future__ import annotations

import json
import os
import threading
from collections import Counter
from pathlib import Path

import av
import cv2
import numpy as np
import pillow_heif
import pytest
from click.testing import CliRunner, Result
from data_makers import picture
from heif_makers import heic
from PIL import Image, features

from pipeline.cli import main
from pipeline.cli.frames.given_files import expand, natural_order
from pipeline.cli.frames.picture_file import coding_of_picture
from pipeline.cli.frames.pictures import read, readable, refuse
from pipeline.cli.frames.remarks import TURNED
from pipeline.cli.frames.shot_settings import exif
from pipeline.cli.options.video_codec import NAMED
from pipeline.cli.watching.folder import filling_folder
from pipeline.condition.video_codecs import HIDDEN
from pipeline.datasets.decoding.video_coding import UNKNOWN
from pipeline.errors import InputError


def call(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def save(path: Path, orientation: int | None = None) -> Path:
    tags = Image.Exif()
    if orientation is not None:
        tags[0x0112] = orientation
    Image.fromarray(picture("order", 224, 208)).save(path, **({"exif": tags} if orientation else {}))
    return path


def test_names_with_numbers_are_in_the_order_of_the_numbers() -> None:
    names = ["0.png", "01.png", "1.png", "2.png", "10.png", "100.png", "a-2-b9.png", "a-2-b10.png", "a-10-b1.png", "b"]
    assert sorted(sorted(names, reverse=True), key=natural_order) == names
    assert sorted(["x²3", "x3", "x١"], key=natural_order) == ["x3", "x²3", "x١"]  # digits of ASCII only


def test_a_folder_is_taken_in_the_order_of_its_numbers_and_paths_as_they_come(tmp_path: Path) -> None:
    for number in range(12):
        (tmp_path / f"{number}.png").touch()
    assert [file.stem for file in expand([tmp_path])] == [str(number) for number in range(12)]
    assert [file.stem for file in expand([tmp_path / "10.png", tmp_path / "9.png"])] == ["10", "9"]


def test_pictures_that_come_at_the_same_time_are_watched_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    for number in (10, 9, 100):
        cv2.imwrite(str(tmp_path / f"{number}.png"), picture("order", 224, 208))
        os.utime(tmp_path / f"{number}.png", (1e9, 1e9))
    stop, names = threading.Event(), []
    for frame in filling_folder(tmp_path, stop):
        names += [Path(frame.name).stem] if frame.image is not None else []
        if len(names) == 3:
            stop.set()
    assert names == ["9", "10", "100"]


AVIF = pytest.mark.skipif(not features.check("avif"), reason="AVIF: this Pillow was built without it")


@pytest.mark.parametrize("suffix", [".gif", ".jp2", ".GIF", ".jfif", ".pnm", ".tga", pytest.param(".avif", marks=AVIF)])
def test_formats_that_can_be_read_are_taken_of_a_folder_too(tmp_path: Path, suffix: str) -> None:
    file = save(tmp_path / f"a{suffix}")
    (tmp_path / "notes.txt").write_text("no picture")
    done = call("noise", tmp_path, "--estimator", "pca")
    assert done.exit_code == 0 and str(file) in done.stdout, done.output


def test_of_a_folder_of_folders_the_error_names_one(tmp_path: Path) -> None:
    for name in ("b", "a", ".hidden"):
        (tmp_path / name).mkdir()
    with pytest.raises(InputError, match=f"no pictures in {tmp_path}, whose sub-folders are not searched: name them"):
        expand([tmp_path])
    with pytest.raises(InputError, match=f"name them, as {tmp_path / 'a'}; expected .3gp"):
        expand([tmp_path])
    with pytest.raises(InputError, match=f"no pictures in {tmp_path / 'a'}; expected"):
        expand([tmp_path / "a"])


def test_formats_that_are_not_read_are_counted_in_a_folder_and_refused_by_name(tmp_path: Path) -> None:
    save(tmp_path / "a.png")
    for name in ("b.cr3", "c.CR3", "d.dng", "._d.dng", "notes.txt"):
        (tmp_path / name).write_bytes(b"\0\0\0\x18ftyp")
    done = call("noise", tmp_path, "--estimator", "pca")
    assert done.exit_code == 0
    assert f"{tmp_path}: left out 2 .cr3, 1 .dng; these formats are not read" in done.stderr
    done = call("noise", tmp_path / "c.CR3", "--estimator", "pca")
    assert done.exit_code != 0 and "c.CR3: .CR3 files are not read; convert it" in done.stderr


def test_what_is_named_like_a_format_that_is_not_read_and_is_no_file_is_passed_over(tmp_path: Path) -> None:
    save(tmp_path / "a.png")
    (tmp_path / "b.dng").mkdir()
    os.mkfifo(tmp_path / "c.dng")
    done = call("noise", tmp_path, "--estimator", "pca")
    assert done.exit_code == 0 and "left out" not in done.stderr, done.output


def test_pipes_and_folders_named_like_pictures_are_left_out_with_a_warning(tmp_path: Path) -> None:
    save(tmp_path / "a.png")
    (tmp_path / "b.png").mkdir()
    os.mkfifo(tmp_path / "c.png")
    (tmp_path / "d.png").symlink_to(tmp_path / "gone.png")
    assert expand([tmp_path]) == [tmp_path / "a.png", tmp_path / "d.png"]  # of the link, its reader states the reason
    (tmp_path / "d.png").unlink()
    done = call("noise", tmp_path, "--estimator", "pca")
    assert done.exit_code == 0, done.output
    for name in ("b.png", "c.png"):
        assert f"warning: {tmp_path / name}: left out, it is a folder, pipe or device and no file" in done.stderr


def test_a_format_that_is_not_read_is_named_by_the_simulated_camera_too(tmp_path: Path) -> None:
    (tmp_path / "c.dng").write_bytes(b"II*\0")
    done = call("corrupt", tmp_path / "c.dng", "--out", tmp_path / "out", "--pipeline", "phone")
    assert done.exit_code != 0 and "c.dng: .dng files are not read; convert it" in done.stderr


def test_a_jpeg_that_is_named_like_a_format_that_is_not_read_is_read(tmp_path: Path) -> None:
    file = save(tmp_path / "a.jpg").rename(tmp_path / "a.dng")
    (tmp_path / "b.dng").write_bytes(b"II*\0")
    done = call("noise", tmp_path, "--estimator", "pca")
    assert done.exit_code == 0 and str(file) in done.stdout, done.output
    assert "left out 1 .dng" in done.stderr


@pytest.mark.parametrize(
    "command",
    [("health",), ("noise",), ("corrupt", "--out", "out"), ("corrupt", "--out", "out", "--pipeline", "phone")],
)
def test_a_name_that_is_not_utf_8_is_set_aside_and_the_others_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    folder = Path("in")
    folder.mkdir()
    good = save(folder / "good.png")
    save(folder / "x.png").rename(folder / os.fsdecode(b"bad\xff.png"))
    more = ("--out", "out", "--no-trend") if command == ("health",) else ()
    done = call(*command, folder, *more)
    assert done.exit_code == 2, done.exception
    lines = done.stderr.splitlines()
    assert lines[0] == "set aside: in/bad\\udcff.png: its name is not valid UTF-8; rename it" and len(lines[1:]) <= 2
    assert str(good) in done.stdout
    if more:
        content = json.loads((tmp_path / "out/health.json").read_text())
        assert len(content["pictures"]) == 1 and "bad\\udcff.png" in content["set_aside"][0]


def test_a_locale_without_utf_8_is_named_and_not_the_file(tmp_path: Path) -> None:
    name = os.fsdecode("straße.png".encode()).encode("utf-8", "surrogateescape").decode("ascii", "surrogateescape")
    with pytest.raises(InputError, match="set PYTHONUTF8=1"):
        refuse(tmp_path / name)


@pytest.mark.parametrize("command", [("health",), ("noise",), ("advise",), ("corrupt", "--out", "out")])
def test_an_empty_path_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]) -> None:
    monkeypatch.chdir(tmp_path)
    save(tmp_path / "a.png")
    done = call(*command, "")
    assert done.exit_code == 2 and "path is empty" in done.output and len(done.output.splitlines()) == 1
    assert [file.name for file in tmp_path.iterdir()] == ["a.png"]


@pytest.mark.parametrize("suffix", ["jpg", "png", "webp"])
def test_pictures_stored_turned_are_pointed_out_once(tmp_path: Path, suffix: str) -> None:
    for name, orientation in (("a", None), ("b", 1), ("c", 6), ("d", 8)):
        save(tmp_path / f"{name}.{suffix}", orientation)
    done = call("health", tmp_path)
    assert done.exit_code == 0, done.output
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("warning: ")]
    assert line.startswith(f"warning: {tmp_path / f'c.{suffix}'}: stored turned or mirrored (orientation 6)")
    assert "Pictures and videos stored turned or mirrored (by their metadata): 2;" in done.stdout
    assert "warning" not in call("noise", tmp_path / f"a.{suffix}", tmp_path / f"b.{suffix}").stderr


@pytest.mark.parametrize("suffix", ["png", "webp", "tiff"])
def test_transparent_pixels_are_pointed_out_once_and_opaque_ones_are_not(tmp_path: Path, suffix: str) -> None:
    with Image.open(save(tmp_path / "plain.png")) as opened:
        picture = opened.convert("RGBA")
    (tmp_path / "plain.png").unlink()
    for name, alpha in (("a", 255), ("b", 254), ("c", 0)):
        picture.putpixel((3, 4), (*picture.getpixel((3, 4))[:3], alpha))
        picture.save(tmp_path / f"{name}.{suffix}", **({"lossless": True, "exact": True} if suffix == "webp" else {}))
    done = call("health", tmp_path)
    assert done.exit_code == 0, done.output
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("warning: ")]
    assert line.startswith(f"warning: {tmp_path / f'b.{suffix}'}: has transparent pixels")
    assert "Pictures with transparent pixels: 2;" in done.stdout
    assert "warning" not in call("noise", tmp_path / f"a.{suffix}").stderr
    indexed = picture.convert("P")
    indexed.save(tmp_path / "indexed.png", transparency=indexed.getpixel((0, 0)))
    assert "has transparent pixels" in call("noise", tmp_path / "indexed.png").stderr


def test_pictures_and_videos_are_read_as_stored_whatever_their_metadata_ask_for(tmp_path: Path) -> None:
    """So that rows of the sensor stay rows, and labels fit; each is pointed out."""
    plain = next(read(save(tmp_path / "plain.png")))[1]
    for suffix in ("jpg", "png", "webp", "tiff"):
        file = save(tmp_path / f"a.{suffix}", 6)
        hinted: Counter[int] = Counter()
        (frame,) = [image for _, image, _ in read(file, hinted=hinted)]
        assert hinted == {TURNED: 1} and frame.shape == plain.shape
        assert suffix in ("jpg", "webp") or np.array_equal(frame, plain)
    done = call("noise", tmp_path / "a.tiff", "--estimator", "pca")
    assert done.exit_code == 0 and "stored turned or mirrored (orientation 6)" in done.stderr, done.output


def film(path: Path, curve: int = 2) -> Path:
    """Three frames of H.264 with a transfer curve of ITU-T H.273."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=10)
        stream.width, stream.height, stream.pix_fmt = 224, 208, "yuv420p"
        stream.codec_context.color_trc = curve
        for number in range(3):
            image = np.roll(picture("order", 224, 208), number, axis=1)
            frame = av.VideoFrame.from_ndarray(image, format="gray").reformat(format="yuv420p")
            frame.color_trc = curve
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def turned(source: Path, path: Path) -> Path:
    """A copy of a video whose header asks for a turn by 90 degrees."""
    content = bytearray(source.read_bytes())
    begin = content.index(b"tkhd") + 44
    matrix = (0, 65536, 0, -65536, 0, 0, 208 << 16, 0, 1 << 30)
    content[begin : begin + 36] = b"".join(value.to_bytes(4, signed=True) for value in matrix)
    path.write_bytes(content)
    return path


def test_turned_videos_are_counted_and_pointed_out_once(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    hinted: Counter[int] = Counter()
    source = film(tmp_path / "a.mp4")
    plain = [image for _, image, _ in read(source, hinted=hinted)]
    assert not hinted and capfd.readouterr().err == ""
    for name in ("b", "c"):
        stored = [image for _, image, _ in read(turned(source, tmp_path / f"{name}.mp4"), hinted=hinted)]
        assert np.array_equal(stored, plain)
    assert hinted == {TURNED: 2}
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith(f"warning: {tmp_path / 'b.mp4'}: stored turned or mirrored (rotation 270 degrees)")


def test_a_transfer_curve_unlike_that_of_pictures_is_pointed_out(tmp_path: Path) -> None:
    done = call("noise", film(tmp_path / "a.mp4", curve=16), "--estimator", "pca")
    assert done.exit_code == 0, done.output
    assert done.stderr.count("its transfer curve is PQ (SMPTE ST 2084), not that of sRGB or BT.709") == 1


def test_watch_points_turned_pictures_out(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    file = save(tmp_path / "in/a.jpg", 3)
    done = call("watch", tmp_path / "in", "--idle-stop", 0.5, "--noise", "pca")
    assert f"warning: {file}: stored turned" in done.stderr and '"event": "frame"' in done.stdout


@pytest.mark.parametrize(("encoder", "name"), [("libx265", "hevc"), ("libx264", "h264")])
def test_the_codec_of_a_video_decides_whether_weak_noise_is_estimated(tmp_path: Path, encoder: str, name: str) -> None:
    path = tmp_path / "drive#1.mkv"  # the writer of MP4 refuses HEVC now and then
    with av.open(str(path), "w") as container:
        track = container.add_stream(encoder, rate=25, options={"crf": "28", "x265-params": "log-level=none"})
        track.width, track.height, track.pix_fmt = 448, 320, "yuv420p"
        for _ in range(2):
            frame = av.VideoFrame.from_ndarray(picture("codec"), format="gray").reformat(format="yuv420p")
            container.mux(track.encode(frame))
        container.mux(track.encode())
    codings = [coding for *_, coding in readable([path])]
    assert [coding.codec for coding in codings] == [name] * 2
    assert codings[-1].quantiser > 20
    bounds = []
    for command in (("noise",), ("health", "--no-trend", "--jsonl"), ("watch", "--no-wait", "--frames", "1")):
        done = call(command[0], path, *command[1:])
        assert done.exit_code == 0, done.output
        text = done.stdout.splitlines()[1 if command[0] != "health" else 0]
        bounds.append(float(text.split()[1]) if command[0] == "noise" else json.loads(text)["sigma_at_most_dn"])
    assert max(bounds) - min(bounds) < 0.01
    assert (bounds[0] >= 6.0) == (name == "hevc")
    rows = [json.loads(line) for line in call("health", "--no-trend", "--jsonl", path).stdout.splitlines()]
    assert [(row["codec"], row["quantiser"]) for row in rows] == [(name, coding.quantiser) for coding in codings]


def test_the_codec_of_pictures_taken_out_of_a_video_can_be_given(tmp_path: Path) -> None:
    save(tmp_path / "a.png")
    assert set(NAMED) == {codec for codec, hidden in HIDDEN.items() if not hidden.shows}
    for command in (("noise",), ("health", "--no-trend", "--jsonl"), ("watch", "--no-wait", "--frames", "1")):
        source = tmp_path if command[0] == "watch" else tmp_path / "a.png"
        known = []
        for codec in ((), ("--codec", "hevc")):
            done = call(command[0], source, *command[1:], *codec)
            assert done.exit_code == 0, done.output
            text = done.stdout.splitlines()[1 if command[0] != "health" else 0]
            known.append(text.split()[0] != "-" if command[0] == "noise" else json.loads(text)["sigma_dn"] is not None)
        assert known == [True, False]
    assert call("noise", tmp_path / "a.png", "--codec", "h264").exit_code == 2


@AVIF
def test_pictures_in_avif_files_are_known_to_be_coded_by_av1(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save(tmp_path / "a.avif")
    save(tmp_path / "a.png").rename(tmp_path / "b.avif")  # by what is in the file, not by its name
    known, *others = (coding_of_picture(tmp_path / name) for name in ("a.avif", "b.avif", "absent.avif"))
    assert known.codec == "av1" and known.quantiser is not None and others == [UNKNOWN, UNKNOWN]
    Image.open(tmp_path / "a.avif").save(tmp_path / "coarse.avif", quality=20)
    coarse = coding_of_picture(tmp_path / "coarse.avif").quantiser
    assert coarse is not None and known.quantiser < coarse < 256
    data = (tmp_path / "a.avif").read_bytes()
    (tmp_path / "mif1.avif").write_bytes(data[:8] + b"mif1" + data[12:])  # as some programs begin them
    assert [coding for *_, coding in read(tmp_path / "mif1.avif")] == [known]
    monkeypatch.setattr(Image, "ID", list(Image.ID))
    monkeypatch.setattr(Image, "OPEN", dict(Image.OPEN))
    pillow_heif.register_heif_opener()  # as imageio does
    Image.ID.insert(0, Image.ID.pop(Image.ID.index("HEIF")))  # in a process that begins with it
    assert [coding for *_, coding in read(tmp_path / "mif1.avif")] == [known]
    answers = [call("noise", tmp_path / name).stdout.splitlines()[1].split()[0] for name in ("a.avif", "b.avif")]
    assert answers[0] == "-" and float(answers[1]) >= 0


def heif(path: Path, quantiser: int = -1, **options: object) -> Path:
    path.write_bytes(heic(np.dstack([picture("order", 224, 208)] * 3), quantiser, **options))
    return path


def test_heif_pictures_are_read_by_what_is_in_them_and_answered_like_others(tmp_path: Path) -> None:
    heif(tmp_path / "a.heic", tiles=2, display=[(b"irot", 3)])
    heif(tmp_path / "b.jpg")
    with_its_pixels = tmp_path / "c.png"
    cv2.imwrite(str(with_its_pixels), picture("order", 224, 208))
    done = call("noise", tmp_path)
    assert done.exit_code == 0, done.output
    rows = [line.split() for line in done.stdout.splitlines()[1:]]
    assert [row[-1] for row in rows] == [str(tmp_path / name) for name in ("a.heic", "b.jpg", "c.png")]
    assert abs(float(rows[0][0]) - float(rows[2][0])) < 0.3 and rows[0][:-1] == rows[1][:-1]
    assert "a.heic: stored turned or mirrored (rotation 270 degrees)" in done.stderr


def test_what_a_heif_picture_may_hide_goes_by_its_quantiser(tmp_path: Path) -> None:
    for name, quantiser in (("coarse.heic", 43), ("fine.heic", 8)):
        heif(tmp_path / name, quantiser)
    assert [coding_of_picture(tmp_path / name).quantiser for name in ("coarse.heic", "fine.heic")] == [40, 5]
    done = call("health", tmp_path, "--no-trend", "--jsonl")
    assert done.exit_code == 0, done.output
    coarse, fine = (json.loads(line) for line in done.stdout.splitlines()[:2])
    assert (coarse["codec"], coarse["quantiser"], coarse["sigma_dn"]) == ("hevc", 40, None)
    assert coarse["sigma_at_most_dn"] > 8 and fine["sigma_dn"] is not None


def test_exposure_and_iso_of_heif_pictures_are_those_of_their_exif_data(tmp_path: Path) -> None:
    tags = Image.Exif()
    tags.get_ifd(0x8769).update({33434: 0.004, 34855: 800})
    assert exif(heif(tmp_path / "a.heic", exif=tags.tobytes()[6:])) == pytest.approx((0.004, 800))
    assert exif(heif(tmp_path / "b.heic")) == (None, None)


def test_a_transfer_curve_far_from_that_of_srgb_is_pointed_out_once(tmp_path: Path) -> None:
    for name in "ab":
        heif(tmp_path / f"{name}.hif", transfer=16)
    done = call("health", tmp_path, "--no-trend", "--out", tmp_path / "out")
    assert done.exit_code == 0 and done.stderr.count("its transfer curve is PQ (SMPTE ST 2084)") == 1, done.output
    assert "Pictures whose transfer curve is far from those of sRGB and BT.709: 2" in done.output


@pytest.mark.parametrize("options", [("--pipeline", "phone"), ("--noise-source", "readout", "--sigma-dn", "10")])
def test_heif_pictures_are_corrupted_too(tmp_path: Path, options: tuple[str, ...]) -> None:
    file = heif(tmp_path / "a.heic", display=[(b"irot", 1)])
    done = call("corrupt", file, "--out", tmp_path / "out", *options)
    assert done.exit_code == 0, done.output
    (result,) = (tmp_path / "out").glob("a*.png")
    assert cv2.imread(str(result)).shape[:2] == (208, 224)


def test_a_damaged_heif_picture_is_set_aside_and_the_others_go_on(tmp_path: Path) -> None:
    data = heif(tmp_path / "a.heic").read_bytes()
    (tmp_path / "b.heic").write_bytes(data[: len(data) // 2])
    done = call("noise", tmp_path)
    assert done.exit_code != 0 and "b.heic: a HEIF picture that cannot be decoded (" in done.stderr
    assert "a.heic" in done.stdout
