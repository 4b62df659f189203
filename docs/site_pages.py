"""Pages that stand beside docs/ in the project become pages of the site, and notebooks too, see mkdocs.yml."""

import json
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parent.parent
PLACES = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "SECURITY.md": "security.md",
    "CODE_OF_CONDUCT.md": "code-of-conduct.md",
}
NOTEBOOKS = {f"examples/{path.name}": f"examples/{path.stem}.md" for path in (ROOT / "examples").glob("*.ipynb")}


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add them to the site; notebooks as pages to read, and as they are to be taken away."""
    for name, place in PLACES.items():
        files.append(File.generated(config, place, abs_src_path=str(ROOT / name)))
    for name, place in NOTEBOOKS.items():
        files.append(File.generated(config, name, abs_src_path=str(ROOT / name)))
        files.append(File.generated(config, place, content=notebook_page(ROOT / name)))
    return files


def notebook_page(path: Path) -> str:
    """The cells of a notebook, one below the other."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    parts = ["".join(cell["source"]) for cell in cells]
    blocks = [
        part if cell["cell_type"] == "markdown" else f"```python\n{part}\n```"
        for cell, part in zip(cells, parts, strict=True)
    ]
    return "\n\n".join([blocks[0], f"[The notebook itself]({path.name})", *blocks[1:]]) + "\n"


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Links from the top and from examples/ into docs/, and from docs/ out of it, become links within the site."""
    markdown = markdown.replace("](docs/", "](").replace("](../docs/", "](../")
    for name, place in (PLACES | NOTEBOOKS).items():
        for link in (name, f"../{name}"):
            markdown = markdown.replace(f"]({link})", f"]({place})").replace(f"]({link}#", f"]({place}#")
    return markdown
