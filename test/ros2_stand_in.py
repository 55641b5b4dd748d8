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
import types
from pathlib import Path

import yaml

SHARE = {'uav_task_alloc': str(Path(__file__).resolve().parent.parent)}


def program(package, name):
    """The words that start an executable of this package; None for those of others."""
    if package not in SHARE:
        return None
    return [sys.executable, '-c', f'from uav_task_alloc.nodes.{name} import main; main()']


def run(words):
    """ros2 run PACKAGE NAME ..."""
    started = program(*words[:2])
    os.execv(started[0], [*started, *words[2:]])


# What launch files are made of. `text(given)` is a value once the arguments are known.

class Value:
    """A substitution."""

    def __init__(self, *parts, **_):
        self.parts = parts


class Configuration(Value):
    def text(self, given):
        return given[self.parts[0]]


class Share(Value):
    def text(self, given):
        return SHARE[self.parts[0]]


class Joined(Value):
    def text(self, given):
        return '/'.join(text(part, given) for part in self.parts[0])


class Typed:
    def __init__(self, value, value_type=str):
        self.value, self.type = value, value_type

    def text(self, given):
        return str(self.type(text(self.value, given)))


class Declared:
    def __init__(self, name, default_value=None, **_):
        self.name, self.default = name, default_value


class Condition(Value):
    def holds(self, given):
        return text(self.parts[0], given).lower() in ('true', '1')


class NotCondition(Condition):
    def holds(self, given):
        return not super().holds(given)


class Node:
    """launch_ros.actions.Node."""

    def __init__(self, package, executable, namespace='', name='', parameters=(), arguments=(),
                 condition=None, **_):
        self.package, self.executable, self.condition = package, executable, condition
        self.namespace, self.name = namespace, name
        self.parameters, self.arguments = parameters, arguments

    def command(self, given):
        """What starts it; None where it is not to be, or not here."""
        if self.condition is not None and not self.condition.holds(given):
            return None
        started = program(self.package, self.executable)
        if started is None:
            print(f'{self.package} is not here: left out', flush=True)
            return None
        words = [*started, *(text(word, given) for word in self.arguments), '--ros-args']
        namespace = text(self.namespace, given).strip('/')
        words += ['-r', f'__ns:=/{namespace}'] if namespace else []
        words += ['-r', f'__node:={self.name}'] if self.name else []
        for each in self.parameters:
            if isinstance(each, dict):
                for key, value in each.items():
                    words += ['-p', f'{key}:={text(value, given)}']
            else:
                words += ['--params-file', text(each, given)]
        return words


def text(value, given):
    if hasattr(value, 'text'):
        return value.text(given)
    if isinstance(value, (list, tuple)):
        return ''.join(text(part, given) for part in value)
    return str(value)


def pretend():
    """Put modules under the names that launch files import."""
    names = {
        'launch': {'LaunchDescription': list},
        'launch.actions': {'DeclareLaunchArgument': Declared},
        'launch.conditions': {'IfCondition': Condition, 'UnlessCondition': NotCondition},
        'launch.substitutions': {'LaunchConfiguration': Configuration,
                                 'PathJoinSubstitution': Joined},
        'launch_ros': {}, 'launch_ros.actions': {'Node': Node},
        'launch_ros.parameter_descriptions': {'ParameterValue': Typed},
        'launch_ros.substitutions': {'FindPackageShare': Share},
    }
    for name, members in names.items():
        module = types.ModuleType(name)
        module.__dict__.update(members)
        sys.modules[name] = module


def launch(words):
    """ros2 launch PACKAGE FILE NAME:=VALUE ...: all nodes until Ctrl-C, which each is told of."""
    pretend()
    path = Path(SHARE[words[0]], 'launch', words[1])
    scope = {}
    exec(compile(path.read_text(), str(path), 'exec'), scope)
    parts = scope['generate_launch_description']()
    given = dict(word.split(':=', 1) for word in words[2:])
    declared = [part for part in parts if isinstance(part, Declared)]
    unknown = set(given) - {part.name for part in declared}
    if unknown:
        sys.exit(f'{path.name}: no argument {min(unknown)}')
    for part in declared:
        given.setdefault(part.name, text(part.default, given))
    nodes = [part.command(given) for part in parts if isinstance(part, Node)]
    children = [subprocess.Popen(words) for words in nodes if words]
    stop = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.append(1))
    while not stop and any(child.poll() is None for child in children):
        time.sleep(0.05)
    for child in children:
        child.send_signal(signal.SIGINT)
    return max(abs(child.wait(20)) for child in children)


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
