"""`planish batch`: shelves of scans, each into its own folder, and one summary."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from planish.cli.options import Output, Quiet, Verbose
from planish.cli.restore_options import Flags, RestoreOptions
from planish.settings import BatchFiles

Switch = Parameter(negative="")


def batch(
    scans: Path,
    /,
    *,
    output: Output,
    jobs: int | None = None,
    dask: str | None = None,
    timeout: float = 1800.0,
    retry: Annotated[bool, Switch] = False,
    files: Annotated[BatchFiles, Parameter(name="*", negative="")] = BatchFiles(),
    restore_options: Annotated[RestoreOptions, Flags] = RestoreOptions(),
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> bool:
    """Restore every scan of a folder or a list, and sum up how good the pages are, the worst first.

    It may be stopped at any moment: run again, it goes on where it was. What was done from the same files with the
    same settings is not done again. A scan that cannot be restored never stops the others.

    Parameters
    ----------
    scans
        A folder with scans in it or below it; or a list of scans: .csv or .jsonl with scan and, as wanted, photo,
        camera, name, units (docs/batch.md).
    output
        The folder for the pages, each in a folder of its own, and for summary.html, summary.csv and summary.jsonl.
    jobs
        Scans at work at once on this machine, by default as many as it has cores; fewer where memory is short.
    dask
        Have the work done by the Dask cluster whose scheduler is at this address, as tcp://host:8786. Its workers need
        the same file system under the same paths. Needs the extra planish[dask].
    timeout
        Seconds after which a scan is given up.
    retry
        Try again what failed before, though nothing has changed.
    quiet
        Print nothing but errors.
    verbose
        Print a line for every scan, and the count when the output is piped.
    """
    from planish.batch import BatchOptions, DaskPool, LocalPool, find_items, read_list
    from planish.batch import batch as restore_all
    from planish.cli.batch_console import print_counts, progress_bar
    from planish.errors import InputError, UsageError

    if jobs is not None and dask is not None:
        raise UsageError("--jobs is for this machine and --dask for a cluster; give one of them")
    if jobs is not None and jobs < 1:
        raise UsageError(f"--jobs must be at least 1, not {jobs}")
    if not timeout > 0:
        raise UsageError(f"--timeout must be greater than 0 seconds, not {timeout:g}")
    scan_list = read_list(scans) if scans.is_file() else find_items(scans)
    options = BatchOptions(
        settings=restore_options.settings(), files=files, pdfa=restore_options.pdfa, ocr=restore_options.ocr
    )
    with progress_bar(len(scan_list.items), quiet=quiet, verbose=verbose) as progress:
        counts = restore_all(
            scan_list,
            output,
            (lambda: LocalPool(jobs)) if dask is None else (lambda: DaskPool(dask, output)),
            options,
            retry=retry,
            seconds=timeout,
            progress=progress,
        )
    print_counts(counts, scan_list.notes, quiet=quiet, verbose=verbose)
    if counts.failed:
        raise InputError(f"{counts.failed} of {counts.items} scans failed; {counts.summary} says why, the worst first")
    return not counts.not_settled
