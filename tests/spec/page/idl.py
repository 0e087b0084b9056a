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


SIZES = dict(bool=1, int8=1, uint8=1, int16=2, uint16=2, int32=4, uint32=4, int64=8, uint64=8,
             float=4, double=8)


def struct_of(object_, sizes):
    """The bytes of a struct, field by field; `sizes` has those of the structs."""
    fields = []
    for field in object_['fields']:
        kind = field['type']
        count = kind.get('length', 1)
        base = kind['element'] if kind['base'] == 'array' else kind['base']
        name = kind['object'] if base == 'object' else base
        one = sizes[name] if base == 'object' else SIZES[base]
        shown = dict(name=field['name'], offset=field['offset'], size=one * count, type=name)
        fields.append(shown | {key: kind[key] for key in ('length', 'enum') if key in kind})
    return dict(struct=object_['name'], file=object_['file'], size=object_['byte_size'],
                align=object_['alignment'], fields=fields)


def structs_of(models):
    """Each struct of the schemas, once, by name."""
    objects = {one['name']: one for model in models for one in model['objects']
               if one['kind'] == 'struct'}
    sizes = {name: one['byte_size'] for name, one in objects.items()}
    return [struct_of(objects[name], sizes) for name in sorted(objects)]


def lay_out(services, structs):
    """JSON with a line for each method and field, so that a difference shows as few lines."""
    parts, layouts = [], []
    for service in services:
        head = ',\n   '.join(f'{json.dumps(key)}: {json.dumps(value)}'
                             for key, value in service.items() if key != 'methods')
        methods = ',\n    '.join(json.dumps(method) for method in service['methods'])
        parts.append(f'  {{\n   {head},\n   "methods": [\n    {methods}\n   ]\n  }}')
    for struct in structs:
        head = json.dumps({key: value for key, value in struct.items() if key != 'fields'})
        fields = ',\n    '.join(json.dumps(field) for field in struct['fields'])
        layouts.append(f'  {head[:-1]}, "fields": [\n    {fields}\n  ]}}')
    subject = "RTPM's own services: fingerprints (hp-12.1), texts (hp-12.2), bytes of structs."
    return f'{{\n "subject": {json.dumps(subject)},\n "services": [\n' + ',\n'.join(parts) + \
        '\n ],\n "structs": [\n' + ',\n'.join(layouts) + '\n ]\n}\n'


def wanted_files(rtpmc):
    files, services, models = {}, [], []
    for path in sorted(IDL.glob('*.fbs')):
        files[path.name] = path.read_text(encoding='utf-8')
        models.append(model_of(rtpmc, path))
        services += [service_of(path, service) for service in models[-1]['services']]
    files['services.json'] = lay_out(services, structs_of(models))
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
