"""The suite itself: nothing reaches for the network, and the quick part of it reaches every room."""

import ast
import re
import socket
from pathlib import Path

import pytest

HERE = Path(__file__).parent
ROOMS = sorted(path.parent.name for path in (HERE.parent / "src" / "planish").glob("*/__init__.py"))


def connect(address, kind=socket.SOCK_STREAM):
    with socket.socket(socket.AF_INET, kind) as door:
        door.settimeout(1)
        door.connect(address)


def refused(call, *arguments):
    with pytest.raises(BaseException, match="a test reached for the network") as caught:
        call(*arguments)
    return not isinstance(caught.value, Exception)


def test_the_network_is_out_of_reach():
    assert refused(connect, ("192.0.2.1", 80))  # a documentation address, RFC 5737
    assert refused(socket.getaddrinfo, "planish.readthedocs.io", 443)
    assert refused(socket.gethostbyname, "planish.readthedocs.io")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as door:
        assert refused(door.sendto, b"", ("192.0.2.1", 9))


def test_this_machine_is_within_reach():
    with socket.create_server(("127.0.0.1", 0)) as server:
        connect(server.getsockname())
        assert socket.getaddrinfo("localhost", server.getsockname()[1])


BY_ANOTHER = {"display": "test_show.py"}
"""Rooms that tests reach through another room alone."""


def has_quick_tests(path):
    """Whether some test of a file stays when slow ones are left out."""
    nodes = list(ast.walk(ast.parse(path.read_text())))
    marks = [ast.unparse(node.value) for node in nodes if isinstance(node, ast.Assign)]
    tests = [node for node in nodes if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")]
    slow = [node for node in tests if "pytest.mark.slow" in map(ast.unparse, node.decorator_list)]
    return "pytest.mark.slow" not in marks and len(tests) > len(slow)


@pytest.mark.parametrize("room", ROOMS)
def test_every_room_has_quick_tests(room):
    users = [path for path in HERE.glob("test_*.py") if re.search(rf"\bplanish\.{room}\b", path.read_text())]
    users += [HERE / BY_ANOTHER[room]] if room in BY_ANOTHER else []
    assert any(map(has_quick_tests, users)), f"make quick would not notice a fault in {room}"
