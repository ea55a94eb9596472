"""Exit codes of ``camera-monitor``; `docs/exit-codes.md` explains them. 0 and 1 are those of every program."""

from __future__ import annotations

REFUSED = 2  # wrong input, results that cannot be written, and problems that ``doctor`` finds
ALARM = 3  # of ``health``, ``watch`` and ``budget``
DIFFERENT = 3  # of ``report diff --fail``
INTERRUPTED = 130  # by Ctrl-C, SIGTERM or SIGHUP
