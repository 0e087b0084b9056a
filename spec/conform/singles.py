"""Plays the vectors of single frames and payloads, those of a file one after the other."""

import time

from layout import (CONSTANTS, HEADER_SIZE, SPEC, STATUS_NAMES, STATUSES, encode, encode_payload,
                    header_of, kind_of, number)
from peer import End, Failure, Frame, Line, Peer
from play import SETTLE_S
from report import Result
from subject import UNTALKABLE, CannotPlay, SubjectError

PRIORITY = 24000
TEXT_SIZE_MAX = 200  # Of a refusal (hp-7-1).
SESSION = 0xb7fc5e0b78510000
PATIENT_FAILURES, IMPATIENCE_S = 3, 0.5  # After so many failures a file waits no longer than that.
SETUPS = {
    'server': dict(clock_domain='0x0', bands='0-32767', ceiling=32767, message_size_max=1344,
                   session_count_max=250),
    'client': dict(clock_domain='0x0', message_size_max=1344),
}
NOT_ON_THE_WIRE = {
    'urls.json': 'an address is read by a program itself, nothing of it is on the wire',
    'discovery.json': 'discovery has sockets of its own, beside the H-Protocol',
    'fingerprints.json': 'for the compiler of schemas, nothing of it is on the wire',
    'versions.json': 'for the comparison of texts, nothing of it is on the wire',
    'sealed.json': 'needs fixed ephemeral keys, which no program takes from outside',
    'headers-good.json': 'what was read of a header does not show on the wire; the conversations '
                         'have such headers',
    'clock-domain.json': 'a recipe for a number, which a program follows by itself',
    'ack.json': 'an ACK that is not read changes nothing that shows at once; large-request and '
                'large-reply play good ones',
}


class Session:
    """What both roles need: the program under test, and waiting for what it sends or says."""

    def __init__(self, role, medium, options):
        self.role = role
        self.peer = Peer(role, medium, options)
        self.is_stream = medium == 'stream'
        self.numbers = iter(range(0x1000, 1 << 30))

    def frame(self, is_wanted=None):
        """The next frame, which is of interest."""
        until = time.monotonic() + self.peer.patience_s
        self.passed_over = []
        while True:
            event = self.peer.next_event(until)
            if event is None:
                return None
            if isinstance(event, Frame):
                if is_wanted is None or is_wanted(event.data):
                    return event.data
                self.passed_over.append(event.data)

    def nothing(self, what, rules):
        """The failure of a wait in vain; shows the last frame that came instead."""
        text = f'no {what} within {self.peer.patience_s:g} s'
        if not self.passed_over:
            return Failure(text, rules)
        last = self.passed_over[-1]
        return Failure(f'{text}; it sent {kind_of(last)}', rules,
                       frames=[('the last that came', last)])

    def line(self, word):
        until = time.monotonic() + self.peer.patience_s
        while True:
            event = self.peer.next_event(until)
            if event is None:
                raise Failure(f'nothing came within {self.peer.patience_s:g} s of: sees {word}', [])
            if isinstance(event, Line) and event.words[1:2] == [word]:
                return event

    def dropped(self, reason):
        """Waits until one more frame is counted, or as long as an answer would take to come."""
        self.peer.counted[reason] += 1
        if self.peer.has_counters and self.peer.subject:
            self.peer.check_counters()
        else:
            self.wait(SETTLE_S)

    def wait(self, duration_s):
        """Lets time pass; what comes waits to be taken."""
        until = time.monotonic() + duration_s
        while time.monotonic() < until:
            self.peer.poll(until)

    def begin_again(self, file):
        """After a failure: another session, and what was counted is so."""
        if self.is_stream:
            self.peer.wire.disconnect()
        self.wait(SETTLE_S)
        self.peer.events.clear()
        self.prepare(file)
        there = self.peer.counters()
        if there is not None:
            self.peer.counted = there

    def expect_end(self):
        until = time.monotonic() + self.peer.patience_s
        while True:
            event = self.peer.next_event(until)
            if event is None:
                raise Failure('it did not end the connection', ['hp-8-2'])
            if isinstance(event, End):
                return

    def expect_nothing_sent(self, is_wanted=lambda frame: True):
        """Of what came until now."""
        while self.peer.events:
            event = self.peer.events.popleft()
            if isinstance(event, End):
                raise Failure('it ended the connection', ['hp-8-2'])
            if isinstance(event, Frame) and is_wanted(event.data):
                raise Failure(f'it sent {kind_of(event.data)}; expected: nothing', [],
                              frames=[('received', event.data)])


class ServerSession(Session):
    def start(self):
        self.peer.start(SETUPS['server'])

    def hello(self, payload=None, cookie=bytes(16), call_id=None):
        call_id = next(self.numbers) if call_id is None else call_id
        payload = payload if payload is not None else encode_payload(
            'HELLO', version_min=1, version_max=1, client_epoch=0xc11e47, channel=1,
            message_size_max=1344, cookie=cookie)
        self.peer.wire.send(encode('HELLO', payload, priority=PRIORITY, call_id=call_id,
                                   sender_time_ns=time.monotonic_ns()))
        return call_id

    def open(self):
        call_id = self.hello()
        answer = self.frame()
        if answer and kind_of(answer) == 'COOKIE':
            self.hello(cookie=answer[HEADER_SIZE:], call_id=call_id)
            answer = self.frame()
        if not answer or kind_of(answer) != 'WELCOME':
            raise Failure('it does not open a session', ['hp-4-1'],
                          frames=[('received', answer)] if answer else [])
        self.session = header_of(answer)['session']

    def headers_bad(self, vector):
        if self.is_stream:
            self.peer.wire.disconnect()
        self.peer.wire.send(bytes.fromhex(vector['hex']))
        self.dropped(vector['drop'])
        if self.is_stream and vector['ends_stream']:
            self.expect_end()
        else:
            self.expect_nothing_sent()

    def hello_vector(self, vector):
        if self.is_stream:
            self.peer.wire.disconnect()
        call_id = self.hello(bytes.fromhex(vector['hex']))
        if 'drop' in vector:
            self.dropped(vector['drop'])
            return self.expect_nothing_sent()
        wanted = dict(vector['answer'])
        if self.is_stream and wanted['kind'] == 'COOKIE':
            wanted['kind'] = 'WELCOME'
        answer = self.frame()
        if not self.is_stream and any(vector['fields']['cookie'].strip('0')) and \
                wanted['kind'] == 'COOKIE':
            self.dropped('bad_cookie')
        found = dict(kind=kind_of(answer or b''))
        if answer:
            header = header_of(answer)
            if 'status' in wanted:
                found['status'] = STATUS_NAMES.get(header['status'])
            if header['call_id'] != call_id or header['priority'] != PRIORITY:
                raise Failure('the answer does not repeat number and priority', ['hp-4-2'],
                              frames=[('received', answer)])
        if found != wanted:
            raise Failure(f'expected {wanted}, it sent {found}', [],
                          frames=[('received', answer)] if answer else [])

    def bind_request(self, vector):
        call_id = next(self.numbers)
        self.peer.wire.send(encode(
            'CALL', bytes.fromhex(vector['hex']), priority=PRIORITY, session=self.session,
            call_id=call_id, method=CONSTANTS['method_bind'], budget_us=5_000_000,
            sender_time_ns=time.monotonic_ns()))
        answer = self.frame(is_wanted=lambda frame: header_of(frame)['call_id'] == call_id)
        if answer is None:
            raise self.nothing(f'REPLY of the call {call_id}', ['hp-5.1-5'])
        status = STATUS_NAMES.get(header_of(answer)['status'])
        wanted = [vector['status']] if 'status' in vector else \
            ['ok'] if vector['path'] == 'lab/arm0' else ['ok', 'no_such_object']
        if status not in wanted:
            raise Failure(f'expected status {" or ".join(wanted)}, it answered {status}',
                          ['hp-12-4' if 'status' in vector else 'hp-6.1-1'],
                          frames=[('received', answer)])

    def call(self, **fields):
        """Calls method 2; gives the payload of the REPLY, which is `last`."""
        call_id = next(self.numbers)
        self.peer.wire.send(encode(
            'CALL', b'', priority=PRIORITY, session=self.session, call_id=call_id, method=2,
            service=self.peer.service, budget_us=5_000_000, sender_time_ns=time.monotonic_ns(),
            **fields))
        self.last = self.frame(is_wanted=lambda frame: kind_of(frame) == 'REPLY' and
                               header_of(frame)['call_id'] == call_id)
        if self.last is None:
            raise self.nothing(f'REPLY of the call {call_id}', ['hp-5.1-5'])
        return self.last[HEADER_SIZE:]

    def begin_stream(self):
        self.open()
        self.peer.tell('counters')  # Without a COMMAND there is no stream to be had.
        self.peer.answer('counters')
        self.call_id = next(self.numbers)
        self.peer.wire.send(encode(
            'CALL', b'\1', priority=PRIORITY, session=self.session, call_id=self.call_id, item=4,
            service=self.peer.service, method=2, budget_us=3_000_000,
            sender_time_ns=time.monotonic_ns()))
        self.line('run')

    def credit(self, vector):
        self.peer.wire.send(encode(
            'CREDIT', bytes.fromhex(vector['hex']), priority=PRIORITY, session=self.session,
            call_id=self.call_id, item=4, service=self.peer.service, method=2,
            budget_us=3_000_000, sender_time_ns=time.monotonic_ns()))
        if 'drop' in vector:
            self.dropped(vector['drop'])
        else:
            self.wait(SETTLE_S)
            self.peer.check_counters()
        self.expect_nothing_sent()

    def prepare(self, file):
        if file == 'credit.json':
            self.begin_stream()
        elif file == 'bind-request.json':
            self.open()


class ClientSession(Session):
    def start(self):
        self.peer.start(SETUPS['client'])

    def open(self):
        """Lets the client open a session, up to its HELLO."""
        self.peer.tell('does', 'open', priority=PRIORITY, timeout_us=20_000_000)
        hello = self.frame(is_wanted=lambda frame: kind_of(frame) == 'HELLO')
        if hello is None:
            raise self.nothing('HELLO', ['hp-4-1'])
        self.handshake = header_of(hello)['call_id']

    def answer_hello(self, kind, payload, session=0):
        self.peer.wire.send(encode(kind, payload, priority=PRIORITY, call_id=self.handshake,
                                   session=session, sender_time_ns=time.monotonic_ns()))

    def welcome(self):
        payload = encode_payload('WELCOME', version=1, band_high=32767, ceiling=32767, window=8,
                                 server_epoch=0x5e12e7, message_size_max=1344)
        self.answer_hello('WELCOME', payload, SESSION)
        self.line('ready')

    def prepare(self, file):
        self.open()
        if file in ('headers-bad.json', 'bind-reply.json'):
            self.welcome()

    def reopen(self):
        self.peer.tell('does', 'close')
        self.wait(SETTLE_S)
        self.peer.events.clear()
        self.open()

    def headers_bad(self, vector):
        self.peer.wire.send(bytes.fromhex(vector['hex']))
        self.dropped(vector['drop'])
        if not (self.is_stream and vector['ends_stream']):
            return self.expect_nothing_sent(lambda frame: kind_of(frame) not in ('HELLO', 'CLOSE'))
        self.expect_end()
        self.wait(SETTLE_S)
        self.peer.events.clear()
        self.open()
        self.welcome()

    def cookie(self, vector):
        self.answer_hello('COOKIE', bytes.fromhex(vector['hex']))
        if 'drop' in vector:
            return self.dropped(vector['drop'])
        cookie = bytes.fromhex(vector['hex'])
        wanted = self.frame(is_wanted=lambda frame: kind_of(frame) == 'HELLO' and
                            frame[HEADER_SIZE + 40:HEADER_SIZE + 56] == cookie)
        if wanted is None:
            raise self.nothing(f'HELLO with the cookie {cookie.hex()}', ['hp-4.2-3'])

    def welcome_vector(self, vector):
        self.answer_hello('WELCOME', bytes.fromhex(vector['hex']), int(vector['session'], 16))
        if 'drop' in vector:
            self.dropped(vector['drop'])
            return self.expect_no_line('ready')
        self.line('ready')
        self.reopen()

    def expect_no_line(self, word):
        self.wait(0 if self.peer.has_counters else SETTLE_S)
        for event in self.peer.events:
            if isinstance(event, Line) and event.words[1:2] == [word]:
                raise Failure(f'it says `{event.text}`; expected: nothing', [])

    def bind_reply(self, vector):
        name = f'b{next(self.numbers)}'
        fingerprint = vector.get('fingerprint', '0x0123456789abcdef')
        self.peer.tell('does', 'bind', name, path='lab/arm0', interface='lab.Arm',
                       fingerprint=fingerprint, priority=PRIORITY, timeout_us=5_000_000)
        call = self.frame(is_wanted=lambda frame: kind_of(frame) == 'CALL')
        if call is None:
            raise self.nothing('CALL', ['hp-6.1'])
        about = {key: value for key, value in header_of(call).items() if key in (
            'session', 'call_id', 'service', 'method', 'priority', 'trace_id')}
        self.peer.wire.send(encode('REPLY', bytes.fromhex(vector['hex']),
                                   sender_time_ns=time.monotonic_ns(), **about))
        line = self.line('bound')
        is_taken, wanted = 'service' in line.values, vector.get('is_taken', True)
        if is_taken != wanted:
            raise Failure('it took it' if is_taken else 'it did not take it', ['hp-6.1-5'])
        if wanted and int(line.values['service']) != vector['service']:
            raise Failure(f'it read service {line.values["service"]}, '
                          f'it is {vector["service"]}', ['hp-6.1'])


FILES = [  # File, role, level by medium, what plays one vector.
    ('headers-bad.json', 'server', dict(stream=0, datagram=1), ServerSession.headers_bad),
    ('hello.json', 'server', dict(stream=0, datagram=1), ServerSession.hello_vector),
    ('bind-request.json', 'server', dict(stream=0, datagram=1), ServerSession.bind_request),
    ('credit.json', 'server', dict(datagram=2), ServerSession.credit),
    ('headers-bad.json', 'client', dict(stream=0, datagram=1), ClientSession.headers_bad),
    ('cookie.json', 'client', dict(datagram=1), ClientSession.cookie),
    ('welcome.json', 'client', dict(stream=0, datagram=1), ClientSession.welcome_vector),
    ('bind-reply.json', 'client', dict(stream=0, datagram=1), ClientSession.bind_reply),
]


class File:
    """The vectors of one file over one medium; results() gives one result for each."""

    def __init__(self, name, role, medium, level, vectors, play, options):
        self.name, self.role, self.medium, self.level = name, role, medium, level
        self.vectors, self.play_one, self.options = vectors, play, options

    def results(self):
        kind = ServerSession if self.role == 'server' else ClientSession
        session = kind(self.role, self.medium, self.options)
        results, reason, outcome, failed_count = [], '', 'failed', 0
        try:
            session.start()
            session.prepare(self.name)
        except CannotPlay as cannot:
            reason, outcome = str(cannot), 'not played'
        except (SubjectError, OSError) as error:
            reason = f'{UNTALKABLE}{error}'
        except Failure as failure:
            reason = f'the vectors could not be begun: {failure}'
        for vector in self.vectors:
            if reason:
                results.append(self.result(vector, outcome, reason))
                outcome = 'not played'  # One failure is enough.
                continue
            try:
                self.play_one(session, vector)
                results.append(self.result(vector, 'passed'))
            except Failure as failure:
                results.append(self.result(vector, 'failed', str(failure), failure))
                reason, outcome = self.recover(session), 'not played'
                failed_count += 1
                if failed_count == PATIENT_FAILURES:
                    session.peer.patience_s = min(session.peer.patience_s, IMPATIENCE_S)
            except CannotPlay as cannot:
                results.append(self.result(vector, 'not played', str(cannot)))
            except SubjectError as error:
                results.append(self.result(vector, 'failed', str(error)))
                reason, outcome = str(error), 'not played'
        session.peer.stop()
        return [result._replace(notes=session.peer.notes) for result in results]

    def recover(self, session):
        try:
            session.begin_again(self.name)
        except (CannotPlay, SubjectError, Failure, OSError) as error:
            return f'nothing more could be played: {error}'
        return ''

    def result(self, vector, outcome, reason='', failure=None):
        rules = list(dict.fromkeys((failure.rules if failure else []) + vector['rules']))
        transport = 'tcp' if self.medium == 'stream' else 'udp'
        name = f'{self.name.removesuffix(".json")} {transport}: {vector["name"]}'
        return Result('single frames', name, self.level, outcome, rules, reason, failure, [])


class NotPlayed:
    """A file that a socket can't play."""

    def __init__(self, name, level, reason):
        self.name, self.level, self.reason = name, level, reason

    def results(self):
        return [Result('single frames', self.name, self.level, 'not played', [], self.reason, None,
                       [])]


class PlainMethod:
    """Of a server without a COMMAND, whose method 2 gives no stream: it refuses one (hp-5.10-12)."""

    def __init__(self, medium, options):
        self.medium, self.options = medium, options

    def results(self):
        session = ServerSession('server', self.medium, self.options)
        reason, outcome, failure = '', 'passed', None
        try:
            session.start()
            session.open()
            self.play(session)
        except Failure as failed:
            reason, outcome, failure = str(failed), 'failed', failed
        except (SubjectError, OSError) as error:
            reason, outcome = f'{UNTALKABLE}{error}', 'failed'
        session.peer.stop()
        name = f'a stream of a method that gives none {"tcp" if session.is_stream else "udp"}'
        return [Result('single frames', name, 2, outcome, ['hp-5.10-12'], reason, failure,
                       session.peer.notes)]

    @staticmethod
    def play(session):
        begun = number(session.call())
        refusal = session.call(item=4)
        header = header_of(session.last)
        if header['status'] != STATUSES['bad_request'] or header['item'] != 0:
            raise Failure(f'it answered status {STATUS_NAMES.get(header["status"])} with item '
                          f'{header["item"]}; expected: bad_request, 0', ['hp-5.10-12'],
                          frames=[('received', session.last)])
        if len(refusal) > TEXT_SIZE_MAX:
            raise Failure('its text is longer than 200 bytes', ['hp-7-1'],
                          frames=[('received', session.last)])
        if number(session.call()) != begun + 1:
            raise Failure('the method ran', ['hp-5.10-12'])


def vectors_of(document, role, medium, name):
    """Bad ones first: a good one ends what the bad ones are sent in."""
    if name == 'headers-bad.json':
        return [vector for vector in document['vectors']
                if vector['receiver'] in ('any', role) and medium in vector['medium']]
    return document['bad'] + document['good']


def entries(options, read):
    """As entries() of the program; a file is one entry."""
    for name, role, levels, play in FILES:
        if role != options.role:
            continue
        document = read(name)
        for medium, level in levels.items():
            vectors = vectors_of(document, role, medium, name)
            file = File(name, role, medium, level, vectors, play, options)
            yield name.removesuffix('.json'), level, medium, file
    if options.role == 'server' and not options.command:
        for medium in ('stream', 'datagram'):
            yield 'plain-method', 2, medium, PlainMethod(medium, options)
    yield from skipped()


def skipped():
    """The files that are reported, but not played."""
    for name, reason in NOT_ON_THE_WIRE.items():
        if not (SPEC / 'vectors' / name).exists():
            continue
        level = 2 if name == 'ack.json' else 0
        stem = name.removesuffix('.json')
        yield stem, level, 'stream', NotPlayed(stem, level, reason)
