"""Vectors of one frame or one payload each."""

from frames import (ACK, ACK_WANTED, CREDIT, HELLO, KIB, KINDS, MIB, NO_REPLY, REPEATED,
                    REPLY_ON_RECEIPT, STATUSES, WELCOME, bind_reply, bind_request, frame, lay_out,
                    number, size_of, text)

SESSION = 0xb7fc5e0b78510000
ONES_16, ONES_32, ONES_64 = 2**16 - 1, 2**32 - 1, 2**64 - 1
BOTH = ['datagram', 'stream']

# A HELLO and a WELCOME that nobody objects to.
GOOD_HELLO = dict(client_epoch=0xc11e47, channel=1, message_size_max=1344)
GOOD_WELCOME = dict(server_epoch=0x5e12e7, message_size_max=1344)


def wide(value, size):
    """Numbers of eight bytes go as text: many readers of JSON round them."""
    return f'0x{value:016x}' if size == 8 else value


def headers_good():
    vectors = []

    def add(name, kind, payload='', rules=('hp-2-1',), **fields):
        flags = fields.get('flags', 0)
        shown = dict(kind=kind, priority=0, is_repeated=flags & REPEATED != 0,
                     is_ack_wanted=flags & ACK_WANTED != 0, is_no_reply=flags & NO_REPLY != 0,
                     is_reply_on_receipt=flags & REPLY_ON_RECEIPT != 0, fragment_index=0,
                     fragment_count=1, message_size=size_of(payload), session=0, call_id=0,
                     service=0, method=0, status='ok', budget_us=0, item=0, sender_time_ns=0,
                     trace_id=0)
        shown |= {key: value for key, value in fields.items() if key in shown}
        if 'status' in fields:
            fields['status'] = STATUSES[fields['status']]
        for key in ('session', 'sender_time_ns', 'trace_id'):
            shown[key] = wide(shown[key], 8)
        vectors.append(dict(name=name, rules=list(rules), header=shown, payload=payload,
                            hex=frame(kind, payload, **fields)))

    usual = dict(priority=24000, session=SESSION, call_id=1, sender_time_ns=1_000_050_000)
    handshake = dict(usual, session=0)
    add('HELLO', 'HELLO', lay_out(HELLO, **GOOD_HELLO), **handshake)
    add('COOKIE', 'COOKIE', '0102030405060708090a0b0c0d0e0f10', **handshake)
    add('WELCOME', 'WELCOME', lay_out(WELCOME, **GOOD_WELCOME), **usual)
    add('CALL', 'CALL', '01', service=1, method=2, budget_us=800, trace_id=0x7ace, **usual)
    add('CALL, repeated', 'CALL', '01', service=1, method=2, budget_us=300, flags=REPEATED, **usual)
    add('CLOSE', 'CLOSE', **usual)
    add('ACK', 'ACK', lay_out(ACK, first_missing=3, later=0b1001), service=1, method=2, **usual)
    add('CALL, the first of three fragments', 'CALL', 'a5' * 100, service=1, method=2,
        fragment_count=3, message_size=201, **usual)
    add('CALL, the last of three fragments, which wants an ACK', 'CALL', 'a5', service=1, method=2,
        fragment_index=2, fragment_count=3, message_size=201, flags=ACK_WANTED, **usual)
    add('REPLY, a fragment that is repeated and wants an ACK', 'REPLY', 'a5' * 100, service=1,
        method=2, fragment_index=1, fragment_count=3, message_size=201,
        flags=REPEATED | ACK_WANTED, **usual)
    add('CALL, which wants no reply', 'CALL', '01', ['hp-2-5', 'hp-5.8-1'], service=1, method=2,
        budget_us=800, flags=NO_REPLY, **usual)
    add('CALL, which wants its reply on receipt', 'CALL', '01', ['hp-2-5', 'hp-5.8-3'], service=1,
        method=2, budget_us=800, flags=REPLY_ON_RECEIPT, **usual)
    add('CALL, which wants its reply on receipt, repeated', 'CALL', '01', ['hp-2-5', 'hp-5.3-2'],
        service=1, method=2, budget_us=800, flags=REPEATED | REPLY_ON_RECEIPT, **usual)
    add('CALL, a fragment that wants its reply on receipt', 'CALL', 'a5' * 100, ['hp-2-4'],
        service=1, method=2, fragment_count=3, message_size=201, flags=REPLY_ON_RECEIPT, **usual)
    add('CALL, which asks for a stream', 'CALL', '01', ['hp-2-5'], service=1, method=2,
        budget_us=800, item=4, **usual)
    add('CALL, which asks for a stream, repeated, which wants an ACK', 'CALL', '01',
        ['hp-2-5', 'hp-5.10-3'], service=1, method=2, budget_us=800, item=4,
        flags=REPEATED | ACK_WANTED, **usual)
    add('CALL, a fragment that asks for a stream', 'CALL', 'a5' * 100, ['hp-2-4', 'hp-2-5'],
        service=1, method=2, fragment_count=3, message_size=201, item=32, **usual)
    add('ACK of a stream', 'ACK', lay_out(ACK, first_missing=1), ['hp-2-5', 'hp-5.10-5'],
        service=1, method=2, item=7, **usual)
    add('REPLY of a stream', 'REPLY', '', ['hp-2-5', 'hp-5.10-6'], service=1, method=2,
        budget_us=900, item=7, **usual)
    add('CANCEL', 'CANCEL', '', ['hp-5.9-1'], service=1, method=2, trace_id=0x7ace, **usual)
    add('ITEM, the first', 'ITEM', '01', ['hp-5.10-1'], service=1, method=2, **usual)
    add('ITEM, a later one, repeated', 'ITEM', '0203', ['hp-5.10-1'], service=1, method=2, item=6,
        flags=REPEATED, **usual)
    add('ITEM without payload, of the largest number', 'ITEM', '', ['hp-5.10-1'], service=1,
        method=2, item=ONES_32, **usual)
    add('ITEM, the first fragment of one', 'ITEM', 'a5' * 1344, ['hp-2-4', 'hp-5.10-1'], service=1,
        method=2, item=6, fragment_count=3, message_size=2 * 1344 + 100, **usual)
    add('ITEM, the last fragment of one, repeated', 'ITEM', 'a5' * 100, ['hp-2-4', 'hp-5.10-1'],
        service=1, method=2, item=8, flags=REPEATED, fragment_index=2, fragment_count=3,
        message_size=2 * 1344 + 100, **usual)
    add('CREDIT', 'CREDIT', lay_out(CREDIT, first_missing=3, byte_limit=43100), ['hp-5.10-4'],
        service=1, method=2, budget_us=10_000_000, item=7, **usual)
    add('CREDIT, for as long as the connection lasts', 'CREDIT',
        lay_out(CREDIT, first_missing=3, byte_limit=261_988), ['hp-5.10-7'], service=1, method=2,
        budget_us=ONES_32, item=7, **usual)
    add('CREDIT, which shows a gap and wants an answer', 'CREDIT',
        lay_out(CREDIT, first_missing=3, byte_limit=43100, later=0b1001),
        ['hp-5.10-4', 'hp-5.10-5'], service=1, method=2, budget_us=10_000_000, item=7,
        flags=ACK_WANTED, **usual)
    for status in STATUSES:
        add(f'REPLY {status}', 'REPLY', service=1, method=2, budget_us=10, status=status, **usual)
    add('REPLY, repeated', 'REPLY', '0203', service=1, method=2, budget_us=10, flags=REPEATED,
        **usual)
    for status in ('overload', 'wrong_band', 'unknown_session', 'version_unsupported',
                   'bad_limits'):
        add(f'REFUSE {status}', 'REFUSE', status=status, **usual)
    add('all numbers 0', 'CALL')
    add('all numbers at their largest', 'CALL', priority=32767, session=ONES_64, call_id=ONES_32,
        service=ONES_32, method=ONES_16, budget_us=ONES_32, sender_time_ns=ONES_64,
        trace_id=ONES_64)
    add('each byte of the numbers another', 'CALL', priority=0x0102, session=0x0304050607080910,
        call_id=0x11121314, service=0x15161718, method=0x1920, budget_us=0x21222324,
        sender_time_ns=0x2526272829303132, trace_id=0x3334353637383940)
    add('the largest payload of a datagram', 'CALL', 'a5' * 1344, **usual)
    return dict(subject='Frames with a header that every receiver takes.', vectors=vectors)


def headers_bad():
    vectors = []

    def add(name, drop, hex_text, rules, medium=tuple(BOTH), receiver='any', ends_stream=True):
        vectors.append(dict(name=name, rules=list(rules), drop=drop, receiver=receiver,
                            medium=list(medium), hex=hex_text,
                            **({'ends_stream': ends_stream} if 'stream' in medium else {})))

    def broken(name, drop, rule='hp-2-1', **fields):
        kind = fields.pop('kind', 'CALL')
        add(name, drop, frame(kind, '01020304', **fields), [rule, 'hp-8-1', 'hp-8-2'])

    good = frame('CALL', session=SESSION, call_id=1)
    add('no byte at all', 'too_short', '', ['hp-2-1'], medium=['datagram'])
    add('one byte', 'too_short', good[:2], ['hp-2-1'], medium=['datagram'])
    add('one byte less than a header', 'too_short', good[:-2], ['hp-2-1'], medium=['datagram'])
    broken('magic in the other order', 'bad_magic', magic=0x4850)
    broken('first byte of the magic wrong', 'bad_magic', magic=0x5068)
    broken('second byte of the magic wrong', 'bad_magic', magic=0x7048)
    add('a request of HTTP', 'bad_magic',
        b'GET /index.html HTTP/1.1\r\nHost: example.org\r\nAccept: text/html\r\n\r\n'.hex(),
        ['hp-2-1', 'hp-8-2'])
    for version in (0, 2, 255):
        broken(f'version {version}', 'bad_version', version=version)
    for kind in (0, 12, 255):
        broken(f'kind {kind}', 'bad_kind', kind=kind)
    for kind in ('COOKIE', 'WELCOME', 'REFUSE', 'REPLY', 'ITEM'):
        add(f'{kind} to a server', 'bad_kind', frame(kind, session=SESSION), ['hp-3-1'],
            receiver='server', ends_stream=False)
    for kind in ('HELLO', 'CALL', 'CANCEL', 'CREDIT'):
        add(f'{kind} to a client', 'bad_kind', frame(kind, session=SESSION), ['hp-3-1'],
            receiver='client', ends_stream=False)
    for priority in (32768, 65535):
        broken(f'priority {priority}', 'bad_priority', priority=priority)
    for bit in range(4, 16):
        broken(f'reserved flag {bit}', 'reserved_set', 'hp-2-2', flags=1 << bit)
    broken('a reserved flag beside repeated', 'reserved_set', 'hp-2-2', flags=17)
    broken('a oneway of both kinds', 'reserved_set', 'hp-2-5', flags=NO_REPLY | REPLY_ON_RECEIPT)
    for flag, name in ((NO_REPLY, 'no reply'), (REPLY_ON_RECEIPT, 'reply on receipt')):
        broken(f'a stream with {name}', 'reserved_set', 'hp-2-5', flags=flag, item=1)
        for kind in KINDS:
            if kind != 'CALL':
                broken(f'{name} on {kind}', 'reserved_set', 'hp-2-5', kind=kind, flags=flag)
    for kind in ('HELLO', 'COOKIE', 'WELCOME', 'REFUSE', 'CLOSE', 'CANCEL'):
        broken(f'an item on {kind}', 'reserved_set', 'hp-2-5', kind=kind, item=1)
    for byte in range(4):
        broken(f'byte {44 + byte} of a CLOSE', 'reserved_set', 'hp-2-5', kind='CLOSE',
               item=1 << 8 * byte)
    broken('a payload of 16 MiB and a byte', 'bad_length', payload_size=16 * MIB + 1)
    broken('a payload of 4 GiB', 'bad_length', payload_size=ONES_32)
    for wrong in (0, 3, 5, 16 * MIB):
        add(f'payload_size {wrong} where 4 bytes follow', 'bad_length',
            frame('CALL', '01020304', payload_size=wrong), ['hp-2-3'], medium=['datagram'])
    add('a datagram of 1409 bytes', 'bad_length', frame('CALL', 'a5' * 1345), ['hp-2-6'],
        medium=['datagram'])
    broken('fragment 1 of 1', 'bad_fragment', 'hp-2-4', fragment_index=1)
    broken('fragment 0 of 0', 'bad_fragment', 'hp-2-4', fragment_count=0)
    broken('fragment 0 of 2', 'bad_fragment', 'hp-2-4', fragment_count=2)
    broken('fragment 2 of 2', 'bad_fragment', 'hp-2-4', fragment_index=2, fragment_count=2,
           message_size=8)
    broken('two fragments where one would do', 'bad_fragment', 'hp-5.6-1', fragment_count=2,
           message_size=4)
    broken('too few fragments for the message', 'bad_fragment', 'hp-5.6-1', fragment_count=2,
           message_size=9)
    broken('too many fragments for the message', 'bad_fragment', 'hp-5.6-1', fragment_count=3,
           message_size=8)
    broken('a last fragment that leaves no equal ones', 'bad_fragment', 'hp-5.6-1',
           fragment_index=2, fragment_count=3, message_size=11)
    for kind in KINDS:
        if kind not in ('CALL', 'REPLY', 'ITEM'):
            broken(f'{kind} in fragments', 'bad_fragment', 'hp-2-4', kind=kind, fragment_count=2,
                   message_size=8)
    broken('a CALL that wants no reply in fragments', 'bad_fragment', 'hp-5.8-2', flags=NO_REPLY,
           fragment_count=2, message_size=8)
    broken('a message smaller than the payload', 'bad_fragment', 'hp-2-4', message_size=3)
    broken('a message larger than the payload', 'bad_fragment', 'hp-2-4', message_size=5)
    # Each of these has the fault that its name says, and the next in the order of the checks.
    broken('magic, then version', 'bad_magic', magic=0, version=0)
    broken('version, then kind', 'bad_version', version=2, kind=0)
    broken('kind, then priority', 'bad_kind', kind=12, priority=32768)
    broken('priority, then flags', 'bad_priority', priority=32768, flags=16)
    broken('priority, then item', 'bad_priority', kind='CLOSE', priority=32768, item=1)
    broken('flags, then length', 'reserved_set', flags=16, payload_size=16 * MIB + 1)
    broken('item, then length', 'reserved_set', kind='CLOSE', item=1, payload_size=16 * MIB + 1)
    broken('length, then fragments', 'bad_length', payload_size=16 * MIB + 1, fragment_index=1)
    add('fragments, then the size of the datagram', 'bad_fragment',
        frame('CALL', '01020304', payload_size=3, message_size=4), ['hp-2-3'], medium=['datagram'])
    add('all bytes ff', 'bad_magic', 'ff' * 64, ['hp-2-1'])
    add('all bytes 00', 'bad_magic', '00' * 64, ['hp-2-1'])
    return dict(subject='Frames that a receiver drops for their header, and the reason.',
                vectors=vectors)


def shown_fields(layout, given):
    """What a reader has to make of a payload, without what is reserved."""
    fields = {}
    for name, size, usual in layout:
        if name.startswith('reserved'):
            continue
        value = given.get(name, usual)
        fields[name] = number(value, size) if size == 16 else wide(value, size)
    return fields


def reserved_set(layout, good, rules, expected):
    """One vector for each reserved byte of a payload."""
    vectors, offset = [], 0
    for name, size, _ in layout:
        if name.startswith('reserved'):
            for byte in range(size):
                vectors.append(dict(name=f'reserved byte {offset + byte}', rules=rules, **expected,
                                    hex=lay_out(layout, **(good | {name: 1 << 8 * byte}))))
        offset += size
    return vectors


def other_sizes(good, rules, expected):
    return [dict(name=name, rules=rules, **expected, hex=hex_text) for name, hex_text in (
        ('no byte at all', ''), ('one byte less', good[:-2]), ('one byte more', good + '00'))]


def hello():
    def vector(name, rules, answer, **fields):
        given = GOOD_HELLO | fields
        return dict(name=name, rules=rules, fields=shown_fields(HELLO, given), answer=answer,
                    hex=lay_out(HELLO, **given))

    cookie, dropped = {'kind': 'COOKIE'}, {'drop': 'bad_payload'}

    def refused(status):
        return {'kind': 'REFUSE', 'status': status}

    good = [
        vector('a first HELLO', ['hp-4.1-1'], cookie),
        vector('more versions than one', ['hp-4.1-2'], cookie, version_min=0, version_max=7),
        vector('the smallest and largest numbers', ['hp-4.1-1'], cookie, client_epoch=1, channel=0,
               message_size_max=KIB),
        vector('the largest numbers', ['hp-4.1-1'], cookie, client_epoch=ONES_64, channel=ONES_64,
               clock_domain=ONES_64, message_size_max=16 * MIB),
        vector('optional features that nobody knows', ['hp-4.1-1'], cookie, features=ONES_32),
        vector('a cookie of nobody', ['hp-4.2-2'], cookie, cookie=2**128 - 1),
        vector('only later versions', ['hp-4.1-2'], refused('version_unsupported'),
               version_min=2, version_max=3),
        vector('only version 0', ['hp-4.1-2'], refused('version_unsupported'),
               version_min=0, version_max=0),
        vector('versions from high to low', ['hp-4.1-2'], refused('version_unsupported'),
               version_min=2, version_max=1),
        vector('one byte less than the least limit', ['hp-4.1-2'], refused('bad_limits'),
               message_size_max=KIB - 1),
        vector('no limit', ['hp-4.1-2'], refused('bad_limits'), message_size_max=0),
        vector('one byte more than the largest limit', ['hp-4.1-2'], refused('bad_limits'),
               message_size_max=16 * MIB + 1),
    ]
    bad = other_sizes(lay_out(HELLO, **GOOD_HELLO), ['hp-4.1-1'], dropped)
    bad += reserved_set(HELLO, GOOD_HELLO, ['hp-4.1-1', 'hp-8-1'], dropped)
    bad.append(dict(name='client_epoch 0', rules=['hp-4.1-1'], **dropped,
                    hex=lay_out(HELLO, **(GOOD_HELLO | dict(client_epoch=0)))))
    return dict(subject='Payloads of HELLO, to a server of UDP with the whole range as its band.',
                good=good, bad=bad)


def cookie():
    return dict(
        subject='Payloads of COOKIE, to a client that sent its HELLO over UDP.',
        good=[dict(name='sixteen bytes', rules=['hp-4.2-3'],
                   hex='00112233445566778899aabbccddeeff')],
        bad=[dict(name=f'{size} bytes', rules=['hp-8-1'], drop='bad_payload', hex='11' * size)
             for size in (0, 15, 17)])


def welcome():
    dropped = {'drop': 'bad_payload'}

    def vector(name, rules, session=SESSION, **fields):
        given = GOOD_WELCOME | fields
        return dict(name=name, rules=rules, session=wide(session, 8),
                    fields=shown_fields(WELCOME, given), hex=lay_out(WELCOME, **given))

    def wrong(name, session=SESSION, **fields):
        return dict(name=name, rules=['hp-4.3-1', 'hp-8-1'], session=wide(session, 8), **dropped,
                    hex=lay_out(WELCOME, **(GOOD_WELCOME | fields)))

    good = [
        vector('a band of all priorities', ['hp-4.3-1']),
        vector('a band of one priority', ['hp-4.3-1'], band_low=24000, band_high=24000),
        vector('a ceiling below the band', ['hp-4.3-1'], ceiling=0),
        vector('the smallest numbers', ['hp-4.3-1'], session=1, window=1, server_epoch=1),
        vector('the largest numbers', ['hp-4.3-1'], session=ONES_64, window=32768,
               server_epoch=ONES_64, clock_domain=ONES_64, message_size_max=16 * MIB),
    ]
    bad = [vector | dict(session=wide(SESSION, 8)) for vector in
           other_sizes(lay_out(WELCOME, **GOOD_WELCOME), ['hp-4.3-1'], dropped) +
           reserved_set(WELCOME, GOOD_WELCOME, ['hp-4.3-1'], dropped)]
    bad += [
        wrong('session 0', session=0),
        wrong('window 0', window=0),
        wrong('window 7, which does not divide 2³²', window=7),
        wrong('window 65535', window=ONES_16),
        wrong('server_epoch 0', server_epoch=0),
        wrong('a band below the priority', band_high=23999),
        wrong('a band above the priority', band_low=24001),
        wrong('a band from high to low', band_low=24001, band_high=24000),
        wrong('an end of the band that is no priority', band_high=32768),
        wrong('a ceiling that is no priority', ceiling=32768),
        wrong('a version that was not offered', version=2),
        wrong('a feature that was not offered', features=1),
        wrong('a limit of less than 1 KiB', message_size_max=KIB - 1),
        wrong('a limit above 16 MiB', message_size_max=16 * MIB + 1),
    ]
    return dict(subject='Payloads of WELCOME, to a client that asked for priority 24000; with the '
                        "session of the frame's header.", good=good, bad=bad)


def progress(layout, rules, subject, good):
    """Payloads of ACK or CREDIT, which say how far their sender is."""
    dropped = {'drop': 'bad_payload'}
    usual = dict(first_missing=3, later=0b1001)
    if layout is CREDIT:
        usual['byte_limit'] = 43_100

    def vector(name, **fields):
        shown = {key: number(value, 32) if layout is ACK and key == 'later' else wide(value, size)
                 for key, size, _ in layout if key != 'reserved'
                 for value in (fields.get(key, 0),)}
        return dict(name=name, rules=rules, fields=shown, hex=lay_out(layout, **fields))

    return dict(subject=subject, good=[vector(name, **fields) for name, fields in good],
                bad=other_sizes(lay_out(layout, **usual), rules, dropped) +
                reserved_set(layout, usual, rules, dropped))


def ack():
    return progress(ACK, ['hp-5.6-4', 'hp-8-1'], 'Payloads of ACK.', [
        ('nothing is there', dict(first_missing=0)),
        ('three are there, and two behind a gap', dict(first_missing=3, later=0b1001)),
        ('all of the most that there can be', dict(first_missing=12544)),
        ('the largest numbers', dict(first_missing=ONES_16, later=2**256 - 1))])


def credit():
    return progress(CREDIT, ['hp-5.10-8', 'hp-8-1'], 'Payloads of CREDIT.', [
        ('nothing is there', dict(first_missing=0, byte_limit=43_008)),
        ('three are there, and two behind a gap',
         dict(first_missing=3, byte_limit=43_100, later=0b1001)),
        ('the largest numbers',
         dict(first_missing=ONES_32, byte_limit=ONES_32, later=ONES_64))])


def bind_requests():
    answered = {'status': 'bad_request'}

    def vector(name, path, interface, fingerprint):
        return dict(name=name, rules=['hp-6.1-1'], path=path, interface=interface,
                    fingerprint=wide(fingerprint, 8), hex=bind_request(path, interface, fingerprint))

    def wrong(name, hex_text):
        return dict(name=name, rules=['hp-6.1-1'], **answered, hex=hex_text)

    usual = bind_request('lab/arm0', 'lab.Arm', 1)
    return dict(
        subject='Requests of the session\'s method 1, bind.',
        good=[vector('a path and an interface', 'lab/arm0', 'lab.Arm', 0x0123456789abcdef),
              vector('the longest path', 'p' * 200, 'lab.Arm', ONES_64),
              vector('the registry of names', 'rtpm/names', 'rtpm.names.Names', 0)],
        bad=[wrong('no byte at all', ''),
             wrong('no texts', usual[:16]),
             wrong('one byte less', usual[:-2]),
             wrong('one byte more', usual + '00'),
             wrong('a text longer than what is there', usual[:16] + number(65535, 2) + usual[20:]),
             wrong('a path of 201 bytes', number(1, 8) + text('p' * 201) + text('lab.Arm'))])


def bind_replies():
    refused = {'is_taken': False}
    methods = [(1, 0x11111111), (2, 0x22222222)]
    fixed = dict(service=1, fingerprint=0x0123456789abcdef)

    def vector(name, methods=(), **fields):
        given = fixed | fields
        flags = given.get('flags', 2)
        return dict(name=name, rules=['hp-6.1-5'], service=given['service'],
                    priority=given.get('priority', 0), is_server_declared=flags & 1 == 1,
                    is_method_list_complete=flags & 2 == 2,
                    fingerprint=wide(given['fingerprint'], 8),
                    methods=[dict(id=id_, fingerprint=print_) for id_, print_ in methods],
                    hex=bind_reply(methods, **given))

    def wrong(name, hex_text):
        return dict(name=name, rules=['hp-6.1-5'], **refused, hex=hex_text)

    usual = bind_reply(methods, **fixed)
    bad = other_sizes(usual, ['hp-6.1-5'], refused)
    bad += [
        wrong('service 0', bind_reply(methods, **(fixed | dict(service=0)))),
        wrong('priority 32768', bind_reply(methods, priority=32768, **fixed)),
        wrong('more methods than there are', bind_reply(methods, method_count=3, **fixed)),
        wrong('fewer methods than there are', bind_reply(methods, method_count=1, **fixed)),
    ]
    bad += [wrong(f'reserved flag {bit}', bind_reply(methods, flags=1 << bit, **fixed))
            for bit in range(2, 8)]
    bad += [wrong('reserved byte 7', bind_reply(methods, reserved=1, **fixed))]
    bad += [wrong(f'reserved byte {18 + byte}',
                  bind_reply(methods, reserved_end=1 << 8 * byte, **fixed)) for byte in range(6)]
    bad += [wrong(f'reserved byte {offset} in an entry', usual[:2 * offset] + '01' +
                  usual[2 * offset + 2:]) for offset in (26, 27, 34, 35)]
    return dict(
        subject='Replies of the session\'s method 1, bind, with status ok.',
        good=[vector('an object with two methods', methods),
              vector('no methods', []),
              vector('a server-declared object', methods, flags=3, priority=24000),
              vector('not all methods', methods, flags=0),
              vector('the largest numbers', [(ONES_16, ONES_32)], service=ONES_32, priority=32767,
                     fingerprint=ONES_64)],
        bad=bad)


def urls():
    def url(hosts, port, path, read=None):
        return dict(text=f'rtpm://{hosts}:{port}/{path}', hosts=read or [hosts], port=port,
                    path=path)

    return dict(
        subject='Addresses of objects.',
        good=[url('127.0.0.1', 7420, 'rtpm/names'), url('robot-7.lab.example', 1, 'a'),
              url('host', 65535, 'A.b-c_d/9'), url('h', 80, 'p' * 200),
              url('[2001:db8::1]', 7420, 'p', ['2001:db8::1']),
              url('[::ffff:10.0.0.7]', 1, 'p', ['::ffff:10.0.0.7']),
              url('[fe80::1%25eth0]', 1, 'p', ['fe80::1%eth0']),
              url('10.0.0.7,[fd00::7],h', 1, 'p', ['10.0.0.7', 'fd00::7', 'h']),
              url('a,b,c,d,e,f,g,h', 1, 'p', list('abcdefgh'))],
        bad=['', 'rtpm://', 'rtpm://h', 'rtpm://h/p', 'rtpm://h:1', 'rtpm://h:1/', 'rtpm://:1/p',
             'rtpm://h:/p', 'rtpm://h:0/p', 'rtpm://h:65536/p', 'rtpm://h:-1/p', 'rtpm://h:+1/p',
             'rtpm://h: 1/p', 'rtpm://h:0x10/p', 'rtpm://h:1a/p', 'rtpm://h:1:2/p', 'RTPM://h:1/p',
             'http://h:1/p', ' rtpm://h:1/p', 'rtpm://h:1//p', 'rtpm://h:1/p/', 'rtpm://h:1/a//b',
             'rtpm://h:1/a b', 'rtpm://h:1/a?b', 'rtpm://h:1/\u00e4', 'rtpm://::1:1/p',
             'rtpm://[::1]/p', 'rtpm://[::1:1/p', 'rtpm://[]:1/p', 'rtpm://[:::]:1/p',
             'rtpm://[1::2::3]:1/p', 'rtpm://[12345::]:1/p', 'rtpm://[1:2:3:4:5:6:7]:1/p',
             'rtpm://[1:2:3:4:5:6:7::8]:1/p', 'rtpm://[::1.2.3.256]:1/p', 'rtpm://[1.2.3.4]:1/p',
             'rtpm://[fe80::1%eth0]:1/p', 'rtpm://[fe80::1%25]:1/p', 'rtpm://h,:1/p',
             'rtpm://,h:1/p', 'rtpm://a,b,c,d,e,f,g,h,i:1/p', 'rtpm://u@h:1/p', 'rtpm://h:1/' + 'p' * 201])


def fnv1a_64(data):
    value = 0xcbf29ce484222325
    for byte in data:
        value = (value ^ byte) * 0x100000001b3 % 2**64
    return value


def clock_domains():
    boot = '01234567-89ab-4cde-8f01-23456789abcd\n'

    def vector(name, boot_id, time_namespace):
        return dict(name=name, rules=['hp-4.1-7'], boot_id=boot_id, time_namespace=time_namespace,
                    clock_domain=wide(fnv1a_64((boot_id + time_namespace).encode()), 8))

    return dict(
        subject='What /proc/sys/kernel/random/boot_id holds, the text of the link '
                '/proc/self/ns/time, and the clock_domain of both.',
        vectors=[vector('a kernel with time namespaces', boot, 'time:[4026531834]'),
                 vector('another time namespace', boot, 'time:[4026532448]'),
                 vector('a kernel without', boot, ''),
                 vector('another boot', 'f' + boot[1:], 'time:[4026531834]')])


def constants():
    return dict(
        subject='The numbers of hprotocol.md, to be compared with yours.',
        magic='4850', version=1, header_size=64, kinds=KINDS, statuses=STATUSES,
        flags={'repeated': REPEATED, 'ack_wanted': ACK_WANTED, 'no_reply': NO_REPLY,
               'reply_on_receipt': REPLY_ON_RECEIPT},
        session_service=0, method_bind=1, method_ping=2, method_describe=3, default_port=7420,
        limits=dict(datagram_frame_size_max=1408, datagram_payload_size_max=1344,
                    stream_frame_size_max=64 * KIB, stream_payload_size_max=64 * KIB - 64,
                    fragment_window=32, stream_fragment_window=4, fragment_count_max=12_544,
                    stream_window=32, stream_lease_max_ms=30_000, stream_silence_ms=3000,
                    stream_ask_interval_max_ms=500, stream_bytes_first_datagram=43_008,
                    stream_bytes_first_stream=65_472,
                    message_size_floor=KIB, message_size_ceiling=16 * MIB, call_window=8,
                    session_idle_min_s=30, cookie_span_s=10, path_size_max=200,
                    copy_interval_first_us=5000, copy_interval_min_us=500,
                    copy_interval_max_us=1_000_000))
