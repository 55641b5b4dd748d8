# SPDX-License-Identifier: Apache-2.0
"""The type stubs that mypy reads agree with the messages and the rclpy that are installed."""
import ast
import importlib
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.ros
ROOT = Path(__file__).parents[2]
TYPINGS = ROOT / 'tools/typings'
RCLPY = sorted((TYPINGS / 'rclpy').rglob('*.pyi'))


def test_the_stubs_of_messages_are_generated_from_their_definitions(tmp_path):
    subprocess.run([sys.executable, ROOT / 'tools/message_stubs.py', tmp_path], check=True)
    stubs = {path.relative_to(tmp_path): path.read_text() for path in tmp_path.rglob('*.pyi')}
    assert {TYPINGS / name: text for name, text in stubs.items()} == {
        path: path.read_text() for path in TYPINGS.rglob('*.pyi') if path not in RCLPY}


def stub_functions(path):
    """(name of the class or '', definition) of every function in a stub."""
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.FunctionDef):
            yield '', node
        elif isinstance(node, ast.ClassDef) and not node.name.startswith('_'):
            yield from ((node.name, each) for each in node.body
                        if isinstance(each, ast.FunctionDef))


@pytest.mark.parametrize('path', RCLPY, ids=lambda path: path.stem)
def test_functions_and_arguments_of_the_stubs_of_rclpy_exist(path):
    name = '.'.join(path.relative_to(TYPINGS).with_suffix('').parts).removesuffix('.__init__')
    module = importlib.import_module(name)
    for owner, stub in stub_functions(path):
        real = getattr(getattr(module, owner) if owner else module, stub.name)
        if isinstance(real, property):
            continue
        parameters = inspect.signature(real).parameters
        if any(each.kind is each.VAR_KEYWORD for each in parameters.values()):
            continue
        arguments = [each.arg for each in stub.args.args + stub.args.kwonlyargs]
        assert set(arguments) <= {*parameters, 'cls', 'self'}, f'{name}: {owner}.{stub.name}'
