"""`planish warm-up`: compile everything before it is needed."""

from __future__ import annotations

from planish.cli.options import Quiet


def warm_up(*, quiet: Quiet = False) -> None:
    """Compile the inner loops of the program now, so that its first run on this machine is as fast as others.

    For images of machines, clusters and lectures. What is compiled is kept beside the package, or in the folder that
    the variable NUMBA_CACHE_DIR names. Done twice, it takes half a minute and changes nothing. Devices (`planish
    acquire`, several photos) compile a few loops more when they are first used.

    Parameters
    ----------
    quiet
        Print nothing but errors.
    """
    from planish.cli.console import progress_bar
    from planish.job.warm_up import load_all_kernels

    with progress_bar(quiet=quiet) as progress:
        progress("compile", 0.0)
        load_all_kernels()
