"""The sessions of the documentation by copy and paste: from what virtual devices see to the page.

The one with a projector is in tests/test_calibrate.py, on fewer photos: those of all its poses take minutes.
"""

import json
import re
import shlex
from pathlib import Path

import pytest

from planish.cli.main import run

pytestmark = pytest.mark.slow

DOCS = Path(__file__).parent.parent / "docs"
SESSIONS = [
    (page, block.splitlines())
    for page in ("acquire.md", "acquire-laser.md")
    for block in re.findall(r"```console\n(planish acquire virtual (?!boards).+?)```", (DOCS / page).read_text(), re.S)
]


@pytest.mark.parametrize(("page", "lines"), SESSIONS, ids=[lines[0].split()[3] for _, lines in SESSIONS])
def test_a_session_ends_in_a_page_of_true_size(page, lines, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    *before, last = [shlex.split(line) for line in lines]
    assert last[:2] == ["planish", "restore"]
    for words in (*before, [*last, "--report", "report.json", "--dpi", "100"]):
        assert words[0] == "planish"
        assert run(words[1:]) == 0, (words, capsys.readouterr().err)
    found = json.loads(Path("report.json").read_text())["page"]
    # the page is 215.9 x 279.4 mm: where its sides are seen, and scale true to 0.5 %; up to two steps of the device
    # (6 mm for a small sweep) are lost at each side
    assert 202 < found["width_mm"] < 218
    assert 274 < found["height_mm"] < 281
