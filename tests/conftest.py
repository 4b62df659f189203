"""What holds for every test: the same examples on every run, no network, compiled kernels shared by all processes."""

import ipaddress
import socket
import sys
from collections import Counter

import pytest
from hypothesis import settings

import planish
from captures import DATA
from planish.gallery import sheet, virtual_scan
from planish.job.warm_up import lock_kernel_cache

# A red run can be repeated; no deadline, as kernels compile on first use.
settings.register_profile("planish", derandomize=True, deadline=None)
settings.load_profile("planish")


collect_ignore = ["without_posix"]  # changes the Python that imports it


def pytest_configure():
    lock_kernel_cache()


def pytest_collection_modifyitems(items):
    """Files with the most slow tests come first, so that no process is left with one of them at the end."""
    slow = Counter(item.path for item in items if item.get_closest_marker("slow"))
    items.sort(key=lambda item: -slow[item.path])


def pytest_runtest_setup(item):
    for marker in item.iter_markers("shared"):
        folder = DATA.joinpath(*marker.args)
        if not folder.exists():
            pytest.skip(f"needs real captures, which are no part of the project: {folder} does not exist")


@pytest.fixture(scope="session")
def book_scan():
    """The virtual scan of a book's page, small and without noise; scans take seconds, and this one does for many."""
    return virtual_scan(sheet("book"), points=4000, photo_px=(1000, 750))


@pytest.fixture(scope="session")
def restored_book(book_scan):
    """What `restore` makes of it."""
    return planish.restore(book_scan.scan)


@pytest.fixture(scope="module")
def corners_found_once():
    """Detect the corners of a board once in each photo: it takes a second, and tests show the same photos again."""
    from planish.acquire.calibration import boards, camera
    from planish.acquire.laser import board as laser_board

    found = {}

    def find_corners(board, photo):
        key = repr(board), photo.shape, photo.tobytes()
        if key not in found:
            found[key] = boards.find_corners(board, photo)
        return found[key]

    with pytest.MonkeyPatch.context() as patch:
        for module in (camera, laser_board):
            patch.setattr(module, "find_corners", find_corners)
        yield


# No network ----------------------------------------------------------------------------------------------------------


class NetworkError(BaseException):
    """A test reached for the network; no `except Exception` or `except OSError` hides it."""


WATCHED = {"socket.connect": 1, "socket.sendto": 1, "socket.getaddrinfo": 0, "socket.gethostbyname": 0}
"""Audit events of Python's sockets, and which of their arguments names the other side."""


@pytest.fixture(scope="session", autouse=True)
def no_network():
    """Let sockets reach this machine alone, here and in programs that are started from here and heed a proxy."""
    watching = True

    def watch(event, arguments):
        if watching and event in WATCHED and not _is_here(event, arguments):
            raise NetworkError(f"a test reached for the network: {event} {arguments[WATCHED[event]]}")

    sys.addaudithook(watch)  # it stays for as long as the process does
    with pytest.MonkeyPatch.context() as patch:
        for name in ("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"):
            patch.setenv(name, "http://127.0.0.1:9")  # nobody listens there
        for name in ("no_proxy", "NO_PROXY"):
            patch.setenv(name, "127.0.0.1,localhost")
        yield
    watching = False


def _is_here(event, arguments):
    address = arguments[WATCHED[event]]
    if event == "socket.connect" and arguments[0].type == socket.SOCK_DGRAM:
        return True  # sends nothing; Dask asks so for its own address
    host = address[0] if isinstance(address, tuple) else address
    if not isinstance(host, str) or host in ("", "localhost", socket.gethostname()) or host.startswith("/"):
        return True  # None and bytes: any own address, or a socket in the file system
    try:
        return ipaddress.ip_address(host).is_loopback or ipaddress.ip_address(host).is_unspecified
    except ValueError:
        return False  # a name that somebody else would have to be asked for
