"""The suite itself: nothing reaches for the network."""

import socket

import pytest


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
