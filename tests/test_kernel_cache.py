"""Where kernels are kept if neither the package nor the home folder can be written."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from planish import kernel_cache
from planish.kernel_cache import VARIABLE, use_writable_kernel_cache

NOWHERE = Path("/dev/null/planish")  # a folder that even root cannot make

pytestmark = pytest.mark.skipif(os.name != "posix", reason="elsewhere the home folder can be written")


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """No home, and a folder for temporary files."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr(kernel_cache, "made", None)
    monkeypatch.setenv("HOME", str(NOWHERE))
    for name in (VARIABLE, "XDG_CACHE_HOME"):
        monkeypatch.setenv(name, "")
    monkeypatch.delitem(sys.modules, "numba")
    return tmp_path


def test_where_the_package_or_the_home_can_be_written_nothing_changes(temporary, monkeypatch):
    assert use_writable_kernel_cache(temporary) is None
    monkeypatch.setenv("HOME", str(temporary))
    assert use_writable_kernel_cache(NOWHERE) is None
    monkeypatch.setenv("HOME", str(NOWHERE))
    monkeypatch.setenv("XDG_CACHE_HOME", str(temporary / "new"))
    assert use_writable_kernel_cache(NOWHERE) is None
    assert not os.environ[VARIABLE]


def test_a_private_folder_is_made_once(temporary, monkeypatch):
    folder = use_writable_kernel_cache(NOWHERE)
    assert (folder.parent, folder.stat().st_mode & 0o777) == (temporary, 0o700)
    assert os.environ[VARIABLE] == str(folder)
    assert kernel_cache.made == folder
    monkeypatch.setenv(VARIABLE, "")
    monkeypatch.setattr(kernel_cache, "made", None)
    assert use_writable_kernel_cache(NOWHERE) == folder
    assert kernel_cache.made is None  # so that there is no second note


@pytest.mark.parametrize("trap", ["open", "link"])
def test_a_folder_that_others_could_fill_is_not_used(temporary, trap):
    name = temporary / f"planish-kernels-{os.getuid()}"
    if trap == "open":
        name.mkdir()
        name.chmod(0o777)
    else:
        (temporary / "elsewhere").mkdir(mode=0o700)
        name.symlink_to(temporary / "elsewhere")
    folder = use_writable_kernel_cache(NOWHERE)
    assert folder != name
    assert folder.stat().st_mode & 0o777 == 0o700
    assert not list(name.iterdir())


def test_kernels_are_defined_on_read_only_disks(tmp_path):
    """Numba refuses to define a kernel that it can keep nowhere."""
    code = f"""
import os, sys, tempfile
tempfile.tempdir = {str(tmp_path)!r}
can, opened = os.access, tempfile.TemporaryFile
os.access = lambda path, *more: str(path).startswith(tempfile.tempdir) and can(path, *more)
def temporary_file(*more, dir=None, **how):
    if not str(dir).startswith(tempfile.tempdir):
        raise PermissionError(30, "Read-only file system")
    return opened(*more, dir=dir, **how)
tempfile.TemporaryFile = temporary_file
import planish, planish.mesh.measures
print(os.environ["{VARIABLE}"])
"""
    environment = {**os.environ, VARIABLE: ""}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert Path(done.stdout.strip()).parent == tmp_path
