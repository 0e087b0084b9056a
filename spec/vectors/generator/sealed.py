"""Vectors of sealed sessions: handshakes with fixed keys, frames, windows, changes of keys."""

from frames import HELLO, KINDS, WELCOME, frame, lay_out
import noise

SEALED, AES_GCM = 1, 2
FLAG_SEALED = 16
SESSION = 0xb7fc5e0b78510000
FORMER = 0x1122334455667788
COOKIE = bytes(range(1, 17))
EDGE = 2**22


def fixed_key(number):
    """A private key that anybody can see is none to use."""
    return bytes([number]) * 32


CLIENT, SERVER = fixed_key(0x11), fixed_key(0x22)
CLIENT_EPHEMERAL, SERVER_EPHEMERAL = fixed_key(0x33), fixed_key(0x44)


def sealed_cookie(server_public, suites=3):
    return COOKIE + server_public + suites.to_bytes(4, 'little') + bytes(4)


def prologue_of(hello_frame, cookie):
    """Of a HELLO with or without message 1 (3.4)."""
    priority, call_id = hello_frame[4:6], hello_frame[16:20]
    return b'H-Protocol 1.0 S' + priority + call_id + hello_frame[64:128] + cookie.ljust(56, b'\0')


def welcome_inside(features, former, session=SESSION):
    welcome = bytes.fromhex(lay_out(WELCOME, server_epoch=0x5e12e7, message_size_max=1320,
                                    features=features))
    return session.to_bytes(8, 'little') + welcome + bytes([former]) + bytes(7)


def handshake(name, suite, psk, former, has_cookie):
    features = SEALED | (AES_GCM if suite else 0)
    server_public = noise.public_of(SERVER)
    cookie = sealed_cookie(server_public) if has_cookie else b''
    hello = bytes.fromhex(lay_out(
        HELLO, client_epoch=0xc11e47, channel=1, message_size_max=1320, features=features,
        cookie=int.from_bytes(COOKIE, 'little') if has_cookie else 0))
    usual = dict(priority=24000, call_id=5, sender_time_ns=1_000_050_000)
    hello_header = bytes.fromhex(frame('HELLO', (hello + bytes(104)).hex(), **usual))[:64]
    prologue = prologue_of(hello_header + hello, cookie)
    client = noise.Client(suite, CLIENT, server_public, CLIENT_EPHEMERAL, prologue, psk)
    named = FORMER if former else 0
    message_1 = client.message_1(named.to_bytes(8, 'little'))
    server = noise.Server(suite, SERVER, prologue, psk)
    public, payload = server.read_message_1(message_1)
    assert public == noise.public_of(CLIENT) and payload == named.to_bytes(8, 'little')
    inside = welcome_inside(features, former)
    message_2 = server.message_2(SERVER_EPHEMERAL, inside)
    assert client.read_message_2(message_2) == inside and client.keys() == server.keys()
    client_key, server_key = client.keys()
    return dict(
        name=name, rules=['sec-3.2-1', 'sec-3.3-1', 'sec-3.4-1'], suite=noise.NAMES[suite],
        medium='datagram' if has_cookie else 'stream', psk=psk.hex(),
        client_private=CLIENT.hex(), client_ephemeral=CLIENT_EPHEMERAL.hex(),
        server_private=SERVER.hex(), server_ephemeral=SERVER_EPHEMERAL.hex(),
        former_session=f'0x{named:016x}', former=former, cookie=cookie.hex(),
        prologue=prologue.hex(),
        hello=(hello_header + hello + message_1).hex(),
        welcome=frame('WELCOME', message_2.hex(), session=SESSION, **usual),
        welcome_inside=inside.hex(), handshake_hash=client.h.hex(),
        client_key=client_key.hex(), server_key=server_key.hex())


def handshakes():
    psk = bytes(range(32))
    return [
        handshake('suite 0 over UDP', 0, noise.NO_PSK, 0, True),
        handshake('suite 1 over UDP, after a lost session', 1, noise.NO_PSK, 2, True),
        handshake('suite 0 with a pre-shared key, where the former session lives', 0, psk, 1, True),
        handshake('suite 1 with a pre-shared key, over a stream', 1, psk, 0, False),
    ]


def header_of(kind, payload_size, **fields):
    """The header of a sealed frame."""
    flags = fields.pop('flags', 0) | FLAG_SEALED
    whole = frame(kind, '00' * payload_size, flags=flags, priority=24000, session=SESSION, **fields)
    return bytes.fromhex(whole)[:64]


def frames():
    """The first frames of a session, in the order of their counters."""
    call = dict(call_id=1, service=1, method=2)
    cases = [
        ('CALL', 'CALL', '01', dict(call, budget_us=800, trace_id=0x7ace)),
        ('its copy: another counter, as its budget is another', 'CALL', '01',
         dict(call, budget_us=300, trace_id=0x7ace, flags=1)),
        ('CANCEL, without payload', 'CANCEL', '', call),
        ('CALL, the first of three fragments', 'CALL', 'a5' * 100,
         dict(call, fragment_count=3, message_size=201)),
        ('CREDIT', 'CREDIT', '03000000' + '00' * 12, dict(call, item=7)),
        ('the largest payload of a datagram', 'CALL', 'a5' * 1320, call),
        ('CLOSE', 'CLOSE', '', {}),
    ]
    for suite in (0, 1):
        key = fixed_key(0x55 + suite)
        sender = noise.Sender(suite, key)
        for name, kind, payload, fields in cases:
            payload = bytes.fromhex(payload)
            header = header_of(kind, len(payload), **fields)
            yield dict(name=name, rules=['sec-4-1', 'sec-4-3', 'sec-5-1'],
                       suite=noise.NAMES[suite], key=key.hex(), counter=sender.counter,
                       header=header.hex(), payload=payload.hex(),
                       hex=sender.seal(header, payload).hex())


def keys():
    for suite in (0, 1):
        all_keys = noise.Keys(suite, fixed_key(0x55 + suite))
        yield dict(suite=noise.NAMES[suite], rules=['sec-5-5'],
                   keys=[all_keys.of(generation * EDGE).key.hex() for generation in range(4)])


# What a receiver that opens frames of these counters, in this order, makes of each.
SEQUENCES = [
    ('copies and frames out of order', ['sec-5-3', 'sec-5-4'], [0, 0, 2, 1, 1, 2, 3]),
    ('the edge of the window', ['sec-5-4'], [0, 1023, 0, 1, 1024, 1, 0, 2, 1025, 2, 3, 3000, 1976,
                                             1977]),
    ('a gap larger than the window', ['sec-5-4'], [5, 5000, 5, 3976, 3977, 3977, 10_000, 5001]),
    ('from one key to the next, out of order', ['sec-5-5'],
     [EDGE - 1, EDGE + 1, EDGE, EDGE - 2, EDGE + 1022, EDGE - 2, EDGE - 1, EDGE - 3]),
    ('one key ahead is opened, two are not', ['sec-5-5'],
     [2 * EDGE, EDGE, 2 * EDGE, 4 * EDGE - 1, 3 * EDGE, 5 * EDGE, EDGE]),
    ('the end of counters', ['sec-5-6'], [0, 2**48, 2**64 - 1, 1]),
]


def windows():
    for suite in (0, 1):
        key = fixed_key(0x55 + suite)
        for name, rules, counters in SEQUENCES:
            sender, receiver = noise.Sender(suite, key), noise.Receiver(suite, key)
            steps = []
            for counter in counters:
                header = header_of('CALL', 1, call_id=1, service=1, method=2)
                # Beyond the end there is no key; any tag will do.
                sealed = sender.seal(header, b'\1', counter) if counter < 2**48 else \
                    header + b'\1' + counter.to_bytes(8, 'little') + bytes(16)
                try:
                    receiver.open(sealed)
                    result = dict()
                except noise.Refused as reason:
                    result = dict(drop=str(reason))
                steps.append(dict(counter=f'0x{counter:016x}', **result, hex=sealed.hex()))
            yield dict(name=name, rules=rules, suite=noise.NAMES[suite], key=key.hex(), steps=steps)


def bad_frames():
    """A receiver of a fresh session drops each but the first, and the session stays fresh."""
    key = fixed_key(0x55)
    header = header_of('CALL', 20, call_id=1, service=1, method=2, budget_us=800)
    good = noise.Sender(0, key).seal(header, b'\xa5' * 20)

    def changed(at, value):
        return good[:at] + bytes([good[at] ^ value]) + good[at + 1:]

    cases = [
        ('another budget', 'bad_seal', ['sec-4-4'], changed(40, 1)),
        ('another priority', 'bad_seal', ['sec-4-4'], changed(4, 1)),
        ('another bit of the payload', 'bad_seal', ['sec-4-4'], changed(64, 128)),
        ('another counter', 'bad_seal', ['sec-4-4'], changed(84, 1)),
        ('another bit of the tag', 'bad_seal', ['sec-4-4'], changed(107, 1)),
        ('the flag taken away', 'unsealed', ['sec-4-4'], changed(6, FLAG_SEALED)),
        ('another reserved flag', 'reserved_set', ['sec-4-2'], changed(6, 32)),
        ('a flag that the kind does not have', 'reserved_set', ['sec-4-2'], changed(6, 12)),
        ('the version', 'bad_version', ['sec-4-2'], changed(2, 3)),
        ('one byte less', 'bad_length', ['sec-4-2'], good[:-1]),
        ('one byte more', 'bad_length', ['sec-4-2'], good + b'\0'),
        ('a header alone', 'bad_length', ['sec-4-2'], good[:64]),
        ('less than a header', 'too_short', ['sec-4-2'], good[:63]),
    ]
    for kind in ('HELLO', 'COOKIE', 'WELCOME'):
        cases.append((f'a sealed {kind}', 'reserved_set', ['sec-4-1'],
                      good[:3] + bytes([KINDS[kind]]) + good[4:]))
    large = header_of('CALL', 1321, call_id=1, service=1, method=2)
    cases.append(('a payload too large for a datagram', 'bad_length', ['sec-4-3'],
                  noise.Sender(0, key).seal(large, bytes(1321))))
    cases.insert(0, ('nothing: this one is good', '', ['sec-4-1'], good))
    return [dict(name=name, rules=rules, suite=noise.NAMES[0], key=key.hex(), drop=drop,
                 hex=text.hex())
            for name, drop, rules, text in cases]


def bad_payloads():
    """Payloads of handshakes that are dropped as bad_payload."""
    cookie = sealed_cookie(noise.public_of(SERVER))
    good = handshake('', 0, noise.NO_PSK, 0, True)
    hello = bytes.fromhex(good['hello'])[64:]
    inside = bytes.fromhex(good['welcome_inside'])

    def with_byte(text, at, value):
        return text[:at] + bytes([value]) + text[at + 1:]

    bad = [
        ('COOKIE', 'one byte less', cookie[:-1]),
        ('COOKIE', 'one byte more', cookie + b'\0'),
        ('COOKIE', 'a reserved byte', with_byte(cookie, 55, 1)),
        ('HELLO', 'one byte less', hello[:-1]),
        ('HELLO', 'one byte more', hello + b'\0'),
        ('HELLO', 'without the feature', with_byte(hello, 4, 0)),
        ('HELLO', 'the suite without the feature', with_byte(hello, 4, AES_GCM)),
        ('HELLO', 'a feature that nobody knows', with_byte(hello, 4, SEALED | 4)),
        ('HELLO', 'client_epoch 0', hello[:8] + bytes(8) + hello[16:]),
        ('WELCOME', 'one byte less', inside[:-1]),
        ('WELCOME', 'session 0', bytes(8) + inside[8:]),
        ('WELCOME', 'without the feature', with_byte(inside, 16, 0)),
        ('WELCOME', 'another suite', with_byte(inside, 16, SEALED | AES_GCM)),
        ('WELCOME', 'a window that is no power of two', with_byte(inside, 20, 7)),
        ('WELCOME', 'former 4', with_byte(inside, 56, 4)),
        ('WELCOME', 'a reserved byte', with_byte(inside, 63, 1)),
    ]
    rules = {'COOKIE': 'sec-3.1-2', 'HELLO': 'sec-3.2-1', 'WELCOME': 'sec-3.3-1'}
    return [dict(kind=kind, name=name, rules=[rules[kind]], hex=text.hex())
            for kind, name, text in bad]


def sealed():
    return dict(
        subject='Sealed sessions (security.md). All keys are fixed, to be used for nothing else.',
        cookie=dict(rules=['sec-3.1-1'], cookie=COOKIE.hex(),
                    server_key=noise.public_of(SERVER).hex(), suites=3,
                    hex=sealed_cookie(noise.public_of(SERVER)).hex()),
        bad_payloads=bad_payloads(), handshakes=handshakes(), frames=list(frames()),
        bad_frames=bad_frames(), keys=list(keys()), windows=list(windows()))
