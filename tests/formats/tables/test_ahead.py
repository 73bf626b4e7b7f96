"""What is worked on ahead comes in order, costs nothing unless wanted, and fails in order."""

import threading

import pytest

from testbench.formats.tables.ahead import AHEAD, AT_ONCE, worked_ahead


def test_the_results_come_in_the_order_of_the_items():
    doubled = [(item, result()) for item, result in worked_ahead(lambda n: 2 * n, range(20))]
    assert doubled == [(n, 2 * n) for n in range(20)]


def test_who_wants_the_first_only_has_no_more_taken_and_no_thread_started():
    taken = []

    def items():
        for n in range(9):
            taken.append(n)
            yield n

    threads = threading.active_count()
    each = worked_ahead(lambda n: n, items())
    for wanted in range(AT_ONCE):
        item, result = next(each)
        assert (item, result(), taken) == (wanted, wanted, list(range(wanted + 1)))
    assert threading.active_count() == threads
    each.close()


def test_it_runs_ahead_by_as_much_as_it_says_and_other_threads_do_the_work():
    taken, workers = [], set()

    def items():
        for n in range(9):
            taken.append(n)
            yield n

    def work(n):
        workers.add(threading.get_ident())
        return n

    each = worked_ahead(work, items())
    for _ in range(AT_ONCE):
        next(each)
    item, result = next(each)
    assert item == result() == AT_ONCE and taken == list(range(AT_ONCE + AHEAD + 1))
    assert threading.get_ident() not in workers
    each.close()


@pytest.mark.parametrize("bad", range(AT_ONCE + 4))
def test_work_that_fails_raises_where_its_result_is_asked_for(bad):
    def work(n):
        if n == bad:
            raise ValueError(n)
        return n

    seen = []
    with pytest.raises(ValueError, match=str(bad)):
        seen.extend(result() for _, result in worked_ahead(work, range(AT_ONCE + 4)))
    assert seen == list(range(bad))


@pytest.mark.parametrize("count", range(AT_ONCE + 5))
def test_items_that_cannot_be_taken_fail_after_those_before_them(count):
    def items():
        yield from range(count)
        raise OSError("the disk is gone")

    seen = []
    with pytest.raises(OSError, match="gone"):
        seen.extend(result() for _, result in worked_ahead(lambda n: n, items()))
    assert seen == list(range(count))
