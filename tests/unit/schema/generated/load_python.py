"""Loads the modules that rtpmc generates, with a stand-in for the package rtpm, and parses their types.

usage: load_python.py GOLDENS PACKAGE
"""
import ast
import pathlib
import sys
import types

loaded = {}


def load(module, level, schema):
    loaded[module] = (level, schema)


def comments(text):
    return [line.strip() for line in text.splitlines() if line.strip().startswith('///')]


def main(goldens, package):
    sys.modules['rtpm'] = types.ModuleType('rtpm')
    sys.modules['rtpm.generated'] = types.ModuleType('rtpm.generated')
    sys.modules['rtpm.generated'].load = load
    schemas = sorted(goldens.glob('*.fbs'))
    assert len(schemas) >= 5, schemas
    assert (package / 'py.typed').exists() and (package / '__init__.py').exists()
    for schema in schemas:
        name = schema.stem + '_rtpm'
        for text in (goldens / (name + '.py.golden'), package / (name + '.py')):
            exec(compile(text.read_text('utf-8'), str(text), 'exec'), {'__name__': name})
            level, loaded_schema = loaded.pop(name)
            assert level == 1, text
            for line in comments(schema.read_text('utf-8')):
                assert line in comments(loaded_schema), (text, line)
        for text in (goldens / (name + '.pyi.golden'), package / (name + '.pyi')):
            ast.parse(text.read_text('utf-8'), str(text))


main(pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]))
