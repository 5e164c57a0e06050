"""Work for threads: how it is cut, and what goes on beside the rest."""

from __future__ import annotations

import threading
import time

import pytest
from radiosity.solver.errors import Cancelled
from radiosity.solver.parallel import SHARES, Run, shares


@pytest.mark.parametrize(("count", "size", "least"), [(0, 10, 1), (7, 100, 1), (1000, 100, 1), (1000, 10_000, 400),
                                                      (10**6, 2**17, 2**13)])
def test_shares_cover_everything_once(count, size, least):
    # In order, none larger than the size, none but the last smaller than the least or an even share.
    parts = shares(count, size, least)
    assert [index for part in parts for index in range(part.start, part.stop)] == list(range(count))
    assert all(part.stop - part.start <= size for part in parts)
    assert all(part.stop - part.start >= min(size, least, count) for part in parts[:-1])


def test_much_work_is_enough_for_many_threads():
    # 1,000 things that all fit into one run make SHARES of them all the same; 1,000 that are too few for that make one.
    assert len(shares(1000, 10**6)) == SHARES
    assert len(shares(1000, 10**6, least=1000)) == 1


@pytest.mark.parametrize("threads", [1, 3])
def test_what_goes_on_beside_counts_its_rays_for_its_own_stage(threads):
    # 5 rays beside, 7 in the main work, whose stage changes meanwhile.
    run = Run(threads, stage="gather")

    def work(own):
        own.count(5)
        return "found"

    with run.beside("audit", work) as result:
        run.stage = "direct"
        run.count(7)
        assert result() == "found"
    assert run.rays == {"direct": 7, "audit": 5}


def test_what_goes_on_beside_ends_when_the_main_work_fails():
    # The main work raises: the other one, which would wait for ever, is told at its next look.
    started, run = threading.Event(), Run(2)

    def work(own):
        started.set()
        while True:
            own.check()

    def fail():
        with run.beside("audit", work):
            started.wait()
            raise ValueError("main work")

    with pytest.raises(ValueError, match="main work"):
        fail()


def test_what_fails_beside_fails_where_its_result_is_asked_for():
    run = Run(2)

    def work(own):
        raise Cancelled("no")

    with run.beside("audit", work) as result, pytest.raises(Cancelled):
        result()


@pytest.mark.parametrize("threads", [1, 2])
def test_work_may_map_work_of_its_own(threads):
    # Eight pieces that map eight each, on two threads: no thread waits for ever for one that waits, and only the outer
    # work tells how far it is, which never goes back.
    told = []
    run = Run(threads, lambda stage, fraction: told.append(fraction))
    rows = run.map(lambda row: run.map(lambda column: 10 * row + column, range(8)), range(8))
    assert rows == [[10 * row + column for column in range(8)] for row in range(8)]
    assert told == sorted(told)
    assert told[-1] == 1


def test_a_piece_that_fails_ends_the_others_before_it_is_told():
    # The first piece fails while the second is at work: that one has ended when the failure arrives.
    run, at_work, ended = Run(2), threading.Event(), threading.Event()

    def work(piece):
        if piece == 0:
            at_work.wait()
            raise ValueError("first piece")
        at_work.set()
        time.sleep(0.05)
        ended.set()

    with pytest.raises(ValueError, match="first piece"):
        run.map(work, range(2))
    assert ended.is_set()
    assert run.map(str, range(2)) == ["0", "1"]
