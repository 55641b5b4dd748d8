# SPDX-License-Identifier: Apache-2.0
"""`ros2` for test_docs.py where it is not installed: what the docs use of it, and no more.

run, launch, topic pub, topic echo, service call. Quality of service is as Jazzy's own command
line has it: a publisher is volatile by default, a subscriber takes what publishers offer.
"""
import argparse
import array
import importlib
import os
import signal
import subprocess
import sys
import time
import types
from pathlib import Path

import yaml
from launch_stand_in import SHARE, Context, End, Later, Log, commands, show_args


def program(package, name):
    """The words that start an executable of this package; those of others are not here."""
    if package not in SHARE:
        sys.exit(f'Package {package!r} not found')
    return [sys.executable, '-c', f'from uav_task_alloc.nodes.{name} import main; main()']


def run(words):
    """ros2 run PACKAGE NAME ..."""
    started = program(*words[:2])
    os.execv(started[0], [*started, *words[2:]])


class Launch:
    """The nodes of a launch file, and what follows on the end of each."""

    def __init__(self, path, given):
        self.children, self.later = [], []  # (process, node); (when, actions, arguments)
        self.stop = ''
        for node in commands(path, given):
            self.start(node)

    def start(self, node):
        process = subprocess.Popen(program(*node[:2]) + node[2:], env={**os.environ, **node.env})
        print(f'[INFO] [{node[1]}]: process started with pid [{process.pid}]', flush=True)
        self.children.append((process, node))

    def step(self):
        """Handle nodes that have exited, and actions that are due."""
        time.sleep(0.05)  # a signal ends it at once
        for process, node in [each for each in self.children if each[0].poll() is not None]:
            self.children.remove((process, node))
            event = types.SimpleNamespace(returncode=process.returncode)
            for action in node.on_exit(event, Context(node.given)) if node.on_exit else ():
                self.act(action, node.given)
        for due in [each for each in self.later if each[0] <= time.monotonic()]:
            self.later.remove(due)
            for action in due[1]:
                for words in action.starts(due[2]):
                    self.start(words)

    def act(self, action, given):
        if isinstance(action, Log):
            print(f'[INFO] [launch.user]: {action.msg}', flush=True)
        elif isinstance(action, End):
            print(f'[INFO] [launch]: {action.reason}', flush=True)
            self.stop = action.reason
        elif isinstance(action, Later):
            self.later.append((time.monotonic() + action.period, action.actions, given))
        else:
            raise TypeError(action)

    def end(self, interrupted):
        """End all nodes as launch does; `interrupted`: the terminal has sent SIGINT to them."""
        for process, _ in self.children:
            if not interrupted:
                process.send_signal(signal.SIGINT)
        began, worst = time.monotonic(), 0
        for process, node in self.children:
            for number, patience in ((signal.SIGTERM, node.patience), (signal.SIGKILL, 5.0)):
                try:
                    process.wait(max(0.0, began + node.patience - time.monotonic())
                                 if number == signal.SIGTERM else patience)
                    break
                except subprocess.TimeoutExpired:
                    process.send_signal(number)
            worst = max(worst, abs(process.wait()))
        return worst


def launch(words):
    """ros2 launch PACKAGE FILE NAME:=VALUE ...: all nodes until Ctrl-C."""
    path = Path(SHARE[words[0]], 'launch', words[1])
    if '--show-args' in words:
        print(yaml.safe_dump(show_args(path), width=1000))
        return 0
    signals = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _: signals.append(number))
    try:
        launched = Launch(path, dict(word.split(':=', 1) for word in words[2:]))
    except Exception as error:
        sys.exit(f'[ERROR] [launch]: Caught exception in launch: {error}')
    while not signals and not launched.stop and (launched.children or launched.later):
        launched.step()
    return launched.end(signal.SIGINT in signals)


# topics and services

def interface(name):
    """The class of `package/kind/Name`."""
    package, *kind, last = name.split('/')
    return getattr(importlib.import_module(f'{package}.{(kind or ["msg"])[0]}'), last)


def fill(message, values):
    """Set the fields that are given; AttributeError, TypeError for what does not fit."""
    kinds = message.get_fields_and_field_types()
    for key, value in (values or {}).items():
        if key not in kinds:
            raise AttributeError(f'{type(message).__name__} has no field {key}')
        field = getattr(message, key)
        if isinstance(value, dict):
            fill(field, value)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            element = interface(kinds[key].removeprefix('sequence<').rstrip('>').split(',')[0])
            setattr(message, key, [fill(element(), each) for each in value])
        else:
            setattr(message, key, value if isinstance(value, list) else type(field)(value))
    return message


def plain(value):
    """A message as what YAML knows."""
    if hasattr(value, 'get_fields_and_field_types'):
        return {key: plain(getattr(value, key)) for key in value.get_fields_and_field_types()}
    if isinstance(value, (list, tuple, array.array)):
        return [plain(each) for each in value]
    return value


def show(message):
    print(yaml.safe_dump(plain(message), sort_keys=False) + '---', flush=True)


def with_node(act):
    """Call act(node, spin) and clean up."""
    import rclpy
    rclpy.init()
    node = rclpy.create_node('_ros2cli')
    try:
        return act(node, lambda: rclpy.spin_once(node, timeout_sec=0.1))
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def strictest_qos(offers):
    """The QoS that every publisher offers, as `ros2 topic echo` asks for."""
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
    return QoSProfile(
        depth=10, reliability=ReliabilityPolicy.RELIABLE if all(
            each.reliability == ReliabilityPolicy.RELIABLE for each in offers)
        else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if all(
            each.durability == DurabilityPolicy.TRANSIENT_LOCAL for each in offers)
        else DurabilityPolicy.VOLATILE)


def topic(words):
    """ros2 topic pub|echo."""
    from rclpy.qos import DurabilityPolicy, QoSProfile
    parser = argparse.ArgumentParser(prog='ros2 topic')
    parser.add_argument('verb', choices=('pub', 'echo'))
    parser.add_argument('name')
    parser.add_argument('type', nargs='?')
    parser.add_argument('values', nargs='?', default='{}')
    parser.add_argument('--once', action='store_true')
    parser.add_argument('--qos-durability', default='')
    args = parser.parse_args(words)
    latched = args.qos_durability == 'transient_local'

    def pub(node, spin):
        message = fill(interface(args.type)(), yaml.safe_load(args.values))
        durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
        sender = node.create_publisher(type(message), args.name,
                                       QoSProfile(depth=10, durability=durability))
        while sender.get_subscription_count() < 1:
            spin()
        sender.publish(message)
        for _ in range(5):
            spin()

    def echo(node, spin):
        offers = []
        while not offers:
            spin()
            offers = node.get_publishers_info_by_topic(args.name)
        received = []
        node.create_subscription(interface(args.type or offers[0].topic_type), args.name,
                                 lambda message: (received.append(1), show(message)),
                                 strictest_qos([offer.qos_profile for offer in offers]))
        while not (args.once and received):
            spin()

    return with_node({'pub': pub, 'echo': echo}[args.verb])


def service(words):
    """ros2 service call NAME TYPE VALUES."""
    _, name, kind, *values = words

    def call(node, spin):
        of = interface(kind)
        client = node.create_client(of, name)
        while not client.service_is_ready():
            spin()
        future = client.call_async(fill(of.Request(), yaml.safe_load(values[0] if values else '')))
        while not future.done():
            spin()
        print(f'response:\n{future.result()}', flush=True)

    return with_node(call)


if __name__ == '__main__':
    sys.exit({'run': run, 'launch': launch, 'topic': topic,
              'service': service}[sys.argv[1]](sys.argv[2:]))
