"""The notebooks in examples/: each runs from top to bottom, and is kept without what came of it."""

import re
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

EXAMPLES = Path(__file__).parent.parent / "examples"
NOTEBOOKS = sorted(EXAMPLES.glob("*.ipynb"))


def cells(notebook, kind):
    return [cell for cell in notebook.cells if cell.cell_type == kind]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_are_kept_without_what_came_of_them(path):
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    assert [cell for cell in cells(notebook, "code") if cell.outputs or cell.execution_count] == []


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_their_links_lead_somewhere(path):
    for cell in cells(nbformat.read(path, as_version=4), "markdown"):
        for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", cell.source):
            assert (EXAMPLES / target).exists(), target


@pytest.fixture(scope="module")
def came_of(tmp_path_factory):
    """By notebook, all that it printed or showed as text, and how many figures.

    They run in one kernel, whose imports take as long as a notebook; what one leaves behind is forgotten in between.
    """
    folder = tmp_path_factory.mktemp("notebooks")
    notebooks = {path.stem: nbformat.read(path, as_version=4) for path in NOTEBOOKS}
    joined = nbformat.v4.new_notebook()
    for one in notebooks.values():
        joined.cells += [nbformat.v4.new_code_cell("%reset -f"), *one.cells]
    with pytest.MonkeyPatch.context() as patch:
        for name in ("JUPYTER_RUNTIME_DIR", "IPYTHONDIR", "MPLCONFIGDIR", "TMPDIR"):
            patch.setenv(name, str(folder))
        NotebookClient(joined, timeout=300, kernel_name="python3", resources={"metadata": {"path": folder}}).execute()
    return {name: seen(cells(one, "code")) for name, one in notebooks.items()}


def seen(code):
    outputs = [output for cell in code for output in cell.outputs]
    shown = [output.get("data", {}) for output in outputs]
    text = [output.get("text", "") for output in outputs]
    text += [data.get("text/markdown", data.get("text/plain", "")) for data in shown]
    return "\n".join(text), sum("image/png" in data for data in shown)


@pytest.mark.slow
class TestRun:
    def test_a_scan_is_restored(self, came_of):
        text, figures = came_of["restore-a-scan"]
        assert figures == 2
        assert re.search(r"^good$", text, re.M)
        expected, true = (float(re.search(rf"^{word} +([\d.]+) mm", text, re.M)[1]) for word in ("expected", "true"))
        assert true < 0.05  # the noise of one point; the page averages over many
        assert true / 3 < expected < 3 * true
        assert "'letter.tif'" in text

    def test_the_papers_table(self, came_of):
        text, figures = came_of["the-papers-table-1"]
        assert figures == 3
        row = r"^\| ([\w ]+) \| (the paper's|the default) \| [\d,]+ \| \d+ \| [\d.]+ \| ([\d.]+) \|"
        rows = re.findall(row, text, re.M)
        assert len(rows) == 4
        rms = {(name, way): float(mm) for name, way, mm in rows}
        for name in {name for name, *_ in rows}:
            assert rms[name, "the default"] < rms[name, "the paper's"]

    def test_a_device_of_ones_own(self, came_of):
        text, figures = came_of["your-own-device"]
        assert figures == 1
        width, height = map(float, re.search(r"([\d.]+) x ([\d.]+) mm from", text).groups())
        # the sheet's 215.9 x 279.4 mm without up to a step of 1.5 mm at the end of its rows and columns
        assert 214 < width < 216
        assert 277.5 < height < 279.5
