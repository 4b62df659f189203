"""Run a kernel on all cores: blocks of fixed size, shared out among plain threads.

Numba's own threading layers are not used: with OpenMP a loop took 8 to 14 s instead of 0.4 when the cores were busy,
and workqueue aborts the process when two threads of a program flatten at once. Kernels that release the GIL need
neither. Blocks do not depend on the number of threads, and so neither do sums over blocks.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

from numba import get_num_threads

BLOCK = 1 << 15
"""Items in a block: about a millisecond of work, a hundred times the cost of scheduling it."""

ParallelFor = Callable[..., None]


@contextmanager
def thread_pool(threads: int | None = None) -> Iterator[ParallelFor]:
    """Open a thread pool.

    Yields
    ------
    parallel_for : callable
        `parallel_for(kernel, count, *arguments, block=BLOCK)` calls `kernel(first, last, *arguments)` for blocks that
        together cover `range(count)`, in no particular order. The kernel must be compiled with `nogil=True`, and no
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
    threads_used = threads or get_num_threads()
    with ThreadPoolExecutor(max(threads_used - 1, 1)) as pool:

        def parallel_for(kernel: Callable[..., Any], count: int, *arguments: Any, block: int = BLOCK) -> None:
            blocks = itertools.count()

            def work() -> None:
                while (first := next(blocks) * block) < count:
                    kernel(first, min(first + block, count), *arguments)

            futures = [pool.submit(work) for _ in range(min(threads_used - 1, (count - 1) // block))]
            work()
            for future in futures:
                future.result()

        yield parallel_for
