"""The command that a message names where a library of an extra is missing."""

import sys
from importlib import metadata

from planish.errors import install_command


def test_it_names_the_packages_of_the_extra_and_no_others():
    command = install_command("web")
    assert command.startswith("pip install ")
    assert all(name in command for name in ("fastapi>=", "uvicorn>=", "python-multipart>=", "docstring-parser>="))
    assert "numpy" not in command
    assert "pycolmap" not in command


def test_where_pipx_installed_planish_it_is_pipx_that_adds_to_it(monkeypatch):
    monkeypatch.setattr(sys, "prefix", "/home/ann/.local/share/pipx/venvs/planish")
    assert install_command("ocr") == "pipx inject planish 'pytesseract>=0.3.13'"


def test_from_its_sources_it_is_the_extra(monkeypatch):
    def requires(name):
        raise metadata.PackageNotFoundError

    monkeypatch.setattr(metadata, "requires", requires)
    assert install_command("ocr") == "pip install 'planish[ocr]'"
