"""`planish install-completion`: shell completion of commands and flags."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from planish.cli.options import Quiet


def install_completion(
    *,
    shell: Literal["bash", "zsh", "fish"] | None = None,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    quiet: Quiet = False,
) -> None:
    """Install completion of planish's commands and flags for bash, zsh or fish.

    Parameters
    ----------
    shell
        The shell; by default the one in use.
    output
        Write the script to this file and do not touch the start-up file of the shell. By default the script is
        installed where the shell finds it.
    quiet
        Print nothing but errors.
    """
    from cyclopts.completion.detect import ShellDetectionError, detect_shell

    from planish.cli.app import app
    from planish.errors import OutputError, UsageError
    from planish.io.files import write_bytes

    try:
        shell = shell or _known(detect_shell())
    except ShellDetectionError:
        raise UsageError("the shell in use was not recognized; name it with --shell bash, zsh or fish") from None
    try:
        if output is None:
            output, use = app.install_completion(shell=shell), "start a new shell to use it."
        else:
            use = "source it, or move it to the shell's completion folder."
            write_bytes(output, app.generate_completion(shell=shell).encode())
    except OutputError:
        raise
    except OSError as problem:
        raise OutputError(
            f"{problem.filename or output} cannot be written ({problem.strerror}); name another file with --output"
        ) from None
    if not quiet:
        print(f"Completion for {shell} was written to {output}; {use}")


def _known(shell: str) -> Literal["bash", "zsh", "fish"]:
    """Check that completion is available for a shell."""
    from planish.errors import UsageError

    if shell not in ("bash", "zsh", "fish"):
        raise UsageError(f"there is no completion for {shell}; name another shell with --shell bash, zsh or fish")
    return shell  # type: ignore[return-value]
