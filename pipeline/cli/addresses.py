"""Addresses of streams: how they are told from files, and printed without passwords."""

from __future__ import annotations

import re

ADDRESS_MARK = "://"
HIDDEN = "***"
_ADDRESS = re.compile(r"[a-z][a-z0-9+.-]+:/\S+", re.IGNORECASE)  # also with one slash, as by mistake
_CREDENTIALS = re.compile(r"(?<=:/)(/?)[^/?#]*@")
_WITHOUT_PROTOCOL = re.compile(r"(?<![\w/:.@+=&?-])([\w.+-]+):[^\s/?#]+@(?=[\w.-])")
"""User name and password before a host, of an address whose protocol was forgotten."""

_SECRET = re.compile(
    r"(?<=[?&;/_])([\w.-]*(?:user|usr|login|pass|pwd|psw|token|secret|auth|key|cred|sign)[\w.-]*|u|p|pw|sig)=[^&;#]*",
    re.IGNORECASE,
)
"""Parameters of an address that hold a user name, a password or a key, as cameras name them."""


def begins_as_address(text: str) -> bool:
    """Whether a text begins with a protocol (``rtsp://...``), also with one slash, as by mistake."""
    return _ADDRESS.match(text) is not None


def without_credentials(text: str) -> str:
    """A text as it may be printed: the addresses in it without user name and password.

    Those before the host are left out, of an address without protocol (``user:password@camera/1``) the password; of
    parameters that hold such, as ``?user=a&password=b``, the values are.

    Args:
        text: an address, another source, or a message of the decoder.
    """
    text = _ADDRESS.sub(lambda match: _SECRET.sub(rf"\1={HIDDEN}", _CREDENTIALS.sub(r"\1", match[0])), text)
    return _WITHOUT_PROTOCOL.sub(rf"\1:{HIDDEN}@", text)
