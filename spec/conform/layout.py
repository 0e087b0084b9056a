"""Frames field by field, as spec/layouts.json lays them out."""

import json
import pathlib

SPEC = pathlib.Path(__file__).resolve().parent.parent
HEADER_SIZE = 64

CONSTANTS = json.loads((SPEC / 'vectors' / 'constants.json').read_text(encoding='utf-8'))
KINDS = CONSTANTS['kinds']
KIND_NAMES = {number: name for name, number in KINDS.items()}
STATUSES = CONSTANTS['statuses']
STATUS_NAMES = {number: name for name, number in STATUSES.items()}
REPEATED, ACK_WANTED = CONSTANTS['flags']['repeated'], CONSTANTS['flags']['ack_wanted']
NO_REPLY = CONSTANTS['flags']['no_reply']


def load_layouts():
    """Layout name to a list of (field, offset, size); size None: what is left."""
    documents = json.loads((SPEC / 'layouts.json').read_text(encoding='utf-8'))['layouts']
    return {document['name']: [(field['field'], field['offset'], field['size'])
                               for field in document['fields']] for document in documents}


LAYOUTS = load_layouts()
LAYOUTS['COOKIE'] = [('cookie', 0, 16)]
BYTES_FIELDS = ('cookie', 'reserved', 'later', 'payload', 'methods', 'magic')


def number(data):
    return int.from_bytes(data, 'little')


def encode(kind, payload=b'', **fields):
    """A whole frame of `kind`; sizes are right unless they are given."""
    values = dict(version=1, kind=KINDS[kind], payload_size=len(payload), fragment_count=1)
    values['message_size'] = fields.get('payload_size', len(payload))
    values.update(fields)
    frame = bytearray(HEADER_SIZE)
    frame[0:2] = b'HP'
    for name, offset, size in LAYOUTS['header']:
        if name in values:
            frame[offset:offset + size] = values[name].to_bytes(size, 'little')
    return bytes(frame) + payload


def encode_payload(layout, **fields):
    end = max(offset + size for _, offset, size in LAYOUTS[layout] if size)
    payload = bytearray(end)
    for name, offset, size in LAYOUTS[layout]:
        if name in fields:
            value = fields[name]
            data = value if isinstance(value, bytes) else value.to_bytes(size, 'little')
            payload[offset:offset + size] = data
    return bytes(payload)


def header_of(frame):
    """The header's fields by name; magic as bytes."""
    return {name: frame[offset:offset + size] if name in BYTES_FIELDS
            else number(frame[offset:offset + size])
            for name, offset, size in LAYOUTS['header']}


def kind_of(frame):
    return KIND_NAMES.get(frame[3], f'kind {frame[3]}') if len(frame) > 3 else 'nothing'


def is_bind(header):
    return header['service'] == 0 and header['method'] == CONSTANTS['method_bind']


def fields_of(frame):
    """All fields of a frame: (name, offset in the frame, size), payload included. Only a REPLY ok
    to a bind has the layout of one."""
    places = [(name, offset, size) for name, offset, size in LAYOUTS['header']]
    kind = kind_of(frame)
    header = header_of(frame)
    if kind == 'REPLY' and is_bind(header) and header['status'] == 0:
        kind = 'bind reply'
    if kind not in LAYOUTS:
        return places + [('payload', HEADER_SIZE, max(len(frame) - HEADER_SIZE, 0))]
    for name, offset, size in LAYOUTS[kind]:
        size = max(len(frame) - HEADER_SIZE - offset, 0) if size is None else size
        places.append((name, HEADER_SIZE + offset, size))
    return places


class Pattern:
    """A frame of a vector, with `<name>` where one side is free to choose."""

    def __init__(self, hex_text, free):
        self.cells = []  # A byte, or (name, index in it).
        self.names = []
        at = 0
        while at < len(hex_text):
            if hex_text[at] == '<':
                end = hex_text.index('>', at)
                name = hex_text[at + 1:end]
                self.names.append(name)
                self.cells += [(name, i) for i in range(free[name]['size'])]
                at = end + 1
            else:
                self.cells.append(int(hex_text[at:at + 2], 16))
                at += 2

    def fill(self, known):
        """The frame, with what is known of the names; zero where nothing is."""
        return bytes(cell if isinstance(cell, int)
                     else (known[cell[0]][cell[1]] if cell[0] in known else 0)
                     for cell in self.cells)

    def name_at(self, offset):
        """The name of the free bytes that begin at `offset`, or nothing."""
        if offset < len(self.cells) and not isinstance(self.cells[offset], int):
            return self.cells[offset][0]
        return None
