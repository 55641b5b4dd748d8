# SPDX-License-Identifier: Apache-2.0
"""`launch` and `launch_ros` where they are not installed: what this package's files use of them.

`commands(path, given)` is what a launch file would start. Anything else a file asks for is an
ImportError or a TypeError.
"""
import sys
import types
from pathlib import Path

import yaml

SHARE = {'uav_task_alloc': str(Path(__file__).resolve().parent.parent)}
INSTALLED = set()  # packages of others
ENVIRONMENT = 'the environment'  # no argument has this name


def text(value, given):
    """A value once the arguments are known."""
    if isinstance(value, Value):
        return value.text(given)
    if isinstance(value, (list, tuple)):
        return ''.join(text(part, given) for part in value)
    return str(value)


class Value:
    """A substitution of one thing."""

    def __init__(self, what):
        self.what = what


class Configuration(Value):
    def text(self, given):
        return given[self.what]

    def perform(self, context):
        return self.text(context.launch_configurations)


class Share(Value):
    def text(self, given):
        return SHARE[self.what]


class Executable(Value):
    """A program of a package; those of other packages are where INSTALLED says so."""

    def __init__(self, *, executable, package):
        super().__init__(executable)
        self.package = package

    def perform(self, context):
        if self.package not in {*SHARE, *INSTALLED}:
            raise LookupError(f"package '{self.package}' not found")
        return self.what


class Joined(Value):
    def text(self, given):
        return '/'.join(text(part, given) for part in self.what)


class Equal(Value):
    """Whether two values are the same, as `true` or `false`."""

    same = True

    def __init__(self, what, other):
        super().__init__(what)
        self.other = other

    def text(self, given):
        return str((text(self.what, given) == text(self.other, given)) is self.same).lower()


class NotEqual(Equal):
    same = False


class Source(Value):
    def text(self, given):
        return text(self.what, given)


class Typed(Value):
    def __init__(self, what, value_type):
        super().__init__(what)
        self.type = value_type

    def text(self, given):
        if isinstance(self.what, (list, bool)):
            return yaml.safe_dump(self.what, default_flow_style=True, width=10**6).split('\n')[0]
        value = self.type(text(self.what, given))
        return f"'{value}'" if self.type is str else str(value)  # as YAML, where '' is no value


class Condition(Value):
    wanted = ('true', '1')

    def text(self, given):
        return text(self.what, given).lower()

    def holds(self, given):
        return self.text(given) in self.wanted


class NotCondition(Condition):
    wanted = ('false', '0')


class Declared:
    def __init__(self, name, *, default_value, description=''):
        self.name, self.default, self.description = name, default_value, description

    def starts(self, given):
        given.setdefault(self.name, text(self.default, given))
        return []


class Include:
    def __init__(self, source, *, launch_arguments=(), condition=None):
        self.source, self.arguments, self.condition = source, launch_arguments, condition

    def starts(self, given):
        if self.condition and not self.condition.holds(given):
            return []
        inner = {key: text(value, given) for key, value in self.arguments}
        return commands(Path(text(self.source, given)), inner)


class Context:
    """The argument of a launch file's functions."""

    is_shutdown = False

    def __init__(self, given):
        self.launch_configurations = given


class Log:
    """A line of the log."""

    def __init__(self, *, msg):
        self.msg = msg


class End:
    """The launch ends."""

    def __init__(self, *, reason):
        self.reason = reason


class Later:
    """Actions that follow after some time [s]."""

    def __init__(self, *, period, actions):
        self.period, self.actions = period, actions


class Function:
    """Calls a function of the launch file once the arguments are known."""

    def __init__(self, *, function):
        self.function = function

    def starts(self, given):
        return [words for part in self.function(Context(given)) for words in part.starts(given)]


class Environment:
    """A variable for all that is started after it."""

    def __init__(self, name, value):
        self.name, self.value = name, value

    def starts(self, given):
        given.setdefault(ENVIRONMENT, {})[self.name] = text(self.value, given)
        return []


class Node:
    def __init__(self, *, package, executable, namespace='', name='', parameters=(), arguments=(),
                 remappings=(), output='', condition=None, respawn=False, on_exit=None,
                 sigterm_timeout='5'):
        self.package, self.executable, self.condition = package, executable, condition
        self.namespace, self.name, self.remappings = namespace, name, remappings
        self.parameters, self.arguments = parameters, arguments
        self.respawn, self.on_exit, self.patience = respawn, on_exit, sigterm_timeout

    def starts(self, given):
        if self.condition and not self.condition.holds(given):
            return []
        words = [self.package, self.executable, *(text(word, given) for word in self.arguments)]
        namespace = text(self.namespace, given).strip('/')
        renamed = [*self.remappings, *[('__ns', f'/{namespace}')] * bool(namespace),
                   *[('__node', self.name)] * bool(self.name)]
        words += ['--ros-args']
        words += [word for old, new in renamed for word in ('-r', f'{old}:={new}')]
        for each in self.parameters:
            if isinstance(each, dict):
                words += [word for key, value in each.items()
                          for word in ('-p', f'{key}:={text(value, given)}')]
            else:
                words += ['--params-file', text(each, given)]
        return [Words(words, self, given)]


class Words(list):
    """Of a command; `on_exit`: what follows on its end; `env`: to be set before."""

    def __init__(self, words, node, given):
        super().__init__(words)
        self.on_exit, self.respawn, self.given = node.on_exit, node.respawn, given
        self.patience = float(node.patience)  # [s] from SIGINT to SIGTERM
        self.env = dict(given.get(ENVIRONMENT, {}))


MODULES = {
    'launch': {'LaunchDescription': list},
    'launch.actions': {'DeclareLaunchArgument': Declared, 'IncludeLaunchDescription': Include,
                       'LogInfo': Log, 'OpaqueFunction': Function,
                       'SetEnvironmentVariable': Environment, 'Shutdown': End,
                       'TimerAction': Later},
    'launch.conditions': {'IfCondition': Condition, 'UnlessCondition': NotCondition},
    'launch.launch_description_sources': {'PythonLaunchDescriptionSource': Source},
    'launch.substitutions': {'LaunchConfiguration': Configuration, 'PathJoinSubstitution': Joined,
                             'EqualsSubstitution': Equal, 'NotEqualsSubstitution': NotEqual},
    'launch_ros': {}, 'launch_ros.actions': {'Node': Node},
    'launch_ros.parameter_descriptions': {'ParameterValue': Typed},
    'launch_ros.substitutions': {'ExecutableInPackage': Executable, 'FindPackageShare': Share},
}
USERS = ('uav_task_alloc.nodes.ros.launch_arguments',)  # modules that have imported from these


def entities(path):
    """What a launch file declares and starts."""
    before = {name: sys.modules.pop(name, None) for name in (*MODULES, *USERS)}
    for name, members in MODULES.items():
        sys.modules[name] = types.ModuleType(name)
        sys.modules[name].__dict__.update(members)
    try:
        scope = {'__file__': str(path)}
        exec(compile(path.read_text(), str(path), 'exec'), scope)
        return scope['generate_launch_description']()
    finally:
        for name, module in before.items():
            sys.modules.pop(name, None)
            if module is not None:
                sys.modules[name] = module


def show_args(path):
    """What `ros2 launch ... --show-args` prints: name and description of each argument."""
    return {part.name: part.description for part in entities(path) if isinstance(part, Declared)}


def commands(path, given):
    """Words of `PACKAGE EXECUTABLE ...` for each node; KeyError for an unknown argument."""
    parts = entities(path)
    declared = {part.name for part in parts if isinstance(part, Declared)}
    if set(given) - declared:
        raise KeyError(f'{path.name}: no argument {min(set(given) - declared)}')
    given = dict(given)
    return [words for part in parts for words in part.starts(given)]
