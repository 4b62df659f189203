"""What is handed out: the wheel and the source distribution."""

import os
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from email import message_from_bytes
from pathlib import Path

import pytest
from build import ProjectBuilder

ROOT = Path(__file__).parent.parent
NOT_HANDED_OUT = re.compile(r"\.(ci|github|pre-commit-config|dockerignore|readthedocs)|Dockerfile")
"""Files of the project's own workshop, not needed to build, test or read it."""


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The source distribution, unpacked; the wheel made from it; and the wheel made from the tree."""
    out = tmp_path_factory.mktemp("dist")
    builder = ProjectBuilder(ROOT, runner=quietly)
    with tarfile.open(builder.build("sdist", out / "sdist")) as packed:
        packed.extractall(out, **({"filter": "data"} if hasattr(tarfile, "data_filter") else {}))  # not in 3.11.2
    (unpacked,) = out.glob("planish-*")
    from_tree = Path(builder.build("wheel", out / "tree"))
    from_sdist = Path(ProjectBuilder(unpacked, runner=quietly).build("wheel", out / "again"))
    return unpacked, from_sdist, from_tree


def quietly(command, cwd=None, extra_environ=None):
    subprocess.run(command, cwd=cwd, env={**os.environ, **(extra_environ or {})}, check=True, capture_output=True)


def names(wheel):
    with zipfile.ZipFile(wheel) as packed:
        return set(packed.namelist())


@pytest.fixture
def metadata(built):
    with zipfile.ZipFile(built[1]) as packed:
        (name,) = (name for name in packed.namelist() if name.endswith(".dist-info/METADATA"))
        return message_from_bytes(packed.read(name))


@pytest.mark.slow
def test_the_source_distribution_makes_the_same_wheel_byte_for_byte(built):
    _, from_sdist, from_tree = built
    assert from_sdist.name == from_tree.name
    assert from_sdist.read_bytes() == from_tree.read_bytes()


@pytest.mark.slow
def test_the_source_distribution_has_every_file_of_the_project(built):
    if not (ROOT / ".git").exists():
        pytest.skip("this is not a clone")
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    tracked = {name for name in listed.splitlines() if (ROOT / name).exists() and not NOT_HANDED_OUT.match(name)}
    assert {name for name in tracked if not (built[0] / name).exists()} == set()


def test_the_wheel_has_the_package_its_types_its_schema_and_its_manual_page(built):
    found = names(built[1])
    modules = {str(path.relative_to(ROOT / "src")) for path in (ROOT / "src" / "planish").rglob("*.py")}
    assert modules <= found
    assert {"planish/py.typed", "planish/report.schema.json"} <= found
    assert any(name.endswith(".data/data/share/man/man1/planish.1") for name in found)
    assert any(name.endswith(".dist-info/licenses/LICENSE") for name in found)


def test_the_wheel_has_nothing_else(built):
    for name in names(built[1]):
        assert name.startswith(("planish/", "planish-")), name
        assert not re.search(r"node_modules|__pycache__|/tests?/|\.(ts|mjs|nb[ic]|pyc)$", name), name


def test_any_python_may_take_the_wheel(built):
    assert built[1].name.endswith("-py3-none-any.whl")


def test_the_metadata_says_what_the_project_is(metadata):
    assert metadata["License-Expression"] == "Apache-2.0"
    assert "Typing :: Typed" in metadata.get_all("Classifier")
    assert metadata["Description-Content-Type"] == "text/markdown"
    extras = set(metadata.get_all("Provides-Extra"))
    asked_for = set()
    for path in (ROOT / "src" / "planish").rglob("*.py"):
        asked_for |= set(re.findall(r"pip install 'planish\[(\w+)\]'", path.read_text()))
    assert asked_for <= extras  # whatever a message tells a user to install


def test_the_description_has_no_link_into_the_tree(metadata):
    links = re.findall(r"\]\(([^)]+)\)", metadata.get_payload())
    assert len(links) > 10
    assert [link for link in links if not link.startswith("https://")] == []


def test_the_wheel_runs_where_it_is_unpacked(built, tmp_path):
    with zipfile.ZipFile(built[1]) as packed:
        packed.extractall(tmp_path)
    script = "import runpy, sys; sys.path.insert(0, sys.argv.pop(1)); runpy.run_module('planish', run_name='__main__')"
    command = [sys.executable, "-I", "-c", script, str(tmp_path), "--version"]
    said = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert said.strip() == re.search(r"planish-([\d.]+)-py3", built[1].name)[1]


def test_the_citation_names_the_version_and_the_licence_of_the_project():
    citation = (ROOT / "CITATION.cff").read_text()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    lines = citation.splitlines()
    assert f"version: {project['version']}" in lines
    assert f"license: {project['license']}" in lines
