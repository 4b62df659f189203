"""Write docs/cli.md and its further pages from the real command line: python docs/make_cli.py."""

import re
import sys
from pathlib import Path
from unittest.mock import patch

from planish.cli.main import app

HEAD = """# {title}

Made from the real flags by `python docs/make_cli.py`; a test compares the two.

"""

PAGES = {
    "cli.md": ("Command line", ("demo", "restore", "flatten", "photo", "view")),
    "cli-batch.md": (
        "Command line: batches, service, installation",
        ("batch", "serve", "warm-up", "doctor", "install-completion"),
    ),
    "cli-acquire.md": ("Command line: acquire", ("acquire",)),
    "cli-calibrate.md": ("Command line: calibrate", ("calibrate",)),
}
"""Title and commands of every page; the first has the list of all commands as well."""


def texts() -> dict[str, str]:
    """The pages as they should be, by file name."""
    with patch.object(sys, "argv", ["planish"]):  # else usage lines show how this script was called
        whole = app.generate_docs(output_format="markdown", heading_level=1)
    overview, *chapters = re.split(r"^(?=## planish )", whole, flags=re.MULTILINE)
    commands = {chapter.split("\n")[0].removeprefix("## planish "): chapter for chapter in chapters}
    placed = {name: page for page, (_, names) in PAGES.items() for name in names}
    if set(placed) != set(commands):
        raise SystemExit(f"on no page, or no command: {set(placed) ^ set(commands)}")
    contents, list_of_commands = overview.index("## Table of Contents"), overview.index("**Commands**")
    usage = (overview[:contents] + overview[list_of_commands:]).split("\n", 1)[1]  # without its title
    made = {}
    for page, (title, names) in PAGES.items():
        text = "\n".join([usage] * (page == "cli.md") + [commands[name] for name in names])
        text = re.sub(r"\]\(#planish-([\w-]+)\)", lambda link, page=page: _link(link[1], page, placed), text)
        made[page] = HEAD.format(title=title) + re.sub(r"\n{3,}", "\n\n", text).strip() + "\n"
    return made


def _link(command: str, page: str, placed: dict[str, str]) -> str:
    """A link from a page to a command, such as acquire-laser."""
    other = next(place for name, place in placed.items() if f"{command}-".startswith(f"{name}-"))
    return f"]({'' if other == page else other}#planish-{command})"


if __name__ == "__main__":
    for name, text in texts().items():
        (Path(__file__).parent / name).write_text(text, encoding="utf-8")
