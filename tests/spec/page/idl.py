#!/usr/bin/env python3
"""Writes spec/idl: RTPM's schemas as they are, and what the compiler makes of their services.

idl.py RTPMC           writes it
idl.py --check RTPMC   says what differs from what it would write
"""

import json
import pathlib
import subprocess
import sys

SOURCE = pathlib.Path(__file__).resolve().parents[3]
IDL = SOURCE / 'schema' / 'idl'
PUBLISHED = SOURCE / 'spec' / 'idl'
REMEDY = 'cmake --build --preset dev --target spec_idl'
METHOD_KEYS = ('id', 'name', 'fingerprint', 'request', 'reply', 'is_idempotent', 'oneway',
               'is_stream', 'deadline_us')


def model_of(rtpmc, path):
    ran = subprocess.run([rtpmc, '--emit', 'json', '-I', IDL, path], capture_output=True, text=True)
    if ran.returncode != 0:
        sys.exit(f'{path.name}: rtpmc failed: {ran.stderr}')
    return json.loads(ran.stdout)


def service_of(path, service):
    methods = [{key: method[key] for key in METHOD_KEYS if key in method}
               for method in service['methods']]
    return dict(service=service['name'], file=path.name, fingerprint=service['fingerprint'],
                priority_model=service['priority_model'], text=service['text'], methods=methods)


def lay_out(services):
    """JSON with a line for each method, so that a difference shows as few lines."""
    parts = []
    for service in services:
        head = ',\n   '.join(f'{json.dumps(key)}: {json.dumps(value)}'
                             for key, value in service.items() if key != 'methods')
        methods = ',\n    '.join(json.dumps(method) for method in service['methods'])
        parts.append(f'  {{\n   {head},\n   "methods": [\n    {methods}\n   ]\n  }}')
    subject = "RTPM's own services: fingerprints (hp-12.1) and texts (hp-12.2)."
    return f'{{\n "subject": {json.dumps(subject)},\n "services": [\n' + ',\n'.join(parts) + \
        '\n ]\n}\n'


def wanted_files(rtpmc):
    files, services = {}, []
    for path in sorted(IDL.glob('*.fbs')):
        files[path.name] = path.read_text(encoding='utf-8')
        services += [service_of(path, service) for service in model_of(rtpmc, path)['services']]
    files['services.json'] = lay_out(services)
    return files


def main(arguments):
    is_check = arguments[:1] == ['--check']
    if len(arguments) != 1 + is_check:
        sys.exit(__doc__)
    wanted = wanted_files(arguments[-1])
    there = {path.name for path in PUBLISHED.glob('*') if path.suffix in ('.fbs', '.json')}
    faults = []
    for name in sorted(there | set(wanted)):
        path = PUBLISHED / name
        if path.exists() and path.read_text(encoding='utf-8') == wanted.get(name):
            continue
        faults.append(name)
        if is_check:
            continue
        if name in wanted:
            path.write_text(wanted[name], encoding='utf-8')
        else:
            path.unlink()
    for name in faults:
        print(f'spec/idl/{name}', 'is not what schema/idl makes' if is_check else 'written')
    if is_check and faults:
        print(f'After a change of a schema: {REMEDY}')
    return 1 if is_check and faults else 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
