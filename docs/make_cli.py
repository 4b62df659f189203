"""Write docs/cli.md from the real command line: python docs/make_cli.py."""

import sys
from pathlib import Path
from unittest.mock import patch

from planish.cli.main import app

HEAD = """# Command line

Made from the real flags by `python docs/make_cli.py`; a test compares the two.

"""


def text() -> str:
    """The page as it should be."""
    with patch.object(sys, "argv", ["planish"]):  # else usage lines show how this script was called
        return HEAD + app.generate_docs(output_format="markdown", heading_level=2).strip() + "\n"


if __name__ == "__main__":
    (Path(__file__).parent / "cli.md").write_text(text(), encoding="utf-8")
