"""The root `planish` command, to which `main` adds the subcommands."""

from cyclopts import App, Parameter

from planish.version import __version__

EVERYWHERE = Parameter(negative_iterable=())
"""Of all commands, also of groups: no --empty-size, since a list or a tuple is given or left out."""

app = App(
    name="planish",
    help="Flatten 3D-scanned warped documents: the page comes out flat, at its true size in millimetres.",
    version=__version__,
    version_flags=["--version"],
    default_parameter=EVERYWHERE,
    help_epilogue=(
        "Exit codes: 0 success; 2 invalid command line; 3 unusable input; 4 output cannot be written; 5 the page is "
        "not good (it is still written, and stderr says why); 6 an optional dependency is not installed; 130 "
        "interrupted; 143 terminated."
    ),
)
