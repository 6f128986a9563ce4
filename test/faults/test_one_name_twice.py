"""Two nodes of one name are told of each other, in the log and in the diagnostics, and both go on."""

from __future__ import annotations

import signal

from live import LiveNode
from load_session import Session


def test_two_nodes_of_one_name_both_say_so_and_go_on(tmp_path):
    with Session(tmp_path, scene="single_spring") as session:
        assert session.health()["name"]["level"] == 0
        second = LiveNode(tmp_path / "second.log", session.domain, scene="single_spring")
        try:
            session.user.until(lambda: session.health()["name"]["level"] == 1, 15.0)
            session.user.until(lambda: "2 nodes are named /ldcs/ldcs_sim" in second.output, 10.0)
        finally:
            assert second.stop(signal.SIGINT) == 0
        session.user.until(lambda: session.health()["name"]["level"] == 0, 10.0)
        assert session.node.output.count("2 nodes are named /ldcs/ldcs_sim") == 1
