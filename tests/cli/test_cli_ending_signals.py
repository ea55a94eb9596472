"""Signals that end a command wait until results that belong together are written."""

import signal
import threading

import pytest

from pipeline.cli.ending_signals import INTERRUPTS, held
from pipeline.signals import handled


@pytest.fixture(autouse=True)
def interrupts():
    """As at a terminal: a shell that runs the suite in the background has it ignore SIGINT."""
    with handled([signal.SIGINT], signal.default_int_handler):
        yield


def test_a_held_signal_takes_effect_after_the_block():
    done = []
    with pytest.raises(KeyboardInterrupt):
        with held():
            signal.raise_signal(signal.SIGINT)
            done.append("first")
            signal.raise_signal(signal.SIGINT)
            done.append("second")
        done.append("after")
    assert done == ["first", "second"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("number", INTERRUPTS)
def test_each_goes_to_the_handler_it_had(number):
    came = []
    with handled([number], lambda number, frame: came.append(number)):
        with held():
            signal.raise_signal(number)
            assert came == []
        assert came == [number]


def test_a_block_that_raises_gives_way_to_the_signal_and_without_one_keeps_its_error():
    with pytest.raises(KeyboardInterrupt), held():
        signal.raise_signal(signal.SIGINT)
        raise ValueError
    with pytest.raises(ValueError, match="full"), held():
        raise ValueError("full")


def test_outside_the_main_thread_nothing_is_held():
    done = []

    def work():
        with held():
            done.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == [signal.default_int_handler]
