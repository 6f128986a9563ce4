"""Random messages to every input, random calls of every service, random parameters: nothing falls over or is lost.

What is checked: the node lives and answers every call; at every halt applied + refused (+ missed) is what was sent;
every accepted command is in a bag, byte for byte; every bag is whole and replays to the same bytes; no traceback.
"""

from __future__ import annotations

import signal
import time
from collections import Counter
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from random import Random

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from load_session import NODE, Session, counts
from load_tables import row
from random_messages import TEXTS, fill, number
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from sent_messages import INPUTS, Sender

from ldcs_ros.bags import read_bag
from ldcs_ros.replay.session import replay
from ldcs_ros.ros.sim.parameters import PARAMETERS
from ldcs_ros.twin.commands import REASONS

HALT_PERIOD = 10.0
ROUND_PERIOD = 45.0
CALL_TIMEOUT = 20.0
LONG_RUN_DOMAIN = 232
"""Beyond those that tests take."""
IN_BAGS = ("pressure_command", "torque_command", "external_wrench")
QUITTING = 3
DOWN = (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP)
UP = (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE)


@dataclass
class Tally:
    """What happened.

    Attributes:
        sent: Messages sent, by topic.
        applied: Of those, applied.
        refused: Refused, by reason.
        accepted: Applied, by topic.
        missed: Overwritten in a full queue.
        halts: How often it was counted.
        wrong_halts: Halts at which the sum was not what had been sent.
        calls: Calls of services, by name.
        unanswered: Calls without an answer, by name.
        rounds: Journeys through the states of the lifecycle.
        bytes_sent: Every message, to find it again.
    """

    sent: Counter[str] = field(default_factory=Counter)
    applied: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    accepted: Counter[str] = field(default_factory=Counter)
    missed: int = 0
    halts: int = 0
    wrong_halts: list[str] = field(default_factory=list)
    calls: Counter[str] = field(default_factory=Counter)
    unanswered: Counter[str] = field(default_factory=Counter)
    rounds: int = 0
    bytes_sent: set[bytes] = field(default_factory=set)


class Fuzzer:
    """Torments a node.

    Args:
        session: The node.
        seed: Seed of everything that is drawn.
    """

    def __init__(self, session: Session, seed: int) -> None:
        self.tally = Tally()
        self.bags = [session.bag]
        self._session = session
        self._random = Random(seed)
        # Of its own: the k-th message of a seed is the same in every run, whatever the timing.
        self._sender = Sender(Random(seed))
        self._epoch = 0
        self._counted: dict[str, str] = {}
        self._clients: dict[str, tuple[object, type]] = {}
        self._pending: list[tuple[str, float, object]] = []
        self._join()

    def run(self, seconds: float) -> None:
        """Go on for a wall time [s], then halt."""
        end = time.monotonic() + seconds
        halt = time.monotonic() + HALT_PERIOD
        journey = time.monotonic() + min(ROUND_PERIOD, seconds / 2)
        while time.monotonic() < end:
            for _ in range(self._random.randint(1, 60)):
                self._send()
            if self._random.random() < 0.3:
                self._call()
            if self._random.random() < 0.1:
                self._set_parameters()
            self._session.user.spin(self._random.choice((0.0, 0.01, 0.05, 0.2)))
            self._collect()
            if time.monotonic() > halt:
                self._halt()
                halt = time.monotonic() + HALT_PERIOD
            if time.monotonic() > journey:
                self._journey()
                journey = time.monotonic() + ROUND_PERIOD
        self._halt(go_on=False)
        self._close_epoch()

    def _join(self) -> None:
        kinds = {name: kind.replace("/", "/msg/") for name, kind in INPUTS.items()}
        self._publishers = {name: self._session.publisher(name, kind) for name, kind in kinds.items()}
        self._discover()

    def _discover(self) -> None:
        found = self._session.user.node.get_service_names_and_types_by_node(*reversed(NODE.rsplit("/", 1)))
        for name, (kind,) in found:
            package, group, service = kind.split("/")
            if name in self._clients or group != "srv" or name.endswith(("/change_state", "set_parameters")):
                continue
            try:
                service_class = getattr(import_module(f"{package}.srv"), service)
            except ImportError:
                continue
            client = self._session.user.node.create_client(service_class, name)
            self._clients[name] = (client, service_class)

    def _send(self) -> None:
        topic, cdr = self._sender.draw()
        self._publishers[topic].publish(cdr)
        self.tally.sent[topic] += 1
        self.tally.bytes_sent.add(cdr)
        self._epoch += 1

    def _call(self) -> None:
        name = self._random.choice(list(self._clients))
        client, service = self._clients[name]
        if len(self._pending) > 5 or not client.service_is_ready():
            return
        if name.endswith(("/reset", "/reset_simulation")):
            self._sender.start_over()
        self._begin(name, client, self._request(name, service))

    def _request(self, name: str, service):
        request = fill(self._random, service.Request(), (*TEXTS, *PARAMETERS))
        if name.endswith("/set_simulation_state") and request.state.state == QUITTING:
            request.state.state = 0  # it would end the run, as it should
        if name.endswith("/step_simulation"):
            request.steps %= 10  # more would take years, as it should
        return request

    def _set_parameters(self) -> None:
        service = self._random.choice((SetParameters, SetParametersAtomically))
        name = f"{NODE}/set_parameters{'_atomically' if service is SetParametersAtomically else ''}"
        client, _ = self._clients.setdefault(
            f"{name} (drawn)", (self._session.user.node.create_client(service, name), service)
        )
        changes = [self._parameter() for _ in range(self._random.randint(0, 4))]
        self._begin(name, client, service.Request(parameters=changes))

    def _parameter(self) -> Parameter:
        random = self._random
        name = random.choice(
            (*PARAMETERS, "use_sim_time", "", "no_such", "qos_overrides./ldcs/nodes.publisher.depth")
        )
        if random.random() < 0.5 and name in ("real_time_factor", "command_timeout", "wrench_timeout"):
            bounds = (0.2, 3.0) if name == "real_time_factor" else (0.0, 2.0)
            return _double(name, random.uniform(*bounds))
        value = fill(random, ParameterValue())
        if (
            name == "duration"
            and value.type == ParameterType.PARAMETER_DOUBLE
            and 0.0 < value.double_value <= 1e9
        ):
            value.double_value = 0.0  # it would end the run, as it should
        if name == "real_time_factor" and value.type == ParameterType.PARAMETER_DOUBLE:
            value.double_value = number(random)
        return Parameter(name=name, value=value)

    def _begin(self, name: str, client, request) -> None:
        self.tally.calls[name] += 1
        self._pending.append((name, time.monotonic() + CALL_TIMEOUT, client.call_async(request)))

    def _collect(self) -> None:
        now, waiting = time.monotonic(), []
        for name, end, future in self._pending:
            if not future.done() and now < end:
                waiting.append((name, end, future))
            elif not future.done():
                self.tally.unanswered[name] += 1
            elif name.endswith("/apply_wrench"):
                self._count_answer("apply_wrench", future.result())
        self._pending = waiting

    def _count_answer(self, what: str, answer) -> None:
        # Counted like a message, unless the node was in no state to look at it.
        if answer.success or answer.message.partition(":")[0] in REASONS:
            self.tally.sent[what] += 1
            self._epoch += 1

    def _finish_calls(self) -> None:
        while self._pending:
            self._session.user.spin(0.02)
            self._collect()

    def _halt(self, *, go_on: bool = True) -> None:
        # With the pace of real time, and awake: whatever was drawn before.
        self._finish_calls()
        self._set(_double("real_time_factor", 1.0))
        health = self._session.settled(self._epoch)
        self._counted = health["commands"]
        self.tally.halts += 1
        applied, refused, missed = counts(health)
        if applied + refused + missed != self._epoch:
            self.tally.wrong_halts.append(f"{applied} + {refused} + {missed} of {self._epoch}")
        if go_on:
            self._resume()

    def _resume(self) -> None:
        for name in ("reset", "resume", "rearm") if self._random.random() < 0.3 else ("resume", "rearm"):
            if name == "reset":
                self._sender.start_over()
            client, service = self._clients[f"{NODE}/{name}"]
            self._begin(name, client, service.Request())
            self._finish_calls()

    def _set(self, *changes: Parameter) -> None:
        request = SetParameters.Request(parameters=list(changes))
        self._session.user.call(f"{NODE}/set_parameters", SetParameters, request)

    def _close_epoch(self) -> None:
        commands = self._counted
        for key, value in commands.items():
            kind, _, what = key.partition(", ")
            if kind == "accepted" and what:
                self.tally.accepted[what] += int(value)
            elif kind == "refused" and what:
                self.tally.refused[what] += int(value)
        self.tally.applied += int(commands["accepted"])
        self.tally.missed += int(commands["missed, queue full"])
        self._epoch = 0

    def _journey(self) -> None:
        """Down to unconfigured and up again, with calls of services in each state, into a new bag."""
        self._halt(go_on=False)
        self._close_epoch()
        self.tally.rounds += 1
        for transition in DOWN:
            self._change(transition)
            self._call_each()
        self.bags.append(self._session.folder / f"bag_round{self.tally.rounds}")
        text = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=str(self.bags[-1]))
        self._set(Parameter(name="record", value=text))
        self._change(UP[0])
        self._call_each()
        self._change(UP[1])
        self._sender.start_over()
        for publisher in self._publishers.values():
            self._session.user.until(lambda publisher=publisher: publisher.get_subscription_count() > 0)

    def _change(self, transition: int) -> None:
        request = ChangeState.Request(transition=Transition(id=transition))
        answer = self._session.user.call(f"{NODE}/change_state", ChangeState, request)
        if not answer.success:
            self.tally.wrong_halts.append(f"transition {transition} refused")

    def _call_each(self) -> None:
        for name, (client, service) in self._clients.items():
            if client.service_is_ready() and not name.endswith("(drawn)"):
                self._begin(name, client, self._request(name, service))
        self._finish_calls()


def _double(name: str, value: float) -> Parameter:
    number_value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)
    return Parameter(name=name, value=number_value)


def fuzz(folder, *, seconds, seed=7, scene="rig", publish_rate=50.0, domain=None):
    """Torment a node for a wall time [s]; return the tally, what the bags hold, and what the process did."""
    with Session(
        folder, domain=domain, scene=scene, publish_rate=publish_rate, record="bag", graph_folder=folder
    ) as session:
        fuzzer = Fuzzer(session, seed)
        memory = session.figures.memory
        fuzzer.run(seconds)
        grown = session.figures.memory - memory
        alive = session.node.process.poll() is None
        status = session.node.stop(signal.SIGINT)
        log = session.node.output
    process = {"alive": alive, "exit status": status, "grown": grown, "tracebacks": log.count("Traceback")}
    return fuzzer.tally, process, bags_of(folder, fuzzer.tally)


def rows(folder, tell, *, seconds=600.0, seed=7):
    """Torment and judge."""
    tell(
        f"seed {seed}: {seconds:g} s of random messages, services and parameters, then a replay of every bag"
    )
    tally, process, bags = fuzz(folder, seconds=seconds, seed=seed, domain=LONG_RUN_DOMAIN)
    sent, refused = tally.sent.total(), tally.refused.total()
    sums = f"{tally.applied} + {refused} + {tally.missed}"
    recorded = {topic: (tally.accepted[topic], bags["found"][topic]) for topic in IN_BAGS}
    reasons = ", ".join(f"{reason} {count}" for reason, count in tally.refused.most_common())
    calls = f"{tally.calls.total()} of {len(tally.calls)} services"
    wrong, unanswered = tally.wrong_halts, dict(tally.unanswered)
    return [
        row("messages sent", ", ".join(f"{k} {v}" for k, v in tally.sent.items()), "", True),
        row(
            "applied + refused + missed",
            sums,
            f"{sent}, as sent",
            tally.applied + refused + tally.missed == sent,
        ),
        row("missed: overwritten in a full queue", tally.missed, "0", tally.missed == 0),
        row("refused, by reason", reasons, "", True),
        row(
            "halts at which the sum was wrong", f"{len(wrong)} of {tally.halts} {wrong or ''}", "0", not wrong
        ),
        row("services called with random requests", calls, "", True),
        row("calls without an answer", f"{tally.unanswered.total()} {unanswered or ''}", "0", not unanswered),
        row("journeys down to unconfigured and up again", tally.rounds, "", True),
        *(
            row(f"{topic}: accepted, found in the bags", pair, "the same", pair[0] == pair[1])
            for topic, pair in recorded.items()
        ),
        row("bags, messages in them", f"{bags['bags']}, {bags['messages']}", "", True),
        row("bags that cannot be read", bags["unreadable"] or 0, "0", not bags["unreadable"]),
        row("bags that do not replay to the same bytes", bags["differing"] or 0, "0", not bags["differing"]),
        row("the node", "alive" if process["alive"] else "dead", "alive", process["alive"]),
        row("exit status after Ctrl-C", process["exit status"], "0", process["exit status"] == 0),
        row("tracebacks in its log", process["tracebacks"], "0", process["tracebacks"] == 0),
        row(
            "growth of its memory [MiB]",
            process["grown"] / 2**20,
            "less than 150: scenes that were loaded go when Python looks for circles",
            process["grown"] < 150 * 2**20,
        ),
    ]


def _was_sent(cdr: bytes, sent: set[bytes]) -> bool:
    # DDS fills a payload up to a multiple of four bytes.
    return any(cdr[: len(cdr) - spare] in sent for spare in range(4))


def bags_of(folder: Path, tally: Tally) -> dict[str, object]:
    """Read and replay every bag: how many there are, what differs, and how many of the sent commands they hold."""
    found: Counter[str] = Counter()
    differing, unreadable, messages = [], [], 0
    bags = sorted(path for path in folder.iterdir() if path.is_dir() and not path.name.endswith("_again"))
    for bag in bags:
        try:
            recording = read_bag(bag)
            messages += recording.count
            for topic in IN_BAGS:
                if f"/ldcs/{topic}" in recording.channels:
                    commands = recording.in_order([f"/ldcs/{topic}"])
                    found[topic] += sum(_was_sent(one.cdr, tally.bytes_sent) for one in commands)
            if not replay(bag, bag.with_name(f"{bag.name}_again")).verdict.same_bytes:
                differing.append(bag.name)
        except Exception as error:  # whatever it is belongs into the table
            unreadable.append(f"{bag.name}: {error!r}")
    return {
        "bags": len(bags),
        "differing": differing,
        "unreadable": unreadable,
        "found": found,
        "messages": messages,
    }
