"""`planish install-completion`: the shell learns planish's commands and flags."""

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
    """Teach bash, zsh or fish to complete planish's commands and flags.

    Parameters
    ----------
    shell
        Which one. If it is not given: the one in use.
    output
        Write the script to this file and leave the shell's start-up file alone. If it is not given, the script goes
        where the shell looks for it.
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
        raise UsageError("the shell in use could not be told; name it with --shell bash, zsh or fish") from None
    try:
        if output is None:
            output, use = app.install_completion(shell=shell), "start a new shell to use it."
        else:
            use = "source it, or put it where the shell looks."
            write_bytes(output, app.generate_completion(shell=shell).encode())
    except OSError as problem:
        raise OutputError(
            f"{problem.filename or output} cannot be written ({problem.strerror}); name another file with --output"
        ) from None
    if not quiet:
        print(f"Completion for {shell} is in {output}; {use}")


def _known(shell: str) -> Literal["bash", "zsh", "fish"]:
    """The shell, if completion is offered for it."""
    from planish.errors import UsageError

    if shell not in ("bash", "zsh", "fish"):
        raise UsageError(f"there is no completion for {shell}; name another shell with --shell bash, zsh or fish")
    return shell  # type: ignore[return-value]
