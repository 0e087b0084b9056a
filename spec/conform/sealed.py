"""Level S: sealed sessions of a server under test, by a client that was written from security.md
alone, on Python's `cryptography`."""

import base64
import os
import pathlib
import socket
import sys
import time

from black_box import INTERFACE, PATH, text
from layout import (CONSTANTS, HEADER_SIZE, STATUS_NAMES, STATUSES, encode, encode_payload,
                    header_of, kind_of, number)
from peer import Failure
from report import Result, write_failure
from subject import CannotPlay, FrameSplitter, SubjectError

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / 'vectors' / 'generator'))
try:
    import noise  # noqa: E402
except ImportError:
    sys.exit('rtpm-conform: level S needs the Debian package python3-cryptography')

SEALED = 1 << 4           # Of the header's flags.
FEATURE_SEALED, FEATURE_AES = 1, 2
PROTOCOL = b'H-Protocol 1.0 S'
PRIORITY = 24000
COUNT_METHOD = 2
BUDGET_US = 5_000_000
COOKIE_SIZE, WELCOME_SIZE = 56, 112
ANSWER_S = 0.15           # So long an answer takes at most; then the frame is sent again.
ATTEMPTS = 20
TRAILER = 24
HALF_OPEN_S = 2.6         # Behind that a half-open session is gone (sec-6-1).


class Silence(Exception):
    """Nothing came."""


def key_of(words):
    """The 32 bytes of a key in a text, which may have a name before and a comment behind it."""
    for word in words.split():
        try:
            data = base64.b64decode(word, validate=True)
        except ValueError:
            continue
        if len(word) == 44 and len(data) == 32:
            return data
    raise SubjectError(f'there is no key in "{words.strip()[:80]}": 44 characters of Base64')


def text_of(key):
    return 'rtpm25519 ' + base64.b64encode(key).decode()


def told(frame):
    """A frame's kind, and its status where it has one."""
    kind = kind_of(frame)
    if kind not in ('REFUSE', 'REPLY') or len(frame) < HEADER_SIZE:
        return kind
    status = header_of(frame)['status']
    return f'{kind} {STATUS_NAMES.get(status, status)}'


class Claimant(noise.Client):
    """A client that may show a public key which is not its own."""

    def message_1(self, payload):
        e = noise.public_of(self.ephemeral)
        self.mix_ephemeral(e)
        self.mix_key(noise.agree(self.ephemeral, self.server_public))
        static = self.encrypt(self.claimed)
        self.mix_key(noise.agree(self.private, self.server_public))
        return e + static + self.encrypt(payload)


class Channel:
    """One channel of a client: a socket, handshakes, and the keys of its session."""

    def __init__(self, subject, private=None, server_public=None):
        self.subject, self.is_stream = subject, subject.medium == 'stream'
        self.private = private or subject.private
        self.public = noise.public_of(self.private)
        self.server_public = server_public or subject.server_public
        self.epoch = number(os.urandom(8)) | 1
        self.number = number(os.urandom(3))
        self.call_id, self.service = 0, subject.service
        self.socket = None
        self.connect()

    def connect(self):
        self.close_socket()
        if self.is_stream:
            self.socket = socket.create_connection(self.subject.address, timeout=5)
            self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self.splitter, self.frames = Splitter(), []
        else:
            self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self.socket.connect(self.subject.address)

    def close_socket(self):
        if self.socket is not None:
            self.socket.close()

    # ---- frames ----

    def send(self, frame):
        try:
            self.socket.send(frame)
        except OSError:
            pass  # A missing server shows by its silence.

    def receive(self, wait_s=ANSWER_S):
        """The next frame; raises Silence. A stream's end is an empty one."""
        until = time.monotonic() + wait_s
        while True:
            if self.is_stream and self.frames:
                return self.frames.pop(0)
            left = until - time.monotonic()
            if left <= 0:
                raise Silence
            self.socket.settimeout(left)
            try:
                data = self.socket.recv(1 << 17)
            except socket.timeout:
                raise Silence from None
            except OSError:
                data = b''
            if not self.is_stream:
                return data
            if not data:
                return b''
            self.frames += self.splitter.feed(data)

    def ask(self, frame, kind, attempts=ATTEMPTS):
        """Sends a frame until one of `kind` comes, which it gives."""
        self.passed_over = b''
        attempts = 1 if self.is_stream else attempts
        for _ in range(attempts):
            self.send(frame)
            until = time.monotonic() + (2 if self.is_stream else ANSWER_S)
            while time.monotonic() < until:
                try:
                    answer = self.receive(until - time.monotonic())
                except Silence:
                    break
                if len(answer) >= HEADER_SIZE and kind_of(answer) == kind:
                    return answer
                if not answer:
                    break
                self.passed_over = answer
        raise Silence

    def expect(self, frame, kind, *rules):
        try:
            return self.ask(frame, kind)
        except Silence:
            text, frames = f'no {kind} came to {kind_of(frame)}', [('sent', frame)]
            if self.passed_over:
                text += f', but {told(self.passed_over)}'
                frames.append(('received', self.passed_over))
            raise Failure(text, rules, frames=frames) from None

    # ---- handshakes ----

    def hello(self, features, cookie=bytes(16), message=b''):
        payload = encode_payload('HELLO', version_min=1, version_max=1, features=features,
                                 client_epoch=self.epoch, channel=1, message_size_max=1320,
                                 cookie=cookie)
        return encode('HELLO', payload + message, priority=PRIORITY, call_id=self.number)

    def give_cookie(self):
        """The payload of the COOKIE for a sealed HELLO; zeros over a stream, which needs none."""
        if self.is_stream:
            return bytes(COOKIE_SIZE)
        answer = self.expect(self.hello(FEATURE_SEALED), 'COOKIE', 'sec-3.1-1')
        if len(answer) != HEADER_SIZE + COOKIE_SIZE:
            raise Failure(f'its COOKIE has {len(answer) - HEADER_SIZE} bytes, expected '
                          f'{COOKIE_SIZE}', ['sec-3.1-1'], frames=[('received', answer)])
        return answer[HEADER_SIZE:]

    def begin(self, suite, cookie, former=0, prologue=None, claimed=None):
        """The HELLO with message 1; `prologue` and the claimed public key may be wrong ones."""
        features = FEATURE_SEALED | (FEATURE_AES if suite else 0)
        bare = self.hello(features, cookie[:16])
        prologue = prologue or (PROTOCOL + bare[4:6] + bare[16:20] + bare[64:128] + cookie)
        self.suite, self.features = suite, features
        self.noise = Claimant(suite, self.private, self.server_public, noise.new_key(), prologue,
                              self.subject.preshared)
        self.noise.claimed = claimed or self.public
        message = self.noise.message_1(former.to_bytes(8, 'little'))
        return self.hello(features, cookie[:16], message)

    def finish(self, welcome):
        if len(welcome) != HEADER_SIZE + WELCOME_SIZE:
            raise Failure(f'its WELCOME has {len(welcome) - HEADER_SIZE} bytes, expected '
                          f'{WELCOME_SIZE}', ['sec-3.3-1'], frames=[('received', welcome)])
        try:
            inner = self.noise.read_message_2(welcome[HEADER_SIZE:])
        except noise.Refused as refused:
            raise Failure(f'its message 2 is not authentic: {refused}', ['sec-3.4-1'],
                          frames=[('received', welcome)]) from None
        session, former = number(inner[:8]), inner[56]
        features = number(inner[16:20])
        if features != self.features:
            raise Failure(f'its WELCOME has the features {features}, expected {self.features}',
                          ['sec-3-2'], frames=[('message 2', inner)])
        if session != header_of(welcome)['session'] or any(inner[57:]) or former > 3:
            raise Failure('its message 2 contradicts itself or its header', ['sec-3.3-1'],
                          frames=[('message 2', inner), ('received', welcome)])
        return session, former

    def open(self, suite=None, former=0):
        """Opens a session, and takes its keys unless the former one goes on; gives `former`."""
        suite = self.subject.best_suite() if suite is None else suite
        if self.is_stream:
            self.connect()
        self.number += 1
        hello = self.begin(suite, self.give_cookie(), former)
        session, became = self.finish(self.expect(hello, 'WELCOME', 'sec-3.2-2', 'sec-3.4-1'))
        if became != 1:
            self.take_keys(session)
        elif session != former:
            raise Failure('says that another session goes on', ['sec-3.3-1'])
        return became

    def take_keys(self, session):
        self.session, self.service = session, self.subject.service
        ours, theirs = self.noise.keys()
        self.sender = noise.Sender(self.suite, ours)
        self.receiver = noise.Receiver(self.suite, theirs)

    # ---- calls ----

    def call_frame(self, payload=b'', counter=None, is_copy=False, **fields):
        if not is_copy:
            self.call_id += 1
        plain = encode('CALL', payload, **{**dict(
            priority=PRIORITY, session=self.session, call_id=self.call_id, service=self.service,
            method=COUNT_METHOD, budget_us=BUDGET_US, sender_time_ns=time.monotonic_ns(),
            flags=SEALED | is_copy), **fields})
        return self.sender.seal(plain[:HEADER_SIZE], payload, counter)

    def opened(self, frame):
        if not number(frame[6:8]) & SEALED:
            raise Failure(f'it sent {kind_of(frame)} unsealed', ['sec-4-4'],
                          frames=[('received', frame)])
        try:
            return self.receiver.open(frame)
        except noise.Refused as refused:
            raise Failure(f'its {kind_of(frame)} can\'t be opened: {refused}',
                          ['sec-5-1', 'sec-5-5'], frames=[('received', frame)]) from None

    def bind(self):
        if self.service is not None:
            return
        payload = bytes(8) + text(PATH) + text(INTERFACE)
        reply = self.expect(self.call_frame(payload, service=0, method=CONSTANTS['method_bind']),
                            'REPLY', 'sec-4-1')
        plain = self.opened(reply)
        if header_of(reply)['status'] != 0:
            raise SubjectError(f'the server has no object {PATH.decode()} of the interface '
                               f'{INTERFACE.decode()} for the key {text_of(self.public)}')
        self.service = number(plain[:4])

    def count(self, frame=None, *rules):
        """Calls the method that counts; gives its count."""
        self.bind()
        frame = frame or self.call_frame()
        reply = self.expect(frame, 'REPLY', *(rules or ['sec-4-1', 'sec-4-2']))
        plain = self.opened(reply)
        if header_of(reply)['status'] != STATUSES['ok'] or len(plain) != 8:
            raise Failure(f'its method 2 answers status {header_of(reply)["status"]} and '
                          f'{len(plain)} bytes, expected ok and 8', [],
                          frames=[('received', reply)])
        return number(plain)

    def expect_run(self, frame, *rules):
        """That the frame of a CALL runs."""
        self.count(frame, *rules)

    def expect_dropped(self, frames, *rules):
        """That none of the frames has an answer or an effect: the next call is the next run."""
        before = self.count()
        if callable(frames):
            frames = frames()  # Over a stream, counters are in the order of sending.
        for at, frame in enumerate(frames):
            self.send(frame)
            if at % 32 == 31:
                self.expect_silence(0.02, rules, frame)
        self.expect_silence(ANSWER_S, rules, frames[-1])
        after = self.count()
        if after != before + 1:
            raise Failure(f'method 2 ran {after - before - 1} times because of frames that are to '
                          'be dropped', rules, frames=[('the last one', frames[-1])])

    def expect_silence(self, wait_s, rules, about):
        try:
            while True:
                answer = self.receive(wait_s)
                if kind_of(answer) != 'REFUSE' or number(answer[8:16]) == self.session_or_none():
                    raise Failure(f'it answered {kind_of(answer)}; expected: nothing', rules,
                                  frames=[('sent', about), ('received', answer)])
        except Silence:
            pass

    def session_or_none(self):
        return getattr(self, 'session', None)


class Splitter(FrameSplitter):
    """Frames of a stream, of which sealed ones have 24 more bytes."""

    def feed(self, data):
        self.rest += data
        frames = []
        while len(self.rest) >= HEADER_SIZE:
            size = HEADER_SIZE + number(self.rest[28:32])
            if number(self.rest[6:8]) & SEALED:
                size += TRAILER
            if len(self.rest) < size:
                break
            frames.append(self.rest[:size])
            self.rest = self.rest[size:]
        return frames


class Subject:
    """The server under test."""

    def __init__(self, options, medium):
        self.address, self.medium = options.address, medium
        self.server_public = key_of(options.server_key)
        self.private, self.second = options.private, options.second
        self.preshared = bytes.fromhex(options.preshared) if options.preshared else noise.NO_PSK
        self.service = options.service
        self.suites = 1

    def best_suite(self):
        return 1 if self.suites & 2 else 0

    def all_suites(self):
        return [suite for suite in (0, 1) if self.suites >> suite & 1]


def flipped(frame, bit):
    return frame[:bit // 8] + bytes([frame[bit // 8] ^ 1 << bit % 8]) + frame[bit // 8 + 1:]


# ---- the checks: each takes a Subject, and raises Failure ----------------------------------------


def both_suites_carry_calls(subject):
    for suite in subject.all_suites():
        channel = Channel(subject)
        channel.open(suite)
        first = channel.count()
        if channel.count() != first + 1:
            raise Failure('method 2 does not count its runs', [])


def the_cookie_shows_key_and_suites(subject):
    only_over(subject, 'datagram')
    cookie = Channel(subject).give_cookie()
    if cookie[16:48] != subject.server_public:
        raise Failure(f'its COOKIE shows another key, {text_of(cookie[16:48])}', ['sec-3.1-1'])
    if not number(cookie[48:52]) & 1:
        raise Failure('it lacks suite 0', ['sec-2-2'])
    if any(cookie[52:]):
        raise Failure('a reserved byte of its COOKIE is set', ['sec-3.1-1'])
    subject.suites = number(cookie[48:52]) & 3


def no_keys_are_used_without_a_cookie(subject):
    only_over(subject, 'datagram')
    channel = Channel(subject)
    cookie = channel.give_cookie()
    for wrong in (bytes(16), flipped(cookie[:16], 5), os.urandom(16)):
        hello = channel.begin(0, wrong + cookie[16:])
        answer = channel.expect(hello, 'COOKIE', 'sec-3.2-2')
        if len(answer) > len(hello):
            raise Failure('its answer is larger than the HELLO', ['sec-3.1-1'])


def copies_of_a_hello_get_the_same_welcome(subject):
    channel = Channel(subject)
    hello = channel.begin(0, channel.give_cookie())
    welcome = channel.expect(hello, 'WELCOME', 'sec-3.2-2')
    if subject.medium == 'datagram' and channel.expect(hello, 'WELCOME', 'sec-3-3') != welcome:
        raise Failure('a copy of a HELLO got another WELCOME', ['sec-3-3'])
    session, _ = channel.finish(welcome)
    channel.take_keys(session)
    channel.count()


def other_hellos_get_other_keys(subject):
    channel = Channel(subject)
    cookie = channel.give_cookie()
    seen = set()
    for _ in range(2):
        channel.number += 1
        welcome = channel.expect(channel.begin(0, cookie), 'WELCOME', 'sec-3-3')
        channel.finish(welcome)
        seen.add(welcome[HEADER_SIZE:HEADER_SIZE + 32])
        if subject.medium == 'stream':
            channel.connect()
    if len(seen) != 2:
        raise Failure('it used an ephemeral key twice', ['sec-3-3'])


def it_is_silent_to_who_proves_no_key(subject):
    channel = Channel(subject)
    cookie = channel.give_cookie()
    hellos = []
    for at in (0, 40, 100):  # In the ephemeral key, the client's key, the payload of message 1.
        channel.number += 1
        hellos.append(flipped(channel.begin(0, cookie), 8 * (128 + at)))
    channel.number += 1
    channel.server_public = noise.public_of(noise.new_key())
    hellos.append(channel.begin(0, cookie))
    channel.server_public = subject.server_public
    channel.private = noise.new_key()
    for claimed in (channel.public, noise.public_of(noise.new_key())):
        channel.number += 1
        hellos.append(channel.begin(0, cookie, claimed=claimed))
    expect_no_welcome(channel, hellos, 'sec-3.2-2')


def what_both_saw_must_be_the_same(subject):
    channel = Channel(subject)
    cookie = channel.give_cookie()
    hellos = []
    # Priority, number, versions, features, epoch, channel, limits: all in the prologue.
    for at in (4, 16, 64, 72, 80, 88, 100):
        channel.number += 1
        hellos.append(flipped(channel.begin(0, cookie), 8 * at))
    if subject.medium == 'datagram':
        channel.number += 1
        bare = channel.hello(FEATURE_SEALED, cookie[:16])
        weaker = cookie[:48] + (1).to_bytes(4, 'little') + bytes(4)
        if weaker != cookie:
            hellos.append(channel.begin(0, cookie, prologue=PROTOCOL + bare[4:6] + bare[16:20] +
                                        bare[64:128] + weaker))
    expect_no_welcome(channel, hellos, 'sec-3.4-1')


def keys_of_small_order_are_refused(subject):
    channel = Channel(subject)
    cookie = channel.give_cookie()
    hello = channel.begin(0, cookie)
    hellos = [hello[:128] + point + hello[160:]
              for point in (bytes(32), b'\1' + bytes(31), (2**255 - 20).to_bytes(32, 'little'))]
    expect_no_welcome(channel, hellos, 'sec-2-3')


def bad_hellos_are_dropped(subject):
    channel = Channel(subject)
    cookie = channel.give_cookie()
    hello = channel.begin(0, cookie)
    sizes = [HEADER_SIZE + 64 + 103, HEADER_SIZE + 64 + 40]
    hellos = []
    for size in sizes:
        cut = bytearray(hello[:size])
        cut[28:32] = cut[36:40] = (size - HEADER_SIZE).to_bytes(4, 'little')
        hellos.append(bytes(cut))
    for features in (0, FEATURE_AES, FEATURE_SEALED | 4, FEATURE_SEALED | 1 << 31):
        changed = bytearray(hello)
        changed[68:72] = features.to_bytes(4, 'little')
        hellos.append(bytes(changed))
    flagged = bytearray(hello)
    flagged[6] |= SEALED
    hellos.append(bytes(flagged) + bytes(TRAILER))
    expect_no_welcome(channel, hellos, 'sec-3.2-1', 'sec-4-1')


def expect_no_welcome(channel, hellos, *rules):
    """None of the HELLOs has an answer that needs a proven key; an honest client gets through."""
    for hello in hellos:
        if channel.is_stream:
            channel.connect()
        channel.send(hello)
        try:
            answer = channel.receive()
        except Silence:
            continue
        if answer and kind_of(answer) in ('WELCOME', 'REFUSE'):
            raise Failure(f'it answered {kind_of(answer)}; expected: nothing', rules,
                          frames=[('sent', hello), ('received', answer)])
    honest = Channel(channel.subject)
    honest.open()
    honest.count()


def unsealed_frames_change_nothing(subject):
    only_over(subject, 'datagram')
    channel = Channel(subject)
    channel.open()
    channel.bind()
    frames = []
    for kind in ('CALL', 'CLOSE', 'CANCEL', 'ACK', 'CREDIT', 'REPLY', 'REFUSE'):
        frames.append(encode(kind, priority=PRIORITY, session=channel.session, call_id=99,
                             service=channel.service, method=COUNT_METHOD, budget_us=BUDGET_US,
                             sender_time_ns=time.monotonic_ns()))
    channel.expect_dropped(frames, 'sec-4-4')


def copies_of_frames_are_dropped(subject):
    only_over(subject, 'datagram')
    channel = Channel(subject)
    channel.open()
    channel.bind()
    frame = channel.call_frame()
    channel.count(frame)
    channel.expect_dropped([frame] * 3, 'sec-5-4')
    other = Channel(subject)
    other.open()
    other.count()
    moved = frame[:8] + other.session.to_bytes(8, 'little') + frame[16:]
    other.expect_dropped([frame, moved], 'sec-4-2', 'sec-5-3')


def a_sealed_copy_of_a_call_gets_its_reply_again(subject):
    only_over(subject, 'datagram')
    channel = Channel(subject)
    channel.open()
    first = channel.count()
    again = channel.count(channel.call_frame(is_copy=True), 'sec-5-1')
    if again != first:
        raise Failure('a copy of a CALL ran again', ['hp-5.2-1'])


def no_bit_can_be_changed(subject):
    only_over(subject, 'datagram')
    channel = Channel(subject)
    channel.open()
    channel.count()
    payload = b'changed'
    frame = channel.call_frame(payload)
    channel.expect_dropped([flipped(frame, bit) for bit in range(8 * len(frame))], 'sec-5-3',
                           'sec-4-2')
    channel.expect_run(frame, 'sec-5-3')


def sizes_are_checked(subject):
    only_over(subject, 'datagram')
    channel = Channel(subject)
    channel.open()
    channel.count()
    frame = channel.call_frame(b'12345678')
    channel.expect_dropped([frame[:-1], frame + b'\0', frame[:HEADER_SIZE], frame[:70],
                            frame[:HEADER_SIZE + TRAILER]], 'sec-4-2')
    channel.expect_run(channel.call_frame(bytes(1320)), 'sec-4-3')


def the_window_has_1024_counters(subject):
    only_over(subject, 'datagram')
    channel = Channel(subject)
    channel.open()
    channel.count()
    largest = 5000
    channel.expect_run(channel.call_frame(counter=largest), 'sec-5-4')
    channel.sender.counter = largest + 1
    inside = channel.call_frame(counter=largest - 1023 + 8)
    # Each further call moves the window on; two are made for each check.
    channel.expect_run(inside, 'sec-5-4')
    newest = channel.sender.counter - 1
    channel.expect_run(channel.call_frame(counter=newest - 1023), 'sec-5-4')
    channel.expect_dropped([channel.call_frame(counter=newest - 1024),
                            channel.call_frame(counter=0)], 'sec-5-4')


def keys_change_with_the_counter(subject):
    only_over(subject, 'datagram')
    for suite in subject.all_suites():
        channel = Channel(subject)
        channel.open(suite)
        channel.count()
        for counter in (2**22 - 1, 2**22, 2**22 + 5, 2**22 - 2, 2**23, 3 * 2**22):
            channel.expect_run(channel.call_frame(counter=counter), 'sec-5-5')
        channel.sender.counter = 3 * 2**22 + 1
        frame = channel.call_frame(counter=5 * 2**22)
        beyond = frame[:-TRAILER] + (2**48).to_bytes(8, 'little') + frame[-16:]
        channel.expect_dropped([frame, beyond], 'sec-5-5', 'sec-5-6')


def a_session_is_told_of_to_its_client_alone(subject):
    only_over(subject, 'datagram')
    channel = Channel(subject)
    if channel.open() != 0:
        raise Failure('speaks of a former session though none was named', ['sec-6-3'])
    channel.count()
    keys = channel.session, channel.sender, channel.receiver
    if channel.open(former=channel.session) != 1:
        raise Failure('says that a session is gone which it has', ['sec-6-3'])
    channel.session, channel.sender, channel.receiver = keys
    channel.count()
    if channel.open(former=keys[0] ^ 1 << 60) not in (2, 3):
        raise Failure('knows a session which it never opened', ['sec-6-3'])


def a_session_is_told_of_to_no_other_key(subject):
    only_over(subject, 'datagram')
    if subject.second is None:
        raise CannotPlay('needs --second-key: another key that the server admits')
    channel = Channel(subject)
    channel.open()
    channel.count()
    other = Channel(subject, private=subject.second)
    # All is alike but the key.
    other.close_socket()
    other.socket, other.epoch, other.number = channel.socket, channel.epoch, channel.number
    if other.open(former=channel.session) not in (2, 3):
        raise Failure('tells another key of a session', ['sec-6-4'])
    channel.count(None, 'sec-6-1')


def half_open_sessions_end(subject):
    only_over(subject, 'datagram')
    channel = Channel(subject)
    channel.open()
    time.sleep(HALF_OPEN_S)
    frame = channel.call_frame(service=0, method=CONSTANTS['method_ping'])
    try:
        answer = channel.ask(frame, 'REPLY', attempts=4)
    except Silence:
        return
    raise Failure(f'a session without a frame of its client lived for {HALF_OPEN_S:g} s',
                  ['sec-6-1'], frames=[('sent', frame), ('received', answer)])


def a_half_open_session_replaces_none(subject):
    only_over(subject, 'datagram')
    channel = Channel(subject)
    channel.open()
    channel.count()
    keys = channel.session, channel.sender, channel.receiver
    channel.open()
    newer = channel.session, channel.sender, channel.receiver
    channel.session, channel.sender, channel.receiver = keys
    channel.count(None, 'sec-6-1')
    channel.session, channel.sender, channel.receiver = newer
    channel.count()
    channel.session, channel.sender, channel.receiver = keys
    channel.send(channel.call_frame())
    try:
        answer = channel.receive()
    except Silence:
        return
    if kind_of(answer) == 'REPLY':
        raise Failure('the first frame of a new session did not end the earlier one of its channel',
                      ['sec-6-1'], frames=[('received', answer)])


def held_back_calls_do_not_run(subject):
    channel = Channel(subject)
    channel.open()
    channel.count()
    channel.expect_dropped(lambda: [
        channel.call_frame(budget_us=100_000,
                           sender_time_ns=time.monotonic_ns() - held_ms * 1_000_000)
        for held_ms in (110, 500, 5000)], 'sec-6.1-1')
    channel.expect_run(channel.call_frame(budget_us=2_000_000,
                                          sender_time_ns=time.monotonic_ns() - 50_000_000),
                       'sec-6.1-1')


def a_stream_ends_at_a_frame_that_does_not_fit(subject):
    only_over(subject, 'stream')

    def copied(channel):
        frame = channel.call_frame()
        channel.count(frame)
        return frame

    faults = {'a copy': copied,
              'a skipped counter': lambda channel: channel.call_frame(counter=9),
              'a wrong tag': lambda channel: flipped(channel.call_frame(), 8 * HEADER_SIZE + 70)}
    for name, make in faults.items():
        channel = Channel(subject)
        channel.open()
        channel.count()
        channel.send(make(channel))
        try:
            while channel.receive(2):
                pass
        except Silence:
            raise Failure(f'it did not end the connection at {name}', ['sec-5-7']) from None


def unsealed_sessions_are_refused(subject):
    channel = Channel(subject)
    frame = channel.hello(0)
    try:
        answer = channel.ask(frame, 'COOKIE') if subject.medium == 'datagram' else None
        if answer is not None:
            frame = channel.hello(0, answer[HEADER_SIZE:HEADER_SIZE + 16])
        channel.ask(frame, 'WELCOME')
    except Silence:
        return
    raise CannotPlay('the server opens unsealed sessions, too: what these may do is its own rule')


def unknown_keys_are_not_admitted(subject):
    channel = Channel(subject, private=noise.new_key())
    hello = channel.begin(0, channel.give_cookie())
    try:
        welcome = channel.ask(hello, 'WELCOME', attempts=6)
    except Silence:
        return
    raise Failure('it admits a key that nobody told it of', ['sec-3.2-2'],
                  frames=[('sent', hello), ('received', welcome)])


def only_over(subject, medium):
    if subject.medium != medium:
        raise CannotPlay('over UDP only' if medium == 'datagram' else 'over TCP only')


CHECKS = (
    the_cookie_shows_key_and_suites, both_suites_carry_calls, no_keys_are_used_without_a_cookie,
    copies_of_a_hello_get_the_same_welcome, other_hellos_get_other_keys,
    it_is_silent_to_who_proves_no_key, what_both_saw_must_be_the_same,
    keys_of_small_order_are_refused, bad_hellos_are_dropped, unsealed_frames_change_nothing,
    copies_of_frames_are_dropped, a_sealed_copy_of_a_call_gets_its_reply_again,
    no_bit_can_be_changed, sizes_are_checked, the_window_has_1024_counters,
    keys_change_with_the_counter, a_session_is_told_of_to_its_client_alone,
    a_session_is_told_of_to_no_other_key, half_open_sessions_end,
    a_half_open_session_replaces_none, held_back_calls_do_not_run,
    a_stream_ends_at_a_frame_that_does_not_fit, unsealed_sessions_are_refused,
    unknown_keys_are_not_admitted,
)


# ---- all of them ---------------------------------------------------------------------------------


def own_key(path):
    """The tool's private key, from a file that is made if there is none."""
    if path is None:
        return noise.new_key()
    file = pathlib.Path(path)
    if not file.exists():
        descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, 'w', encoding='ascii') as opened:
            opened.write(text_of(noise.new_key()) + ' rtpm-conform\n')
    return key_of(file.read_text(encoding='ascii'))


def play(check, subject):
    over = 'UDP' if subject.medium == 'datagram' else 'TCP'
    name = f'{check.__name__.replace("_", "-")} over {over}'
    try:
        check(subject)
    except Failure as failure:
        return Result('sealed', name, 'S', 'failed', failure.rules, str(failure), failure, [])
    except CannotPlay as cannot:
        return Result('sealed', name, 'S', 'not played', [], str(cannot), None, [])
    return Result('sealed', name, 'S', 'passed', [], '', None, [])


def run(options, write):
    """Plays all checks; their results."""
    options.private = own_key(options.own_key)
    write(f'The key of this tool, which the server must admit: '
          f'{text_of(noise.public_of(options.private))} rtpm-conform')
    options.second = own_key(options.second_key) if options.second_key else None
    if options.second:
        write(f'Its second key, which the server must admit, too: '
              f'{text_of(noise.public_of(options.second))} rtpm-conform')
    results = []
    for medium in ('datagram', 'stream'):
        if options.medium and (options.medium == 'tcp') != (medium == 'stream'):
            continue
        subject = Subject(options, medium)
        for check in CHECKS:
            name = check.__name__.replace('_', '-')
            is_first = check is CHECKS[0]
            if not is_first and options.only and not any(one in name for one in options.only):
                continue
            result = play(check, subject)
            if is_first and result.outcome == 'failed' and 'came to' in result.reason:
                raise SubjectError('no server of level S answers at %s:%d: %s' %
                                   (*options.address, result.reason))
            if not (result.outcome == 'not played' and result.reason.startswith('over ')):
                results.append(result)
    return results


def report(results, title, write):
    """Writes everything; True if nothing failed."""
    for result in results:
        if result.outcome == 'failed':
            write_failure(result, write)
            write('')
    for result in results:
        if result.outcome == 'not played':
            write(f'not played: {result.name}: {result.reason}')
    counts = [sum(result.outcome == outcome for result in results)
              for outcome in ('passed', 'failed', 'not played')]
    write(f'{title}: level S: {counts[0]} of {len(results)} passed, {counts[1]} failed, '
          f'{counts[2]} not played')
    return counts[1] == 0
