"""Independent fits side by side.

The kernels and the linear algebra let go of Python's lock, so threads are enough. No fit sees
another's result: the answer is the same for any number of threads.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numba

Item = TypeVar("Item")
Result = TypeVar("Result")


def each(function: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
    """Call a function for every item, in as many threads as Numba may use.

    Parameters
    ----------
    function : callable
        Must not change what other calls read.
    items : sequence
        Its arguments.

    Returns
    -------
    list
        The results in the order of the items.
    """
    threads = min(numba.get_num_threads(), len(items))
    if threads < 2:
        return [function(item) for item in items]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(function, items))
