"""Pages that stand beside docs/ in the project become pages of the site, see mkdocs.yml."""

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


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add them to the site."""
    for name, place in PLACES.items():
        files.append(File.generated(config, place, abs_src_path=str(ROOT / name)))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Links from the project's top into docs/, and from there to the top, become links between pages of the site."""
    markdown = markdown.replace("](docs/", "](")
    for name, place in PLACES.items():
        for link in (name, f"../{name}"):
            markdown = markdown.replace(f"]({link})", f"]({place})").replace(f"]({link}#", f"]({place}#")
    return markdown
