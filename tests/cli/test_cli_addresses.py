"""Addresses of streams: no password in them is printed, by any command."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from pipeline.cli import main
from pipeline.cli.addresses import without_credentials
from pipeline.datasets.decoding.video_decoder import BadVideo


@pytest.mark.parametrize(
    ("source", "printed"),
    [
        ("rtsp://user:secret@camera:554/1", "rtsp://camera:554/1"),
        ("rtsp://user:sec@ret@camera/1", "rtsp://camera/1"),
        ("http://camera/2@2x.m3u8?at=a@b", "http://camera/2@2x.m3u8?at=a@b"),
        ("http://camera?at=a@b", "http://camera?at=a@b"),
        ("folder/a@b", "folder/a@b"),
        ("0", "0"),
        ("failed: 'http://user:secret@camera/0.ts' by a@b", "failed: 'http://camera/0.ts' by a@b"),
        ("rtsp://camera/?user=me&password=secret&channel=1", "rtsp://camera/?user=***&password=***&channel=1"),
        ("rtsp://me:secret@camera/1?loginpas=secret#t", "rtsp://camera/1?loginpas=***#t"),
        ("http://camera/v.cgi?USR=me&Pwd=sec/r?et", "http://camera/v.cgi?USR=***&Pwd=***"),
        ("http://camera/?stream=1&u=me&p=secret", "http://camera/?stream=1&u=***&p=***"),
        ("rtsp://camera/user=me_password=secret_channel=1.sdp", "rtsp://camera/user=***"),
        ("http://camera/?access_token=secret and ?password=b", "http://camera/?access_token=*** and ?password=b"),
        ("http://camera/?fps=5&group=a&step=2", "http://camera/?fps=5&group=a&step=2"),
        ("rtsp:/me:secret@camera/1", "rtsp:/camera/1"),
        ("C:/a@b", "C:/a@b"),
        ("me:sec:r@t@camera/1: absent", "me:***@camera/1: absent"),
        ("rtsp://camera:554/1?at=a:b@c", "rtsp://camera:554/1?at=a:b@c"),
        ("error: a@b", "error: a@b"),
    ],
)
def test_an_address_is_printed_without_user_name_and_password(source, printed):
    assert without_credentials(source) == printed


def test_the_password_of_an_address_is_in_no_error():
    done = CliRunner().invoke(main, ["watch", "rtsp://user:secret@127.0.0.1:9/none", "--noise", "pca"])
    assert done.exit_code == 2 and "secret" not in done.output and "127.0.0.1:9/none: cannot be opened" in done.output


def test_the_password_of_a_part_of_a_stream_is_in_no_error(monkeypatch):
    def refuse(address, **options):  # as FFmpeg states it
        raise BadVideo(address, "Error when loading first segment 'http://user:secret@camera/0.ts'")

    monkeypatch.setattr("pipeline.datasets.decoding.video_decoder.Decoder", refuse)
    done = CliRunner().invoke(main, ["watch", "http://user:secret@camera/list.m3u8", "--noise", "pca"])
    assert done.exit_code == 2 and "secret" not in done.output and "segment 'http://camera/0.ts'" in done.output


def test_the_password_of_an_address_is_in_no_line(monkeypatch):
    monkeypatch.setattr("pipeline.cli.watching.sources.live", lambda *arguments: iter(()))
    done = CliRunner().invoke(main, ["watch", "rtsp://user:secret@camera/1", "--noise", "pca"])
    assert done.exit_code == 0 and "secret" not in done.output and '"source": "rtsp://camera/1"' in done.output


ADDRESSES = ["rtsp://me:secret@camera/1", "rtsp://camera/?user=me&password=secret", "rtsp:/me:secret@camera/1"]


@pytest.mark.parametrize("address", ADDRESSES)
@pytest.mark.parametrize("command", [["health"], ["noise"], ["health", "a.png", "--out"]])
def test_commands_that_take_files_refuse_an_address_without_its_password(command, address):
    done = CliRunner().invoke(main, [*command, address])
    assert done.exit_code == 2 and "secret" not in done.output
    assert "an address; name a file or folder. camera-monitor watch reads streams" in done.output


@pytest.mark.parametrize("address", ADDRESSES)
@pytest.mark.parametrize("command", [[], ["dataset"], ["record"], ["watch", "0", "--rate"], ["noise", ".", "--noise"]])
def test_an_address_in_another_place_of_a_command_is_in_its_error_without_its_password(command, address):
    done = CliRunner().invoke(main, [*command, address])
    assert done.exit_code == 2 and "camera/" in done.output and "secret" not in done.output


@pytest.mark.parametrize("command", ["watch", "health", "noise"])
def test_an_address_without_protocol_is_refused_without_its_password(command):
    done = CliRunner().invoke(main, [command, "me:secret@camera/1"])
    assert done.exit_code == 2 and "me:***@camera/1" in done.output and "secret" not in done.output


def test_an_address_of_one_slash_is_refused_without_its_password():
    done = CliRunner().invoke(main, ["watch", "rtsp:/me:secret@camera/1"])
    assert done.exit_code == 2 and "error: rtsp:/camera/1: neither a camera index" in done.output
