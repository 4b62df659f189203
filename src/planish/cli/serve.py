"""`planish serve`: browser page and HTTP API."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from planish.cli.options import OpenBrowser, Quiet, open_in_browser
from planish.settings import ServeSettings


def serve(
    *,
    host: str = "127.0.0.1",
    port: int = 8008,
    public: Annotated[bool, Parameter(negative="")] = False,
    allow_host: list[str] | None = None,
    data: Path | None = None,
    open_browser: OpenBrowser = None,
    limits: Annotated[ServeSettings, Parameter(name="*")] = ServeSettings(),
    quiet: Quiet = False,
) -> None:
    """Serve a browser page and an HTTP API that restore uploaded scans, until Ctrl-C. Needs the extra planish[web].

    Parameters
    ----------
    host
        Address to listen on. By default only this machine can reach it.
    port
        Port to listen on. 0: any free port.
    public
        Confirm that other machines may reach the service; required for every address but loopback ones. There is
        neither login nor encryption, so put a reverse proxy with both in front (docs/serve.md).
    allow_host
        Host name under which browsers may access the service, such as scans.example.org. May be repeated.
    data
        Folder for jobs and results; by default ~/.local/state/planish/serve.
    open_browser
        Open the page in the browser. By default only if there is a display.
    quiet
        Print nothing but errors.
    """
    import os

    from planish.errors import MissingExtraError, UsageError, install_command

    try:
        from planish.web.server import is_loopback, run_server
    except ModuleNotFoundError as problem:
        if (problem.name or "").startswith("planish"):
            raise
        raise MissingExtraError(
            f"planish serve needs {problem.name}, which is not installed: {install_command('web')}"
        ) from None
    if not is_loopback(host) and not public:
        raise UsageError(
            f"at {host} other machines can reach the service, without login or encryption; confirm with --public, or "
            "omit --host"
        )
    if not 0 <= port <= 65535:
        raise UsageError(f"port must be between 0 and 65535, not {port}")
    state = Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state")

    def ready(address: str) -> None:
        if not quiet:
            print(f"planish serves at {address}", flush=True)
        open_in_browser(address, wanted=open_browser)

    run_server(
        data or state / "planish" / "serve",
        limits,
        host=host,
        port=port,
        hosts=frozenset(name.lower() for name in allow_host or ()),
        ready=ready,
    )
