"""Children of a test that answer Ctrl-C as at a terminal."""

import signal


def heed_interrupts():
    """For ``preexec_fn``: a shell that runs the suite in the background has its children ignore SIGINT."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
