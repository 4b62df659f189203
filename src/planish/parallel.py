"""Both cores at work on one kernel, safely: blocks of fixed size, handed out to plain threads.

Numba's own layers were left aside on purpose: with OpenMP a loop took 8 to 14 s instead of 0.4 when the cores were
busy, and workqueue ends the whole process when two threads of a program flatten at once. Kernels that release the
GIL need neither. As blocks do not depend on the number of threads, nor do sums over blocks.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

from numba import get_num_threads

BLOCK = 1 << 15
"""Items in a block: about a millisecond of work, a hundred times what handing it out costs."""

ParallelFor = Callable[..., None]


@contextmanager
def thread_pool(threads: int | None = None) -> Iterator[ParallelFor]:
    """Hire threads for as long as the `with` lasts.

    Yields
    ------
    parallel_for : callable
        `parallel_for(kernel, count, *arguments, block=BLOCK)` calls `kernel(first, last, *arguments)` for blocks that
        together cover `range(count)`, in no certain order. The kernel must be compiled with `nogil=True`, and no
        two blocks may write the same place.

    Examples
    --------
    >>> import numpy as np
    >>> from numba import njit
    >>> @njit(nogil=True)
    ... def square(first, last, x):
    ...     for i in range(first, last):
    ...         x[i] *= x[i]
    >>> x = np.arange(5.0)
    >>> with thread_pool() as parallel_for:
    ...     parallel_for(square, 5, x, block=2)
    >>> x.tolist()
    [0.0, 1.0, 4.0, 9.0, 16.0]
    """
    hands = threads or get_num_threads()
    with ThreadPoolExecutor(max(hands - 1, 1)) as pool:

        def parallel_for(kernel: Callable[..., Any], count: int, *arguments: Any, block: int = BLOCK) -> None:
            blocks = itertools.count()

            def work() -> None:
                while (first := next(blocks) * block) < count:
                    kernel(first, min(first + block, count), *arguments)

            helpers = [pool.submit(work) for _ in range(min(hands - 1, (count - 1) // block))]
            work()
            for helper in helpers:
                helper.result()

        yield parallel_for
