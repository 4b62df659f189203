"""docs/tutorial.md, walked as it stands: its commands in order, in one folder, and what it says they say."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from planish.cli.main import run

pytestmark = pytest.mark.slow

PAGE = (Path(__file__).parent.parent / "docs" / "tutorial.md").read_text()
FAILING = {"--units mm": 3, "mv letter.jpg": 3, "batch": 3}
"""Commands that the page says do not end well, by what they have that others have not."""


def steps():
    """The commands of each block, and the lines that are said to come of it."""
    blocks = re.findall(r"^```sh\n(.*?)^```\n(?:```text\n(.*?)^```\n)?", PAGE, re.M | re.S)
    return [(commands.splitlines(), said.splitlines()) for commands, said in blocks]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_walk(folder, capfd):
    (script,) = re.findall(r"^```python\n(.*?)^```", PAGE, re.M | re.S)
    subprocess.run([sys.executable, "-c", script], check=True)
    assert len(steps()) == 9
    for commands, said in steps():
        code = 0
        for command in commands:
            name, *arguments = shlex.split(command)
            code = run(arguments) if name == "planish" else subprocess.run([name, *arguments]).returncode
        expected = next((c for part, c in FAILING.items() if part in "\n".join(commands)), 0)
        told = capfd.readouterr()
        assert code == expected, (commands, told.err)
        for line in said:
            assert line in told.err.splitlines(), (commands, told.err)
    made = {path.name for path in folder.iterdir()}
    assert {"letter.tif", "letter.json", "flat.obj", "guess.png", "view.html"} <= made
    assert len(list(folder.glob("pages/*/page.tif"))) == 19
    summary = (folder / "pages" / "summary.html").read_text()
    assert summary.index("page-13") < summary.index("page-01")  # the bad one comes first


def test_the_demo_of_the_first_step(tmp_path, capfd):
    """On the whole scan of 300,000 points, as a newcomer meets it."""
    assert re.search(r"^\$ planish demo$", PAGE, re.M)
    assert run(["demo", "-o", str(tmp_path / "planish-demo")]) == 0
    lines = capfd.readouterr().out
    rows = re.findall(r"^\| ([a-z, ]+) \|", PAGE.split("## 2.")[0], re.M)
    for name in ", ".join(rows[1:]).split(", "):  # rows[0] is the table's head
        assert re.search(rf"^{name}\b", lines, re.M), name
    assert (tmp_path / "planish-demo" / "stages" / "all.png").exists()
