"""`planish batch`: restore many scans, each into its own folder, with one summary."""

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
    """Restore all scans of a folder or a list, and summarize the quality of the pages, worst first.

    A run may be interrupted at any moment; the same command resumes it. Scans that were restored from the same files
    with the same settings are skipped. A scan that cannot be restored does not stop the others.

    Parameters
    ----------
    scans
        A folder, searched with its subfolders; or a list of scans: .csv or .jsonl with scan and optionally photo,
        camera, name, units (docs/batch.md).
    output
        Output folder: one subfolder per scan, and summary.html, summary.csv and summary.jsonl.
    jobs
        Number of concurrent scans on this machine; by default one per core, fewer if memory is short.
    dask
        Run on the Dask cluster whose scheduler has this address, for example tcp://host:8786. Its workers need the
        same file system under the same paths. Needs the extra planish[dask].
    timeout
        Time limit per scan in seconds.
    retry
        Retry scans that failed before, even if nothing has changed.
    quiet
        Print nothing but errors.
    verbose
        Print a line per scan, and the counts even if the output is piped.
    """
    from planish.batch import BatchOptions, DaskPool, LocalPool, find_items, read_list
    from planish.batch import batch as restore_all
    from planish.cli.batch_console import print_counts, progress_bar
    from planish.errors import InputError, UsageError

    if jobs is not None and dask is not None:
        raise UsageError("--jobs is for this machine and --dask for a cluster; give only one of them")
    if jobs is not None and jobs < 1:
        raise UsageError(f"--jobs must be at least 1, not {jobs}")
    if not timeout > 0:
        raise UsageError(f"--timeout must be greater than 0 seconds, not {timeout:g}")
    if restore_options.sheet_mask is not None:
        raise UsageError(f"--sheet is auto or all for a batch, not {restore_options.sheet}; a mask is for one photo")
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
        raise InputError(
            f"{counts.failed} of {counts.items} scans failed; {counts.summary} lists the reasons, worst first"
        )
    return not counts.not_good
