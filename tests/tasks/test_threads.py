"""Work spread over threads: as one after the other, and all its processor time counted."""

import threading
import time

import pytest

from tasks.threads import counted, spread

BUSY_S = 0.1


def busy(_):
    """Keep a processor busy for a while of the thread's own clock."""
    end = time.thread_time() + BUSY_S
    while time.thread_time() < end:
        pass
    return threading.get_ident()


def test_results_come_in_the_order_of_the_items():
    assert spread(lambda i: i * i, range(50)) == [i * i for i in range(50)]
    assert spread(str, []) == []


def test_the_time_of_all_threads_is_counted_and_this_threads_is_not():
    start = time.thread_time()
    with counted() as spent:
        threads = spread(busy, range(4))
        own = time.thread_time() - start
        assert threading.get_ident() not in threads
    assert 4 * BUSY_S <= spent.cpu_s < 4 * BUSY_S + 1
    assert own < 4 * BUSY_S


def test_what_others_spread_meanwhile_is_not_counted():
    with counted() as spent:
        other = threading.Thread(target=lambda: spread(busy, range(2)))
        other.start()
        other.join()
    assert spent.cpu_s == 0
    busy_outside = spread(busy, range(1))
    assert len(busy_outside) == 1 and spent.cpu_s == 0


def test_an_inner_count_is_given_back():
    with counted() as outer:
        with counted() as inner:
            spread(busy, range(1))
        spread(busy, range(1))
    assert BUSY_S <= inner.cpu_s < 2 * BUSY_S
    assert BUSY_S <= outer.cpu_s < 2 * BUSY_S


def test_an_error_is_raised_and_its_time_counted():
    def fail(item):
        busy(item)
        raise ValueError("no")

    with counted() as spent, pytest.raises(ValueError, match="no"):
        spread(fail, range(1))
    assert spent.cpu_s >= BUSY_S
