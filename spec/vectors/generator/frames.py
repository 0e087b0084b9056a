"""Frames and payloads of the H-Protocol, laid out as hprotocol.md says and by nothing else.

A number may be given as text: then it stands in the hex as a placeholder `<name>`, for bytes that
one side is free to choose.
"""

KINDS = {'HELLO': 1, 'COOKIE': 2, 'WELCOME': 3, 'REFUSE': 4, 'CALL': 5, 'REPLY': 6, 'CLOSE': 7,
         'ACK': 8, 'CANCEL': 9, 'ITEM': 10, 'CREDIT': 11}

STATUSES = {name: number for number, name in enumerate(
    'ok overload expired no_such_method no_such_object bad_request not_lease_holder gone '
    'servant_failed too_large priority_not_allowed wrong_band unknown_session '
    'version_unsupported bad_limits wrong_interface cancelled stopping lost not_allowed'.split())}

DROP_REASONS = ('too_short bad_magic bad_version bad_kind reserved_set bad_priority bad_length '
                'bad_fragment bad_payload bad_cookie unknown_session foreign_address stale_call '
                'duplicate_running unexpected rate_limited unsealed bad_seal replayed').split()

REPEATED = 1
ACK_WANTED = 2
NO_REPLY = 4
REPLY_ON_RECEIPT = 8
KIB = 1024
MIB = 1024 * KIB

# Name, size in bytes, value where none is given; in the order of the wire.
HEADER = [
    ('magic', 2, 0x5048), ('version', 1, 1), ('kind', 1, None), ('priority', 2, 0),
    ('flags', 2, 0), ('session', 8, 0), ('call_id', 4, 0), ('service', 4, 0), ('method', 2, 0),
    ('status', 2, 0), ('payload_size', 4, None), ('fragment_index', 2, 0),
    ('fragment_count', 2, 1), ('message_size', 4, None), ('budget_us', 4, 0),
    ('item', 4, 0), ('sender_time_ns', 8, 0), ('trace_id', 8, 0),
]
HELLO = [
    ('version_min', 2, 1), ('version_max', 2, 1), ('features', 4, 0), ('client_epoch', 8, None),
    ('channel', 8, None), ('clock_domain', 8, 0), ('message_size_max', 4, None),
    ('reserved', 4, 0), ('cookie', 16, 0), ('reserved_end', 8, 0),
]
WELCOME = [
    ('version', 2, 1), ('band_low', 2, 0), ('band_high', 2, 32767), ('ceiling', 2, 32767),
    ('features', 4, 0), ('window', 2, 8), ('reserved', 2, 0), ('server_epoch', 8, None),
    ('clock_domain', 8, 0), ('message_size_max', 4, None), ('reserved_end', 12, 0),
]
BIND_REPLY = [
    ('service', 4, None), ('priority', 2, 0), ('flags', 1, 2), ('reserved', 1, 0),
    ('fingerprint', 8, None), ('method_count', 2, None), ('reserved_end', 6, 0),
]
ACK = [('first_missing', 2, None), ('reserved', 6, 0), ('later', 32, 0)]
CREDIT = [('first_missing', 4, None), ('byte_limit', 4, None), ('later', 8, 0)]
METHOD = [('id', 2, None), ('reserved', 2, 0), ('fingerprint', 4, None)]

LAYOUTS = {'HELLO': HELLO, 'WELCOME': WELCOME}


def number(value, size):
    """A little-endian number, or a placeholder."""
    if isinstance(value, str):
        return f'<{value}>'
    return value.to_bytes(size, 'little').hex()


def lay_out(layout, **values):
    """The fields of `layout` as hex; those that are not given have their usual value."""
    unknown = set(values) - {name for name, _, _ in layout}
    assert not unknown, f'no such field: {unknown}'
    hex_text = ''
    for name, size, usual in layout:
        value = values.get(name, usual)
        assert value is not None, f'{name} needs a value'
        hex_text += number(value, size)
    return hex_text


def size_of(hex_text, free=()):
    """How many bytes `hex_text` stands for; `free` has the sizes of its placeholders."""
    size = 0
    while hex_text:
        if hex_text[0] == '<':
            name, hex_text = hex_text[1:].split('>', 1)
            size += free[name]['size']
        else:
            size, hex_text = size + 1, hex_text[2:]
    return size


def text(value):
    """Text as a u16 length and its bytes."""
    return number(len(value), 2) + value.encode().hex()


def frame(kind, payload='', free=(), **fields):
    """A whole frame of `kind`, with a payload of hex, and its sizes right unless given."""
    size = size_of(payload, free)
    fields.setdefault('payload_size', size)
    fields.setdefault('message_size', fields['payload_size'])
    fields['kind'] = KINDS.get(kind, kind)
    return lay_out(HEADER, **fields) + payload


def bind_request(path, interface, fingerprint):
    return number(fingerprint, 8) + text(path) + text(interface)


def bind_reply(methods=(), **fields):
    fields.setdefault('method_count', len(methods))
    entries = ''.join(lay_out(METHOD, id=id_, fingerprint=print_) for id_, print_ in methods)
    return lay_out(BIND_REPLY, **fields) + entries
