# SPDX-License-Identifier: Apache-2.0
"""`ros2` for test_docs.py where it is not installed: what the docs use of it, and no more.

run, launch, topic pub, topic echo, service call. Quality of service is as Jazzy's own command
line has it: a publisher is volatile unless told, a listener takes what publishers offer.
"""
import argparse
import array
import importlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import yaml
from launch_stand_in import SHARE, commands


def program(package, name):
    """The words that start an executable of this package; those of others are not here."""
    if package not in SHARE:
        sys.exit(f'Package {package!r} not found')
    return [sys.executable, '-c', f'from uav_task_alloc.nodes.{name} import main; main()']


def run(words):
    """ros2 run PACKAGE NAME ..."""
    started = program(*words[:2])
    os.execv(started[0], [*started, *words[2:]])


def launch(words):
    """ros2 launch PACKAGE FILE NAME:=VALUE ...: all nodes until Ctrl-C, which each is told of."""
    path = Path(SHARE[words[0]], 'launch', words[1])
    nodes = commands(path, dict(word.split(':=', 1) for word in words[2:]))
    started = [(program(*node[:2]) + node[2:], node.env) for node in nodes]
    children = [subprocess.Popen(node, env={**os.environ, **env}) for node, env in started]
    stop = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.append(1))
    while not stop and any(child.poll() is None for child in children):
        time.sleep(0.05)  # a signal ends it at once
    for child in children:
        child.send_signal(signal.SIGINT)
    return max(abs(child.wait(60)) for child in children)


# What is said and heard.

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


def topic(words):
    """ros2 topic pub|echo."""
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
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
        every = [offer.qos_profile for offer in offers]
        qos = QoSProfile(
            depth=10, reliability=ReliabilityPolicy.RELIABLE if all(
                each.reliability == ReliabilityPolicy.RELIABLE for each in every)
            else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if all(
                each.durability == DurabilityPolicy.TRANSIENT_LOCAL for each in every)
            else DurabilityPolicy.VOLATILE)
        heard = []
        node.create_subscription(interface(args.type or offers[0].topic_type), args.name,
                                 lambda message: (heard.append(1), show(message)), qos)
        while not (args.once and heard):
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
