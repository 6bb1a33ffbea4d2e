"""Linear algebra is held to one thread where it pays, and only there."""

import inspect

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from radiation_ss import diagnose
from radiation_ss.parallel import on_one_core


def threads():
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


def test_one_thread_inside_and_the_callers_after():
    with threadpool_limits(2, user_api="blas"):
        before = threads()
        assert on_one_core(threads)() == {1}
        with pytest.raises(ZeroDivisionError):
            on_one_core(lambda: 1 / 0)()
        assert threads() == before


def test_the_signature_stays():
    assert list(inspect.signature(diagnose).parameters)[:3] == ["model", "records", "effects"]
    assert diagnose.__doc__.startswith("Say where")
