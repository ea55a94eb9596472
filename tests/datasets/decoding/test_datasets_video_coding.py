"""How frames of a video were stored: quantisers are those that the encoder was set to."""

from __future__ import annotations

import contextlib
from pathlib import Path
from types import SimpleNamespace

import av
import numpy as np
import pytest
from data_makers import picture

from pipeline.camera.processing.codec import VIDEO, video_file
from pipeline.datasets.decoding import video_coding
from pipeline.datasets.decoding.video import read_video
from pipeline.datasets.decoding.video_coding import RECENT_FRAMES, Coding, Quantisers
from pipeline.datasets.decoding.video_decoder import Decoder

FRAMES = 6


def film(path: Path, name: str, quality: int = 20, frames: int = FRAMES) -> Path:
    """A panning scene; a Matroska file."""
    scene = np.repeat(picture("coding", 320, 240)[..., None], 3, axis=2)
    path.write_bytes(video_file([np.roll(scene, 3 * number, axis=1) for number in range(frames)], name, quality))
    return path


def hevc(path: Path, options: str, container: str | None = None, pixels: str = "yuv420p") -> Path:
    with av.open(str(path), "w", format=container) as output:
        stream = output.add_stream("libx265", rate=25, options={"x265-params": f"log-level=none:pools=none:{options}"})
        stream.width, stream.height, stream.pix_fmt = 320, 240, pixels
        for number in range(FRAMES):
            shifted = np.roll(picture("coding", 320, 240), 3 * number, axis=1)
            output.mux(stream.encode(av.VideoFrame.from_ndarray(shifted, format="gray").reformat(format=pixels)))
        output.mux(stream.encode())
    return path


def codings(path: Path) -> list[Coding]:
    return [coding for *_, coding in read_video(path)]


# ipratio and pbratio of 1: key frames and those predicted both ways take the quantiser of the others
FIXED = "ipratio=1:pbratio=1:aq-mode=0"


@pytest.mark.parametrize("quantiser", [0, 22, 37, 51])
@pytest.mark.parametrize(("suffix", "pixels"), [("mkv", "yuv420p"), ("ts", "yuv420p"), ("mkv", "yuv420p10le")])
def test_a_fixed_quantiser_of_hevc_is_read(tmp_path, quantiser, suffix, pixels):
    path = hevc(tmp_path / f"a.{suffix}", f"qp={quantiser}:{FIXED}", pixels=pixels)
    assert codings(path) == [Coding("hevc", quantiser)] * FRAMES


def test_frames_of_finer_quantisers_count_as_the_coarsest_of_those_near(tmp_path):
    path = hevc(tmp_path / "a.mkv", "qp=30:ipratio=1.4:pbratio=1.3:bframes=2:aq-mode=0")
    quantisers = [coding.quantiser for coding in codings(path)]
    assert quantisers[-1] == max(quantisers) > 30


@pytest.mark.parametrize("step", [4, 30, 63])
def test_the_quantiser_of_vp8_grows_with_the_encoders(tmp_path, step):
    quantisers = {coding.quantiser for coding in codings(film(tmp_path / "a.mkv", "vp8", step))}
    assert quantisers == {{4: 4, 30: 39, 63: 127}[step]}  # libvpx, quantizer_to_qindex


@pytest.mark.parametrize("name", ["vp9", "av1"])
def test_coarser_vp9_and_av1_have_greater_quantisers(tmp_path, name):
    fine, coarse = (codings(film(tmp_path / f"{quality}.mkv", name, quality))[-1] for quality in (20, 55))
    assert fine.codec == coarse.codec == name
    assert 0 < fine.quantiser < coarse.quantiser <= 255


@pytest.mark.parametrize("quantiser", [12, 28, 51])
def test_a_fixed_quantiser_of_h264_is_read(tmp_path, quantiser):
    path = tmp_path / "a.mp4"
    with av.open(str(path), "w") as output:
        stream = output.add_stream("libx264", rate=25, options={"x264-params": f"qp={quantiser}:ipratio=1:pbratio=1"})
        stream.width, stream.height, stream.pix_fmt = 320, 240, "yuv420p"
        for _ in range(FRAMES):
            grey = av.VideoFrame.from_ndarray(picture("coding", 320, 240), format="gray")
            output.mux(stream.encode(grey.reformat(format="yuv420p")))
        output.mux(stream.encode())
    assert codings(path) == [Coding("h264", quantiser)] * FRAMES


@pytest.mark.parametrize("name", ["mpeg4", "mjpeg"])
def test_other_codecs_have_none(tmp_path, name):
    assert codings(film(tmp_path / "a.mkv", name, 4)) == [Coding(name)] * FRAMES


def test_only_recent_frames_count(tmp_path, monkeypatch):
    monkeypatch.setattr(video_coding, "RECENT_FRAMES", 2)
    path = hevc(tmp_path / "a.mkv", "qp=30:ipratio=0.7:bframes=0:keyint=100:aq-mode=0")
    quantisers = [coding.quantiser for coding in codings(path)]
    assert quantisers[0] > quantisers[-1] == 30 and RECENT_FRAMES > 2


@pytest.mark.parametrize("name", sorted(VIDEO))
def test_frames_and_messages_are_those_without_reading_quantisers(tmp_path, monkeypatch, name):
    path = film(tmp_path / "a.mkv", name)
    content = bytearray(path.read_bytes())
    content[len(content) // 2 : len(content) // 2 + 40] = bytes(40)
    path.write_bytes(content)

    def read() -> tuple[list[np.ndarray], list[str]]:
        with contextlib.closing(Decoder(path)) as decoder:
            pixels = [frame.to_ndarray(format="gray") for frame in iter(decoder.read, None)]
            return pixels, decoder.messages

    level = av.logging.get_level()
    (frames, messages), after = read(), av.logging.get_level()
    monkeypatch.setattr(video_coding, "CODECS", ())
    plain, expected = read()
    assert len(frames) == len(plain) and all(map(np.array_equal, frames, plain))
    assert len(messages) == len(expected) and level in (after, None)


def test_without_the_filter_quantisers_are_unknown(tmp_path, monkeypatch):
    path = film(tmp_path / "a.mkv", "hevc")
    monkeypatch.setattr(video_coding, "FILTER", "no_such_filter")
    assert codings(path) == [Coding("hevc")] * FRAMES


def test_the_quantiser_of_a_slice_is_that_of_its_parameter_set_and_the_coarsest_slice_counts(monkeypatch):
    sets = [("pic_parameter_set_id", 0), ("pic_init_qp_minus26", 4), ("pic_parameter_set_id", 1)]
    sets += [("pic_init_qp_minus26", -6)]
    slices = [("slice_pic_parameter_set_id", 0), ("slice_qp_delta", 3), ("slice_pic_parameter_set_id", 1)]
    slices += [("slice_qp_delta", 2)]
    quantisers = Quantisers(None, "mpeg4")
    assert quantisers._stated(sets) == [] and quantisers._stated(slices) == [33, 22]
    monkeypatch.setattr(video_coding, "_header_fields", lambda: contextlib.nullcontext(slices))
    quantisers._filter = SimpleNamespace(filter=lambda packet: None)
    quantisers.add(SimpleNamespace(size=1))
    assert quantisers.coarsest == 33
