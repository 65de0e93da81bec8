"""One thread for the linear algebra.

Sums that are split among threads round otherwise, so that one seed would not always give the same
bytes; the matrices here are too small to gain by more; and where processes work side by side, the
threads of each would stand in the others' way.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

Given = ParamSpec("Given")
Result = TypeVar("Result")


def one_blas_thread(function: Callable[Given, Result]) -> Callable[Given, Result]:
    """Let a function, and the processes it starts, use the linear algebra on one thread."""

    @wraps(function)
    def limited(*args: Given.args, **kwargs: Given.kwargs) -> Result:
        with threadpool_limits(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return limited
