"""Write docs/planish.1, the manual page, from the real command line: python docs/make_man.py."""

import importlib
import re
import sys
from pathlib import Path
from unittest.mock import patch

from docutils.core import publish_string

from planish.version import __version__

app = importlib.import_module("planish.cli.main").app

HEAD = f"""
=======
planish
=======

-------------------------------------
flatten 3D-scanned warped documents
-------------------------------------

:Version: planish {__version__}
:Manual section: 1
:Manual group: User Commands

Synopsis
========

| planish *COMMAND* ...
| planish *COMMAND* --help

Description
===========

A 3D scan of a warped document goes in: a thick bound book, a folded letter, a curled map. The page comes out flat, at
its true size in millimetres, evenly lit, with an account of how good it is. To begin with: ``planish demo`` scans a
known sheet virtually and restores it; ``planish restore scan.obj -o page.tif`` restores a scan of your own.

"""

TAIL = """
Exit status
===========

{codes}

See also
========

https://planish.readthedocs.io
"""


def texts() -> dict[str, str]:
    """The page as it should be, by file name."""
    with patch.object(sys, "argv", ["planish"]):  # else usage lines show how this script was called
        source = app.generate_docs(output_format="rst")
    commands = source[source.index(".. _cyclopts-planish-") :]
    titled = re.sub(r"^\.\. _cyclopts-.*:\n\n.*\n([=\-^~\"'.])\1*\n\n::\n\n    (.*)\n", _section, commands, flags=re.M)
    settings = {"halt_level": 2, "output_encoding": "unicode"}
    meanings = re.findall(r"(\d+) ([^;.]+)", app.help_epilogue)
    codes = "".join(f"{code}\n    {meaning}\n" for code, meaning in meanings)
    source = HEAD + titled + TAIL.format(codes=codes)
    return {"planish.1": str(publish_string(source, writer="manpage", settings_overrides=settings))}


def _section(found: re.Match[str]) -> str:
    """A section named as the whole command, all on one level, that begins with how it is called."""
    usage = found[2]
    name = re.match(r"planish( [a-z][a-z-]*)+", usage)[0]
    return f"{name}\n{'=' * len(name)}\n\n``{usage}``\n"


if __name__ == "__main__":
    for name, text in texts().items():
        (Path(__file__).parent / name).write_text(text, encoding="utf-8")
