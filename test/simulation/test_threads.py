"""A simulation gives the same bits in every thread: BLAS has one thread wherever a simulation works."""

from __future__ import annotations

from threading import Barrier, Thread

import numpy as np

from ldcs_ros import load_scene
from ldcs_ros.simulation.threads import _libraries, one_thread


def counts():
    return [library.get_num_threads() for library in _libraries()]


def in_thread(work):
    found = []
    thread = Thread(target=lambda: found.append(work()))
    thread.start()
    thread.join(30.0)
    return found[0]


def inside():
    with one_thread():
        return counts()


def test_blas_has_one_thread_inside_in_every_thread_and_as_many_as_before_after():
    before = counts()
    for _ in range(2):
        assert set(inside()) == set(in_thread(inside)) == {1}
        assert counts() == before


def test_the_last_of_two_threads_restores_the_number():
    before, entered, left = counts(), Barrier(2), Barrier(2)

    def first():
        with one_thread():
            entered.wait(10.0)
        left.wait(10.0)

    thread = Thread(target=first)
    thread.start()
    with one_thread():
        entered.wait(10.0)
        left.wait(10.0)  # the other one is outside again
        assert set(counts()) == {1}
    thread.join(10.0)
    assert counts() == before


def test_a_run_in_a_thread_has_the_bits_of_one_in_the_main_thread():
    def run():
        simulation = load_scene("rig").build()
        simulation.advance_to(0.1)
        return simulation.state.position

    assert np.array_equal(run(), in_thread(run))
