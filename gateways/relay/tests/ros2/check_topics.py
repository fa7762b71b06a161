"""Lists and echoes topics as a ROS 2 program would, with the package zenoh-ros2-sdk, and compares them with what is expected.

The expected topics come from a JSON file:

    {"topics": [{"topic": "/hero1/imu/data", "type": "sensor_msgs/msg/Imu", "hash": "RIHS01_...",
                 "values": {"angular_velocity": {"x": 0.5}}}]}

`values` may leave out fields; null stands for NaN. Each topic must be listed with its type and hash, one sample of it must arrive with
these values, and the attachment of that sample must name the publisher whose liveliness token was found.
"""

import argparse
import faulthandler
import json
import os
import pathlib
import shutil
import sys
import tempfile
import threading
import traceback

import xxhash
from rosbags.typesys import Stores, get_typestore
from zenoh_ros2_sdk import ROS2Subscriber
from zenoh_ros2_sdk.attachment import Attachment
from zenoh_ros2_sdk.discovery import get_topic_info, get_topic_names_and_types
from zenoh_ros2_sdk.message_registry import get_registry
from zenoh_ros2_sdk.session import ZenohSession

from compare import differences

# A program that hangs ends after this time, and says where it was. Listing and echoing seven topics takes some ten seconds.
WATCHDOG_S = 300


def write_definitions(type_name, folder):
    """Writes the .msg files of a standard type and of all that it contains."""
    text, _ = get_typestore(Stores.ROS2_JAZZY).generate_msgdef(type_name, ros_version=2)
    first, *nested = text.split("=" * 80 + "\n")
    definitions = {type_name: first}
    for definition in nested:
        header, _, body = definition.partition("\n")
        package, *_, name = header.removeprefix("MSG:").strip().split("/")
        definitions[f"{package}/msg/{name}"] = body
    for name, definition in definitions.items():
        path = folder / f"{name}.msg"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(definition)


class Echo:
    """Receives the first sample of a topic, and its attachment."""

    def __init__(self, expected, domain_id, host, port, session):
        self.expected = expected
        self.messages = []
        self.attachments = []
        self.errors = []
        self.arrived = threading.Event()
        # The SDK works out the type hash on its own; a wrong one would subscribe to another key expression.
        self.subscriber = ROS2Subscriber(
            topic=expected["topic"],
            msg_type=expected["type"],
            callback=self.messages.append,
            domain_id=domain_id,
            router_ip=host,
            router_port=port,
        )
        self.raw = session.session.declare_subscriber(self.subscriber.keyexpr, self.on_sample)

    def on_sample(self, sample):
        if sample.attachment is None:
            self.errors.append("a sample has no attachment, so ROS 2 would drop it")
        else:
            self.attachments.append(Attachment.from_bytes(sample.attachment.to_bytes()))
        if self.messages:
            self.arrived.set()

    def check(self, tokens, timeout_s):
        """What is wrong, as texts."""
        expected = self.expected
        if self.subscriber.type_hash != expected["hash"]:
            yield f"the SDK computes the hash {self.subscriber.type_hash}, not {expected['hash']}"
        if not self.arrived.wait(timeout_s):
            yield f"no sample within {timeout_s} s"
            return
        yield from self.errors
        yield from differences(self.messages[0], expected["values"])
        attachment = self.attachments[0]
        gids = [xxhash.xxh3_128_intdigest(token.encode()).to_bytes(16, "little") for token in tokens]
        if attachment.gid not in gids:
            yield f"the sample's publisher {attachment.gid.hex()} has no token in {tokens}"
        if attachment.sequence_id < 1 or attachment.timestamp_ns < 1_600_000_000 * 10**9:
            yield f"sequence {attachment.sequence_id}, time {attachment.timestamp_ns} ns"


def publisher_tokens(session, domain_id, topic, timeout_s):
    """The liveliness tokens of the publishers of a topic."""
    mangled = topic.replace("/", "%")
    pattern = f"@ros2_lv/{domain_id}/*/*/*/MP/*/*/*/{mangled}/**"
    replies = session.liveliness.get(pattern, timeout=timeout_s)
    return [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--endpoint", required=True, help="Zenoh endpoint, such as tcp/127.0.0.1:7447")
    parser.add_argument("--domain", type=int, default=0, help="ROS domain, default 0")
    parser.add_argument("--packages", type=pathlib.Path, required=True, help="folder with packages of .msg files, such as hero_msgs")
    parser.add_argument("--expected", type=pathlib.Path, required=True, help="JSON file with the expected topics")
    parser.add_argument("--timeout", type=float, default=30.0, help="seconds to wait for a sample of each topic, default 30")
    arguments = parser.parse_args()
    faulthandler.dump_traceback_later(WATCHDOG_S, exit=True)
    host, _, port = arguments.endpoint.removeprefix("tcp/").rpartition(":")
    port = int(port)
    expected = json.loads(arguments.expected.read_text())["topics"]

    # The SDK would fetch standard definitions from the network: rosbags has them already.
    definitions = pathlib.Path(tempfile.mkdtemp())
    try:
        shutil.copytree(arguments.packages, definitions, dirs_exist_ok=True)
        standard = get_typestore(Stores.ROS2_JAZZY)
        for topic in expected:
            if topic["type"] in standard.types:
                write_definitions(topic["type"], definitions)
        return check(arguments, expected, definitions, host, port)
    finally:
        shutil.rmtree(definitions)


def check(arguments, expected, definitions, host, port):
    session = ZenohSession.get_instance(host, port)
    get_registry(str(definitions))
    wrong = []
    listed = {}
    # A first query may come before the peers have exchanged their tokens.
    for _ in range(10):
        listed = dict(get_topic_names_and_types(arguments.domain, host, port, timeout=2.0))
        if all(topic["topic"] in listed for topic in expected):
            break
    for topic in expected:
        name = topic["topic"]
        if listed.get(name) != [topic["type"]]:
            wrong.append(f"{name}: listed with the types {listed.get(name)}, not {topic['type']}")
            continue
        info = get_topic_info(name, arguments.domain, host, port, timeout=arguments.timeout, verbose=True)
        hashes = [publisher.type_hash for publisher in info.publishers]
        if hashes != [topic["hash"]]:
            wrong.append(f"{name}: published with the hashes {hashes}, not {topic['hash']}")
            continue
        tokens = publisher_tokens(session, arguments.domain, name, arguments.timeout)
        echo = Echo(topic, arguments.domain, host, port, session)
        problems = list(echo.check(tokens, arguments.timeout))
        wrong += [f"{name}: {problem}" for problem in problems]
        if not problems:
            print(f"{name} [{topic['type']}]: equal")
    for problem in wrong:
        print(problem, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    try:
        status = main()
    except SystemExit as exit:
        status = exit.code
    except BaseException:
        traceback.print_exc()
        status = 2
    # The SDK keeps its session, whose threads would keep the process.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)
