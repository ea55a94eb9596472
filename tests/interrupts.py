"""Children of a test that answer Ctrl-C and the end of their terminal as at one."""

import signal


def heed_interrupts():
    """For ``preexec_fn``: children of a suite that a shell runs in the background ignore SIGINT, with nohup SIGHUP."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
