#!/usr/bin/env python3
"""Writes the vectors, or with --check says which of the files here are not what it would write."""

import json
import pathlib
import sys

sys.dont_write_bytecode = True

import bindings
import conversations
import deliveries
import discovery
import fingerprints
import layouts
import sessions
import single_frames
import streams
import versions

try:
    import sealed
except ImportError:  # Without Python's `cryptography`, sealed.json is left as it is.
    sealed = None

FOLDER = pathlib.Path(__file__).resolve().parent.parent
REMEDY = 'python3 spec/vectors/generator/make.py'


def files():
    yield 'constants.json', single_frames.constants()
    yield 'headers-good.json', single_frames.headers_good()
    yield 'headers-bad.json', single_frames.headers_bad()
    yield 'hello.json', single_frames.hello()
    yield 'clock-domain.json', single_frames.clock_domains()
    yield 'cookie.json', single_frames.cookie()
    yield 'welcome.json', single_frames.welcome()
    yield 'ack.json', single_frames.ack()
    yield 'credit.json', single_frames.credit()
    yield 'bind-request.json', single_frames.bind_requests()
    yield 'bind-reply.json', single_frames.bind_replies()
    yield 'urls.json', single_frames.urls()
    yield 'discovery.json', discovery.discovery()
    yield 'fingerprints.json', fingerprints.fingerprints()
    yield 'versions.json', versions.versions()
    yield '../layouts.json', layouts.layouts()
    if sealed:
        yield 'sealed.json', sealed.sealed()
    for conversation in (conversations.conversations() + deliveries.conversations() +
                         streams.conversations() + sessions.conversations() +
                         bindings.conversations()):
        yield f'conversations/{conversation.name}.json', conversation.document()


def line_of(one):
    """One element of a list; the fields of a layout stand on lines of their own."""
    if 'fields' not in one or 'page' not in one:
        return json.dumps(one, ensure_ascii=False)
    head = json.dumps({key: value for key, value in one.items() if key != 'fields'})
    fields = ',\n   '.join(json.dumps(field, ensure_ascii=False) for field in one['fields'])
    return f'{head[:-1]}, "fields": [\n   {fields}\n  ]}}'


def lay_out(document):
    """JSON with a line for each vector, step or field, so that a difference shows as few lines."""
    parts = []
    for key, value in document.items():
        if isinstance(value, list) and value and key not in ('rules', 'roles'):
            lines = ',\n  '.join(line_of(one) for one in value)
            parts.append(f' {json.dumps(key)}: [\n  {lines}\n ]')
        else:
            parts.append(f' {json.dumps(key)}: {json.dumps(value, ensure_ascii=False)}')
    return '{\n' + ',\n'.join(parts) + '\n}\n'


def main():
    is_check = sys.argv[1:] == ['--check']
    if sys.argv[1:] and not is_check:
        sys.exit('make.py takes no argument but --check')
    wanted = {(FOLDER / name).resolve(): lay_out(document) for name, document in files()}
    there = set(FOLDER.glob('*.json')) | set(FOLDER.glob('conversations/*.json'))
    there |= {path for path in wanted if path.exists()}
    if not sealed:
        there.discard(FOLDER / 'sealed.json')
    faults = []
    for path in sorted(there | set(wanted)):
        now = path.read_text() if path in there else None
        if now == wanted.get(path):
            continue
        faults.append(str(path.relative_to(FOLDER.parent)))
        if is_check:
            continue
        if path in wanted:
            path.write_text(wanted[path])
        else:
            path.unlink()
    for fault in faults:
        print(fault, 'differs from what make.py writes' if is_check else 'written')
    if is_check and faults:
        print(f'After a change of a page or of a vector: {REMEDY}')
    sys.exit(1 if is_check and faults else 0)


if __name__ == '__main__':
    main()
