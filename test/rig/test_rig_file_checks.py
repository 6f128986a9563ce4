"""A rig file that cannot keep the promise is refused at load, with one line that names key, value and expectation."""

from __future__ import annotations

import pytest

from ldcs_ros.errors import BridgeError
from ldcs_ros.rig.rig_file import load_rig, shipped_rigs

LIMITS = {
    "pressure": 120e3,
    "slew": 400e3,
    "vent_ramp": 0.3,
    "vent_time": 1.0,
    "command_timeout": 0.4,
    "rig_timeout": 0.4,
}
MODBUS = {"type": "modbus", "host": "127.0.0.1", "setpoint": 0, "actual": 0}
SERIAL = {"type": "serial", "port": "/dev/ttyUSB0"}
TOPICS = {
    "type": "topics",
    "receive": [
        {"topic": "/p", "type": "sensor_msgs/msg/FluidPressure", "gives": "pressure", "names": ["left"]},
    ],
    "send": {"topic": "/c"},
}


def rig(link, **limits):
    """Return the rig of one link with changed limits."""
    return load_rig({"limits": {**LIMITS, **limits}, "links": [link]})


REFUSED = [
    (MODBUS, {"heartbeat": 0}, "heartbeat", "setpoint's"),
    (MODBUS, {"heartbeat": 1}, "heartbeat", "setpoint's"),
    (MODBUS, {"clock": 0}, "clock", "actual's"),
    (MODBUS, {"clock": 1}, "clock", "actual's"),
    (MODBUS, {"actual": 10, "clock": 9}, "clock", "actual's"),
    (MODBUS, {"setpoint": 65535}, "setpoint", "0 ... 65534"),
    (MODBUS, {"setpoint": -1}, "setpoint", "0 ... 65534"),
    (MODBUS, {"actual": 65536}, "actual", "0 ... 65534"),
    (MODBUS, {"clock": 65535}, "clock", "-1 for none"),
    (MODBUS, {"heartbeat": 65536}, "heartbeat", "-1 for none"),
    (MODBUS, {"port": 0}, "port", "1 ... 65535"),
    (MODBUS, {"port": 70000}, "port", "1 ... 65535"),
    (MODBUS, {"device": 248}, "device", "0 ... 247, or 255"),
    (MODBUS, {"device": 300}, "device", "0 ... 247, or 255"),
    (MODBUS, {"device": -1}, "device", "0 ... 247, or 255"),
    (MODBUS, {"host": " "}, "host", "a host name"),
    (MODBUS, {"rate": 0.001}, "rate", "10 ... 1000 Hz"),
    (MODBUS, {"rate": 0.2}, "rate", "10 ... 1000 Hz"),
    (MODBUS, {"rate": 9.9}, "rate", "10 ... 1000 Hz"),
    (MODBUS, {"rate": 1001.0}, "rate", "10 ... 1000 Hz"),
    (MODBUS, {"timeout": 0.21}, "timeout", "0.2 s"),
    (MODBUS, {"unit": "Pa"}, "unit", "32767"),
    (MODBUS, {"unit": "mbar", "reference": "absolute", "setpoint": "0"}, "setpoint", "number"),
    (MODBUS, {"unit": "bar", "hearbeat": 3}, "links[0]", "unknown key"),
    (SERIAL, {"baud": -1}, "baud", "115200"),
    (SERIAL, {"baud": 115201}, "baud", "115200"),
    (SERIAL, {"baud": 9600}, "rate", "at most 15 Hz at 9600 baud"),
    (TOPICS, {"rate": 5.0}, "rate", "10 ... 1000 Hz"),
]


@pytest.mark.parametrize(("link", "change", "key", "words"), REFUSED)
def test_a_link_outside_of_its_ranges_is_refused_in_one_line(link, change, key, words):
    with pytest.raises(BridgeError) as refusal:
        rig({**link, **change})
    line = str(refusal.value)
    assert "\n" not in line and key in line and words in line and "links[0]" in line


@pytest.mark.parametrize(
    "change",
    [
        {"heartbeat": 2, "clock": 2},
        {"heartbeat": 65535, "clock": 65534},
        {"setpoint": 65534, "actual": 65534},
        {"device": 0},
        {"device": 247},
        {"device": 255},
        {"port": 1},
        {"port": 65535},
        {"rate": 10.0},
        {"timeout": 0.2},
    ],
)
def test_the_ends_of_each_range_are_accepted(change):
    assert rig({**MODBUS, **change}).links


def test_the_largest_pressure_fits_a_register_of_15_bits_and_one_more_does_not():
    assert rig({**MODBUS, "unit": "Pa"}, pressure=32767.0).links
    with pytest.raises(BridgeError, match="32767"):
        rig({**MODBUS, "unit": "Pa"}, pressure=32768.0)


def test_the_vent_time_holds_ramp_valve_and_two_exchanges():
    assert rig({**MODBUS, "rate": 50.0}, vent_time=0.45).links
    with pytest.raises(BridgeError, match=r"vent_ramp 0.3 \+ valve 0.1 .* @ limits.vent_time"):
        rig({**MODBUS, "rate": 50.0}, vent_time=0.43)


def test_shorter_timeouts_ask_for_a_faster_exchange():
    with pytest.raises(BridgeError, match=r"20 ... 1000 Hz"):
        rig({**MODBUS, "rate": 15.0, "timeout": 0.1}, command_timeout=0.2)
    assert rig({**MODBUS, "rate": 20.0, "timeout": 0.1}, command_timeout=0.2).links


@pytest.mark.parametrize("name", shipped_rigs())
def test_the_shipped_rig_files_keep_the_promise(name):
    assert load_rig(name).links


def test_mock_rigs_in_two_namespaces_share_no_topic():
    from ldcs_ros import load_scene
    from ldcs_ros.mock_rig.rig import Hidden, MockRig, hidden_scene
    from ldcs_ros.mock_rig.topics import Topics

    rig = MockRig(hidden_scene(load_scene("rig"), Hidden()), clock=lambda: 0.0)
    root, left = (Topics(rig, lambda *message: None, namespace=name) for name in ("", "/left"))
    assert set(left.outgoing()) == {f"/left{topic}" for topic in root.outgoing()}
    assert {one["topic"] for one in left.describe()["receive"]} == set(left.outgoing())
    assert left.describe()["send"]["topic"] == left.command == "/left/rig/pressure_command"
    assert root.tracker == "/rig/trakstar_msg"
