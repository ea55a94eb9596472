"""Names of the sources of ``camera-monitor watch``."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from pipeline.cli import main
from pipeline.cli.watch_sources import without_credentials


@pytest.mark.parametrize(
    ("source", "printed"),
    [
        ("rtsp://user:secret@camera:554/1", "rtsp://camera:554/1"),
        ("rtsp://user:sec@ret@camera/1", "rtsp://camera/1"),
        ("http://camera/2@2x.m3u8?at=a@b", "http://camera/2@2x.m3u8?at=a@b"),
        ("http://camera?at=a@b", "http://camera?at=a@b"),
        ("folder/a@b", "folder/a@b"),
        ("0", "0"),
    ],
)
def test_an_address_is_printed_without_user_name_and_password(source, printed):
    assert without_credentials(source) == printed


def test_the_password_of_an_address_is_in_no_error():
    done = CliRunner().invoke(main, ["watch", "rtsp://user:secret@127.0.0.1:9/none", "--noise", "pca"])
    assert done.exit_code == 2 and "secret" not in done.output and "127.0.0.1:9/none: cannot be opened" in done.output


def test_the_password_of_an_address_is_in_no_line(monkeypatch):
    monkeypatch.setattr("pipeline.cli.watch_sources.live", lambda *arguments: iter(()))
    done = CliRunner().invoke(main, ["watch", "rtsp://user:secret@camera/1", "--noise", "pca"])
    assert done.exit_code == 0 and "secret" not in done.output and '"source": "rtsp://camera/1"' in done.output
