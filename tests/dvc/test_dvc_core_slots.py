"""Cores of commands that run at once: shared while several run, all of them for one that is left alone."""

from __future__ import annotations

import os

import pytest

from pipeline.dvc.core_slots import CoreSlots, affinity

CORES = [0, 1, 2, 3, 4]


@pytest.fixture
def slots(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: set(CORES), raising=False)
    slots = CoreSlots()
    slots.count = 2
    return slots


def test_commands_share_the_cores_and_the_first_free_slot_is_taken(slots):
    slots.take("first")
    assert slots.cores_of("first") == set(CORES) and "first" in slots
    slots.take("second")
    assert (slots.cores_of("first"), slots.cores_of("second")) == ({0, 2, 4}, {1, 3})
    slots.leave("first")
    slots.take("third")
    assert "first" not in slots
    assert (slots.cores_of("third"), slots.cores_of("second")) == ({0, 2, 4}, {1, 3})


def test_the_last_command_gets_all_cores_though_it_has_begun(slots, monkeypatch):
    given = []
    monkeypatch.setattr(os, "sched_setaffinity", lambda process, cores: given.append((process, cores)), raising=False)
    slots.take("first")
    slots.take("second")
    with slots.running("second", 7):
        slots.give_all_cores_to_the_last()
        assert given == []
        slots.leave("first")
        slots.give_all_cores_to_the_last()
        assert given == [(7, set(CORES))]
    slots.give_all_cores_to_the_last()
    assert len(given) == 1  # it has ended


def test_where_cores_cannot_be_chosen_none_are(monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    slots = CoreSlots()
    slots.take("only")
    assert slots.cores_of("only") is None
    with affinity(None):
        pass
