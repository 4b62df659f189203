"""What the documentation says is held against the program."""

import importlib.util
import re
import tomllib
from pathlib import Path

import pytest

import planish
from planish import errors
from planish.cli.main import INTERRUPTED, NOT_GOOD, TERMINATED

ROOT = Path(__file__).parent.parent
PAGES = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")]
COMMAND_LINE = "".join(page.read_text() for page in PAGES if page.name.startswith("cli"))
LONGEST = 400
"""Lines of a page of the site: more want a topic of their own."""


def script(path):
    """A script of the project as a module."""
    spec = importlib.util.spec_from_file_location(Path(path).stem, ROOT / path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
@pytest.mark.parametrize("maker", ["make_cli", "make_man", "make_schema"])
def test_what_is_made_from_the_program_is_current(maker):
    for name, text in script(f"docs/{maker}.py").texts().items():
        assert (ROOT / "docs" / name).read_text() == text, f"run: python docs/{maker}.py"


def test_every_flag_in_the_prose_exists():
    flags = set(re.findall(r"--[a-z][a-z0-9.-]*", COMMAND_LINE))
    other_programs = {"--help", "--version", "--no-overwrite", *("--rm", "--user"), "--spec"}  # docker's, pipx's
    for page in PAGES:
        if page.name.startswith(("benchmarks", "CONTRIBUTING")):  # these call scripts with flags of their own
            continue
        found = set(re.findall(r"(?<![\w-])--[a-z][a-z0-9.-]*[a-z0-9]", page.read_text()))
        assert found <= flags | other_programs, (page.name, found - flags - other_programs)


def test_every_section_of_the_benchmarks_has_its_place():
    run_all = script("benchmarks/run_all.py")
    places = {name: page for page, (_, names) in run_all.PAGES.items() for name in names.split()}
    assert set(run_all.SECTIONS) <= set(places)
    for page in (ROOT / "docs").glob("benchmarks-*.md"):
        title, names = run_all.PAGES[page.name]
        kept = run_all.sections(page.read_text())
        assert page.read_text() == run_all.page_text(title, names, kept)  # nothing would be lost, or move


def test_exit_codes_in_the_docs_are_the_real_ones():
    text = (ROOT / "docs" / "errors.md").read_text()
    real = {cls.__name__: cls.exit_code for cls in errors.PlanishError.__subclasses__()}
    documented = {name: int(code) for code, name in re.findall(r"^\| (\d+) \|.*`(\w+Error)` \|$", text, re.M)}
    assert documented == real
    assert f"| {NOT_GOOD} |" in text
    assert f"| {INTERRUPTED} |" in text
    assert f"| {TERMINATED} |" in text


@pytest.mark.slow
def test_everything_named_for_python_users_can_be_had_and_is_explained():
    for name in planish.__all__:
        assert getattr(planish, name).__doc__, name
    assert set(planish.__all__) == set(planish._WHERE)
    with pytest.raises(AttributeError, match="no_such_thing"):
        planish.no_such_thing  # noqa: B018


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_links_between_pages_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", page.read_text()):
        if "://" not in target:
            assert (page.parent / target).exists(), target


def test_lists_and_tuples_have_no_flag_that_empties_them():
    assert "--empty-" not in COMMAND_LINE


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_pages_are_of_a_size_to_be_read(page):
    assert len(page.read_text().splitlines()) <= LONGEST


def test_the_version_is_the_same_everywhere():
    declared = re.search(r'^version = "(.+)"', (ROOT / "pyproject.toml").read_text(), re.M)
    assert declared.group(1) == planish.__version__


def test_every_extra_is_explained():
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    explained = re.findall(r"^\| `planish\[(\w+)\]` \|", (ROOT / "docs" / "install.md").read_text(), re.M)
    assert set(explained) == set(declared)


def test_every_name_for_python_users_is_in_the_reference():
    shown = re.findall(r"^::: planish\.(\w+)$", (ROOT / "docs" / "api.md").read_text(), re.M)
    assert set(shown) == set(planish.__all__)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_no_page_names_an_entry_of_the_package_index_that_does_not_exist(page):
    """Until planish is there, it is installed from a clone or a wheel; `pipx inject planish X` puts X beside it."""
    for arguments in re.findall(r"\bpipx? (?:install|run)\b([^#`\n|]*)", page.read_text()):
        assert not re.search(r"""(^|[\s'"])planish(\[|[\s'"]|$)(?!.*--spec)""", arguments.split(" planish demo")[0]), (
            arguments
        )


def test_the_architecture_names_every_room_and_only_files_that_exist():
    source, text = ROOT / "src" / "planish", (ROOT / "docs" / "architecture.md").read_text()
    cells = re.findall(r"^\| ((?:`\w+`(?:, )?)+) \|", text, re.M)
    named = {name for cell in cells for name in re.findall(r"`(\w+)`", cell)}
    rooms = {p.name for p in source.iterdir() if (p / "__init__.py").exists()}
    rooms |= {p.stem for p in source.glob("*.py") if not p.stem.startswith("_")}
    assert named == rooms
    for path in re.findall(r"`(\w+(?:/\w+)*(?:/\w+\.py|\.py))`", text):
        assert (source / path).exists(), path


def test_the_glossary_is_in_order():
    terms = re.findall(r"^\| ([^|]+) \|", (ROOT / "docs" / "glossary.md").read_text(), re.M)[1:]
    terms = [term for term in terms if not term.startswith("---")]
    assert terms == sorted(terms)
