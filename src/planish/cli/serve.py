"""`planish serve`: a page in the browser, and an HTTP API."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from planish.cli.options import Quiet
from planish.settings import ServeSettings


def serve(
    *,
    host: str = "127.0.0.1",
    port: int = 8008,
    public: Annotated[bool, Parameter(negative="")] = False,
    allow_host: Annotated[list[str], Parameter(negative="")] | None = None,
    data: Path | None = None,
    limits: Annotated[ServeSettings, Parameter(name="*")] = ServeSettings(),
    quiet: Quiet = False,
) -> None:
    """Restore scans that come from a browser or over HTTP, until Ctrl-C. Needs the extra planish[web].

    Parameters
    ----------
    host
        The address to listen at. By default only this machine can reach it.
    port
        0: any that is free.
    public
        Say that others may reach the service: needed for every address but this machine's own. There is no login and
        no encryption, so put a server in front that has both (docs/serve.md).
    allow_host
        A name under which browsers may ask for the service, as scans.example.org. Given several times: several.
    data
        The folder for jobs and results; by default ~/.local/state/planish/serve.
    quiet
        Print nothing but errors.
    """
    import os

    from planish.errors import MissingExtraError, UsageError

    try:
        from planish.web.server import is_loopback, run_server
    except ModuleNotFoundError as problem:
        if (problem.name or "").startswith("planish"):
            raise
        raise MissingExtraError(
            f"planish serve needs {problem.name}, which is not installed: pip install 'planish[web]'"
        ) from None
    if not is_loopback(host) and not public:
        raise UsageError(
            f"at {host} other machines reach the service, without login or encryption; say that this is meant with "
            "--public, or leave --host away"
        )
    if not 0 <= port <= 65535:
        raise UsageError(f"port must be between 0 and 65535, not {port}")
    state = Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state")
    run_server(
        data or state / "planish" / "serve",
        limits,
        host=host,
        port=port,
        hosts=frozenset(name.lower() for name in allow_host or ()),
        ready=(lambda address: None) if quiet else (lambda address: print(f"planish serves at {address}", flush=True)),
    )
