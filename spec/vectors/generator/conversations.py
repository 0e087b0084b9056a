"""Vectors of whole conversations: what one side sends, and what the other has to make of it."""

import re

from frames import (HELLO, KIB, MIB, REPEATED, STATUSES, WELCOME, bind_reply, bind_request, frame,
                    lay_out, text)
from single_frames import wide

BEGIN_NS = 1_000_000_000
US, MS, S = 1_000, 1_000_000, 1_000_000_000

# What a side chooses freely: how many bytes, which side, and the value that the tests of the other
# side may take for it. `call2` is another choice of the kind `call`.
CHOICES = {
    'handshake': (4, 'client', lambda number: number),
    'call': (4, 'client', lambda number: number),
    # Of a second channel of the client.
    'other': (4, 'client', lambda number: number),
    'low': (4, 'client', lambda number: number),
    'high': (4, 'client', lambda number: number),
    'cookie': (16, 'server', lambda number: 0x0f0e0d0c0b0a09080706050403020100 + number),
    'session': (8, 'server', lambda number: 0xb7fc5e0b78510000 + (number << 32) + number - 1),
}


def choice(name):
    stem = name.rstrip('0123456789')
    size, side, example = CHOICES[stem]
    value = example(int(name[len(stem):] or 1))
    return dict(size=size, chosen_by=side, example=value.to_bytes(size, 'little').hex())


class Choices:
    """Looks like a mapping from every name to its choice."""

    def __getitem__(self, name):
        return choice(name)


class Conversation:
    """Builds the steps of one conversation. `at` moves its clock, in ns since its begin; client
    and server read one clock, but know that only where their clock_domain says so."""

    def __init__(self, name, about, rules, medium='datagram', roles=('client', 'server'),
                 client=None, server=None):
        self.name = name
        self.client = dict(epoch=0xc11e47, channel=1, clock_domain=0,
                           message_size_max=1344) | (client or {})
        self.server = dict(epoch=0x5e12e7, clock_domain=0, band=[0, 32767], ceiling=32767,
                           message_size_max=1344, window=8,
                           session_count_max=4) | (server or {})
        if 'bands' in self.server:
            del self.server['band']
        self.head = dict(about=about, rules=list(rules), roles=list(roles), medium=medium)
        self.steps = []
        self.taken_bytes = {}  # Of the items of each stream.
        self.now = BEGIN_NS
        self.priority = 24000
        self.server_epoch = self.server['epoch']
        # How long a frame travels; where one side only is tested, it is not of interest.
        self.flight_ns = 100 * US if len(roles) == 2 else 0

    def document(self):
        used = re.findall('<([a-z0-9]+)>', ''.join(step.get('hex', '') for step in self.steps))
        free = {name: choice(name) for name in dict.fromkeys(used)}
        setup = {}
        for side, values in (('client', self.client), ('server', self.server)):
            setup[side] = {key: wide(value, 8) if key in ('epoch', 'channel', 'clock_domain')
                           else value for key, value in values.items()}
        return self.head | dict(setup=setup, free=free, steps=self.steps)

    def at(self, ns):
        assert BEGIN_NS + ns >= self.now, 'time does not go back'
        self.now = BEGIN_NS + ns

    def step(self, **fields):
        self.steps.append(dict(at_ns=self.now) | {k: v for k, v in fields.items() if v is not None})

    def frame(self, way, kind, payload='', lost=False, address=None, says='', together=False,
              **fields):
        """A frame on its `way`, stamped with the time unless told otherwise. `together`: the next
        one is sent at the same time."""
        fields.setdefault('sender_time_ns', self.now)
        fields.setdefault('priority', self.priority)
        if isinstance(fields.get('status'), str):
            fields['status'] = STATUSES[fields['status']]
        note = kind if isinstance(kind, str) else f'kind {kind}'
        flight_ns = 0 if lost or way.startswith('network') else self.flight_ns
        self.step(frame=way, note=f'{note}, {says}' if says else note, is_lost=lost or None,
                  arrives_ns=self.now + flight_ns if flight_ns > 0 else None, address=address,
                  hex=frame(kind, payload, Choices(), **fields))
        if not together:
            self.now += flight_ns

    # ---- what the applications do and see ----

    def client_opens(self, patience_ns=S):
        self.step(client_does='open', priority=self.priority, deadline_ns=self.now + patience_ns)

    def client_calls(self, service, method, payload='', patience_ns=S, trace_id=0, **more):
        self.step(client_does='call', service=service, method=method, priority=self.priority,
                  payload=payload, deadline_ns=self.now + patience_ns,
                  trace_id=wide(trace_id, 8), **more)

    def client_waits(self):
        self.step(client_does='wait')

    def client_sees(self, what, **fields):
        self.step(client_sees=what, **fields)

    def server_runs(self, call_id, service, method, payload, deadline_ns):
        self.step(server_sees='run', call_id=call_id, service=service, method=method,
                  payload=payload, deadline_ns=deadline_ns)

    def server_completes(self, call_id, status='ok', payload=''):
        self.step(server_does='complete', call_id=call_id, status=status, payload=payload)

    def counts(self, side, reason):
        self.step(**{f'{side}_counts': reason})

    # ---- frames as they usually are ----

    def hello(self, handshake='handshake', cookie=0, way='client to server', copy=False, lost=False,
              address=None, epoch=None, channel=None, versions=(1, 1), limit=None, says=''):
        payload = self.hello_payload(cookie, epoch, channel, versions, limit)
        self.frame(way, 'HELLO', payload, lost=lost, address=address, call_id=handshake,
                   flags=REPEATED if copy else 0, says=says or f'cookie {cookie or "none"}')

    def hello_payload(self, cookie=0, epoch=None, channel=None, versions=(1, 1), limit=None):
        return lay_out(
            HELLO, version_min=versions[0], version_max=versions[1],
            client_epoch=self.client['epoch'] if epoch is None else epoch,
            channel=self.client['channel'] if channel is None else channel,
            clock_domain=self.client['clock_domain'],
            message_size_max=self.client['message_size_max'] if limit is None else limit,
            cookie=cookie)

    def cookie(self, handshake='handshake', cookie='cookie', lost=False):
        self.frame('server to client', 'COOKIE', f'<{cookie}>', call_id=handshake, lost=lost)

    def welcome(self, handshake='handshake', session='session', lost=False):
        self.frame('server to client', 'WELCOME', self.welcome_payload(), call_id=handshake,
                   session=session, lost=lost)

    def welcome_payload(self):
        bands = self.server.get('bands') or [self.server['band']]
        band = next(b for b in bands if b[0] <= self.priority <= b[1])
        return lay_out(
            WELCOME, band_low=band[0], band_high=band[1], ceiling=self.server['ceiling'],
            window=self.server['window'], server_epoch=self.server_epoch,
            clock_domain=self.server['clock_domain'],
            message_size_max=self.server['message_size_max'])

    def refuse(self, status, call_id, session=0, **more):
        self.frame('server to client', 'REFUSE', status=status, call_id=call_id, session=session,
                   says=status, **more)

    def handshake(self, handshake='handshake', cookie='cookie', session='session'):
        """All of it: over UDP with COOKIE, over TCP without."""
        self.client_opens()
        self.hello(handshake)
        if self.head['medium'] == 'datagram':
            self.cookie(handshake, cookie)
            self.hello(handshake, cookie)
        self.welcome(handshake, session)
        self.client_sees('ready')

    def call(self, call_id='call', session='session', service=1, method=2, payload='',
             budget_us=1_000_000, way='client to server', copy=False, says=None, flags=0, **more):
        self.frame(way, 'CALL', payload, call_id=call_id, session=session, service=service,
                   method=method, budget_us=budget_us, flags=flags | (REPEATED if copy else 0),
                   says=says or f'budget {budget_us} µs{", repeated" if copy else ""}', **more)

    def reply(self, call_id='call', session='session', service=1, method=2, payload='', status='ok',
              took_us=0, way='server to client', copy=False, flags=0, **more):
        self.frame(way, 'REPLY', payload, call_id=call_id, session=session, service=service,
                   method=method, status=status, budget_us=took_us,
                   flags=flags | (REPEATED if copy else 0),
                   says=f'{status}{", repeated" if copy else ""}', **more)

    def exchange(self, call_id='call', session='session', service=1, method=2, payload='01',
                 answer='02', at_ns=None, took_us=50, status='ok'):
        """A call that is run and answered, with nothing lost."""
        if at_ns is not None:
            self.at(at_ns)
        self.client_calls(service, method, payload)
        self.call(call_id, session, service, method, payload)
        self.server_runs(f'<{call_id}>', service, method, payload, self.now + S)
        self.now += took_us * US
        self.server_completes(f'<{call_id}>', status, answer)
        self.reply(call_id, session, service, method, answer, status, took_us)
        self.client_sees('result', status=status, payload=answer)


def bind_and_call(medium):
    c = Conversation(
        'bind-and-call-' + medium,
        'A client opens a session, binds an object by its path and calls it: nothing goes wrong.',
        ['hp-4-1', 'hp-4-2', 'hp-5.1-1', 'hp-5.1-2', 'hp-5.4-1'] +
        (['hp-4.2-1', 'hp-4.2-3'] if medium == 'udp' else []),
        medium='datagram' if medium == 'udp' else 'stream')
    c.handshake()
    request = bind_request('lab/arm0', 'lab.Arm', 0x0123456789abcdef)
    reply = bind_reply([(1, 0x11111111), (2, 0x22222222)], service=1,
                       fingerprint=0x0123456789abcdef)
    c.exchange('call', service=0, method=1, payload=request, answer=reply, at_ns=1 * MS)
    c.exchange('call2', payload='00' * 48, answer='', at_ns=2 * MS)
    c.exchange('call3', payload='', answer='ff' * 48, at_ns=3 * MS)
    c.at(4 * MS)
    c.step(client_does='close')
    c.frame('client to server', 'CLOSE', session='session')
    return c


def lost_hello():
    c = Conversation('lost-hello',
                     'Each frame of the handshake is lost once; the client repeats its HELLO. When '
                     'it repeats is its own affair (hp-4-5): these are the times of RTPM.',
                     ['hp-4-2', 'hp-4.1-4', 'hp-4.2-1', 'hp-4-5'])
    c.client_opens()
    c.hello(lost=True)
    c.at(5 * MS)
    c.client_waits()
    c.hello(copy=True)
    c.cookie(lost=True)
    c.at(15 * MS)
    c.client_waits()
    c.hello(copy=True)
    c.cookie(cookie='cookie2')
    c.hello(cookie='cookie2', copy=True, lost=True)
    c.at(35 * MS)
    c.client_waits()
    c.hello(cookie='cookie2', copy=True)
    c.welcome(lost=True)
    c.at(75 * MS)
    c.client_waits()
    c.hello(cookie='cookie2', copy=True)
    c.welcome()
    c.client_sees('ready')
    c.exchange(at_ns=76 * MS)
    return c


def lost_call():
    c = Conversation('lost-call',
                     'A call is lost, its copy is run, the reply is lost, and the next copy is '
                     'answered with the same reply. When the client repeats is its own affair '
                     '(hp-5.3-1): these are the times of RTPM.',
                     ['hp-5.2-1', 'hp-5.3-1', 'hp-5.3-2', 'hp-5.4-1'])
    c.handshake()
    c.at(10 * MS)
    c.client_calls(1, 2, '0a0b0c')
    c.call(payload='0a0b0c', lost=True)
    c.at(15 * MS)
    c.client_waits()
    c.call(payload='0a0b0c', budget_us=995_000, copy=True)
    c.server_runs('<call>', 1, 2, '0a0b0c', c.now + 995 * MS)
    c.at(16 * MS)
    c.server_completes('<call>', payload='0d')
    c.reply(payload='0d', took_us=900, lost=True)
    sent = c.now
    c.at(25 * MS)
    c.client_waits()
    c.call(payload='0a0b0c', budget_us=985_000, copy=True)
    c.reply(payload='0d', took_us=900, copy=True, sender_time_ns=sent)
    c.client_sees('result', status='ok', payload='0d')
    return c


def slow_method():
    c = Conversation('slow-method',
                     'A method takes longer than the client waits before it repeats: the copy is '
                     'not run, and the reply comes once.',
                     ['hp-5.2-1', 'hp-5.3-2'])
    c.handshake()
    c.at(10 * MS)
    c.client_calls(1, 2, '01')
    c.call(payload='01')
    c.server_runs('<call>', 1, 2, '01', c.now + S)
    c.at(15 * MS)
    c.client_waits()
    c.call(payload='01', budget_us=995_000, copy=True)
    c.counts('server', 'duplicate_running')
    c.at(17 * MS)
    c.server_completes('<call>', payload='02')
    c.reply(payload='02', took_us=6900)
    c.client_sees('result', status='ok', payload='02')
    return c


def statuses():
    c = Conversation('statuses', 'Calls end with each status that an object or its method gives.',
                     ['hp-5.1-2', 'hp-5.1-5'])
    c.handshake()
    methods = ['ok', 'overload', 'expired', 'no_such_method', 'no_such_object', 'bad_request',
               'not_lease_holder', 'gone', 'servant_failed', 'too_large', 'cancelled', 'stopping',
               'lost']
    for number, status in enumerate(methods, start=1):
        name = f'call{number}'
        c.at(number * MS)
        c.exchange(name, status=status, answer='')
    c.at(20 * MS)
    c.exchange('call20', service=0, method=1, payload=bind_request('lab/arm0', 'lab.Leg', 1),
               answer=text('lab.Arm'), status='wrong_interface')
    return c


def late_copies():
    c = Conversation('late-copies',
                     'The network delivers copies of calls late: what the session left behind is '
                     'not run and not answered, what it still remembers is answered again.',
                     ['hp-5.2-1', 'hp-5.2-2', 'hp-5.1-1'], roles=['server'])
    c.handshake()
    # Around the end of the numbers, where 0 follows the largest.
    numbers = [(2**32 - 4 + i) % 2**32 for i in range(10)]
    for i, number in enumerate(numbers):
        c.at((10 + i) * MS)
        c.call(number, payload=f'{i:02x}', way='network to server', address='client')
        c.server_runs(number, 1, 2, f'{i:02x}', c.now + S)
        c.server_completes(number, payload=f'{i:02x}')
        c.reply(number, payload=f'{i:02x}')
    c.at(30 * MS)
    for i in (0, 1):
        c.call(numbers[i], payload=f'{i:02x}', way='network to server', address='client', copy=True)
        c.counts('server', 'stale_call')
    for i in (2, 9):
        c.call(numbers[i], payload=f'{i:02x}', way='network to server', address='client', copy=True)
        c.reply(numbers[i], payload=f'{i:02x}', copy=True,
                sender_time_ns=BEGIN_NS + (10 + i) * MS)
    return c


def beyond_the_window():
    c = Conversation('beyond-the-window',
                     'A client has more calls open than the window allows: the one too many is '
                     'refused, and not run later either.',
                     ['hp-5.2-3', 'hp-5.1-5'], roles=['server'])
    c.handshake()
    c.at(1 * MS)
    for number in range(1, 9):
        c.call(number, way='network to server', address='client')
        c.server_runs(number, 1, 2, '', c.now + S)
    c.call(9, way='network to server', address='client')
    c.refuse('overload', 9, 'session')
    c.at(2 * MS)
    c.server_completes(1)
    c.reply(1, took_us=1000)
    c.call(9, way='network to server', address='client', copy=True)
    c.refuse('overload', 9, 'session')
    c.call(1, way='network to server', address='client', copy=True)
    c.reply(1, took_us=1000, copy=True)
    c.call(17, way='network to server', address='client')
    c.server_runs(17, 1, 2, '', c.now + S)
    for number in range(2, 9):
        c.server_completes(number)
        c.reply(number, took_us=1000)
    c.call(10, way='network to server', address='client')
    c.server_runs(10, 1, 2, '', c.now + S)
    return c


def place_of_a_late_call():
    c = Conversation('place-of-a-late-call',
                     'A method runs longer than its caller waits: a later call takes its place, and '
                     'its reply is not sent.',
                     ['hp-5.2-4', 'hp-5.1-5'], roles=['server'])
    c.handshake()
    c.at(1 * MS)
    c.call(1, budget_us=2000, way='network to server', address='client')
    c.server_runs(1, 1, 2, '', c.now + 2 * MS)
    c.at(2 * MS)
    c.call(9, way='network to server', address='client')
    c.refuse('overload', 9, 'session')
    c.at(4 * MS)
    c.call(17, way='network to server', address='client')
    c.server_runs(17, 1, 2, '', c.now + S)
    c.server_completes(1)
    c.at(5 * MS)
    c.server_completes(17)
    c.reply(17, took_us=1000)
    return c


def refused_calls():
    c = Conversation('refused-calls', 'Calls that the server will not run, each for a reason.',
                     ['hp-5.1-5', 'hp-5.4-3', 'hp-4.4-1'], roles=['server'],
                     server=dict(band=[20000, 25000], ceiling=24500, message_size_max=KIB))
    c.handshake()
    c.at(1 * MS)

    def refused(number, status, **fields):
        c.call(number, way='network to server', address='client', says=status, **fields)
        answer = {key: fields[key] for key in ('priority',) if key in fields}
        c.reply(number, status=status, **answer)

    refused(1, 'wrong_band', priority=19999)
    refused(2, 'wrong_band', priority=25001)
    refused(3, 'priority_not_allowed', priority=24501)
    refused(4, 'expired', budget_us=0)
    refused(5, 'too_large', payload='00' * (KIB + 1))
    c.call(4, budget_us=0, way='network to server', address='client', copy=True)
    c.reply(4, status='expired', copy=True)
    for session in (0, 1, 2**64 - 1):
        c.call(6, session, way='network to server', address='client')
        c.counts('server', 'unknown_session')
        c.refuse('unknown_session', 6, session)
    c.call(7, priority=24500, way='network to server', address='client')
    c.server_runs(7, 1, 2, '', c.now + S)
    return c


def order_of_judging_calls():
    c = Conversation('order-of-judging-calls',
                     'CALLs with several faults each: the first in the order of hp-5.1-9 decides.',
                     ['hp-5.1-9', 'hp-5.1-5'], roles=['server'],
                     server=dict(band=[20000, 25000], ceiling=24500, message_size_max=KIB))
    c.handshake()
    c.at(1 * MS)
    large = dict(payload='00' * (KIB + 1))
    c.call(1, 99, way='network to server', address='other', priority=19999, budget_us=0, **large,
           says='of no session, and all the rest')
    c.counts('server', 'unknown_session')
    c.refuse('unknown_session', 1, 99, priority=19999)
    c.call(1, way='network to server', address='other', priority=19999, budget_us=0, **large,
           says='from elsewhere, and all the rest')
    c.counts('server', 'foreign_address')
    c.call(1, way='network to server', address='client', says='runs')
    c.server_runs(1, 1, 2, '', c.now + S)
    c.call(9, way='network to server', address='client', priority=19999, budget_us=0, **large,
           says='its place is taken, and all the rest')
    c.refuse('overload', 9, 'session', priority=19999)
    wrong = dict(priority=19999, budget_us=0)
    for number, status, fields in ((2, 'too_large', wrong | large), (3, 'wrong_band', wrong),
                                   (4, 'priority_not_allowed', wrong | dict(priority=24501))):
        c.call(number, way='network to server', address='client', says=status, **fields)
        c.reply(number, status=status, priority=fields['priority'])
    c.server_completes(1)
    c.reply(1)
    return c


def refused_handshakes():
    c = Conversation('refused-handshakes', 'Handshakes that the server refuses, each for a reason.',
                     ['hp-4.1-2', 'hp-4.1-3', 'hp-4.4-2'], roles=['server'],
                     server=dict(band=[20000, 25000], session_count_max=1))
    wrong = [('version_unsupported', dict(versions=(2, 9))), ('bad_limits', dict(limit=KIB - 1)),
             ('bad_limits', dict(limit=16 * MIB + 1))]
    for number, (status, fields) in enumerate(wrong, start=1):
        c.hello(number, way='network to server', address='client', says=status, **fields)
        c.refuse(status, number)
    for number, priority in ((4, 19999), (5, 25001)):
        c.priority = priority
        c.hello(number, way='network to server', address='client', says='wrong_band')
        c.refuse('wrong_band', number)
    c.priority = 24000
    c.handshake()
    c.at(1 * MS)
    # Another channel of the same client, while the only place is taken.
    c.hello(7, 'cookie', way='network to server', address='client', channel=2,
            says='no place is free')
    c.refuse('overload', 7)
    return c


def client_is_refused():
    c = Conversation('handshake-refused', 'A client is refused, and does not go on by itself.',
                     ['hp-4-2', 'hp-4.1-3'], server=dict(band=[0, 19999]))
    c.client_opens()
    c.hello()
    c.refuse('wrong_band', 'handshake')
    c.client_sees('refused', status='wrong_band')
    return c


def cookies():
    c = Conversation('cookies', 'Cookies that prove nothing: none, forged, of another address, of '
                                'another client, too old. No session is opened by them.',
                     ['hp-4.2-1', 'hp-4.2-2', 'hp-8-1'], roles=['server'])
    way = dict(way='network to server')
    c.hello(1, address='client', **way)
    c.cookie(1)
    wrong = [('a cookie of nobody', 'client', dict(cookie=2**128 - 1)),
             ('the cookie of another address', 'other', dict(cookie='cookie')),
             ('the cookie of another address', 'client', dict(cookie='cookie3')),
             ('the cookie of another client', 'client', dict(cookie='cookie', epoch=0xbad)),
             ('a cookie of 21 s ago', 'client', dict(cookie='cookie'))]
    for number, (says, address, fields) in enumerate(wrong, start=2):
        if says.endswith('ago'):
            c.at(21 * S)
        c.hello(1, address=address, says=says, **fields, **way)
        c.counts('server', 'bad_cookie')
        c.cookie(1, f'cookie{number}')
    c.hello(1, 'cookie6', address='client', says='a new cookie', **way)
    c.welcome(1)
    return c


def repeated_hello():
    c = Conversation('repeated-hello',
                     'Late copies of a HELLO find the session that it opened. A HELLO of another '
                     'channel opens another, and one with a later number replaces its channel\'s: '
                     'behind it, copies of the earlier one are dropped.',
                     ['hp-4.1-4', 'hp-4.1-6', 'hp-4-2'], roles=['server'])
    c.handshake()
    c.at(1 * MS)
    way = dict(way='network to server', address='client')
    c.hello('handshake', 'cookie', copy=True, **way)
    c.welcome()
    c.hello('handshake', 'cookie', channel=2, says='another channel', **way)
    c.welcome(session='session2')
    # The numbers of one channel, around the place where they begin again at 0.
    first = 2**32 - 2
    c.hello(first, 'cookie', channel=3, says='of a third channel', **way)
    c.welcome(first, 'session3')
    c.call(1, 'session3', **way)
    c.server_runs(1, 1, 2, '', c.now + S)
    c.server_completes(1)
    c.reply(1, 'session3')
    for number, session in ((2**32 - 1, 'session4'), (0, 'session5')):
        c.hello(number, 'cookie', channel=3, says='a later number', **way)
        c.welcome(number, session)
    for number in (2**32 - 1, first):
        c.hello(number, 'cookie', channel=3, copy=True, says='a late copy', **way)
        c.counts('server', 'unexpected')
    for session in ('session3', 'session4'):
        c.call(2, session, says='of a replaced session', **way)
        c.counts('server', 'unknown_session')
        c.refuse('unknown_session', 2, session)
    for session in ('session', 'session2', 'session5'):
        c.call(3, session, says='of a good session', **way)
        c.server_runs(3, 1, 2, '', c.now + S)
    return c


def restart():
    c = Conversation('server-restarts',
                     'The server restarts between two calls. The client learns it from the '
                     'refusal, shakes hands anew and sees another epoch: what it knew of objects '
                     'is void.',
                     ['hp-4.4-1', 'hp-4-2', 'hp-5.1-1', 'hp-5.5-2', 'hp-5.5-3'])
    c.handshake()
    c.exchange('call', at_ns=1 * MS)
    c.at(2 * MS)
    c.server_epoch = 0x5e12e8
    c.step(server_does='restart', epoch=wide(c.server_epoch, 8))
    c.at(3 * MS)
    c.client_calls(1, 2, '01')
    c.call('call2', payload='01')
    c.counts('server', 'unknown_session')
    c.refuse('unknown_session', 'call2', 'session')
    c.client_sees('lost')
    c.at(4 * MS)
    c.handshake('handshake2', 'cookie2', 'session2')
    c.client_sees('may_have_run', call_id='<call2>')
    c.exchange('call3', 'session2', service=0, method=1,
               payload=bind_request('lab/arm0', 'lab.Arm', 1),
               answer=bind_reply(service=1, fingerprint=1), at_ns=5 * MS)
    return c


def strays():
    c = Conversation('strays-at-the-client',
                     'Frames that fit nothing that the client waits for: it drops and counts them, '
                     'and takes the right answer afterwards.',
                     ['hp-4-3', 'hp-5.1-3', 'hp-4.3-1', 'hp-4.4-3', 'hp-3-1', 'hp-8-1'],
                     roles=['client'])
    welcome_ = lay_out(WELCOME, server_epoch=1, message_size_max=1344)

    def dropped(reason, kind, payload='', **fields):
        says = fields.pop('says', '')
        c.frame('network to client', kind, payload, says=says, **fields)
        c.counts('client', reason)

    dropped('unexpected', 'WELCOME', welcome_, session=1, call_id=1, says='nobody asked')
    c.client_opens()
    c.hello()
    other = 0x0fffffff
    dropped('unexpected', 'COOKIE', '11' * 16, call_id=other, says='of another handshake')
    dropped('unexpected', 'WELCOME', welcome_, session=1, call_id=other,
            says='of another handshake')
    dropped('unexpected', 'REFUSE', call_id=other, status='overload', says='of another handshake')
    dropped('unexpected', 'REFUSE', call_id='handshake', says='without a reason')
    dropped('unexpected', 'REPLY', session=1, call_id=1, says='of no call')
    dropped('bad_payload', 'COOKIE', '11' * 15, call_id='handshake', says='too short')
    dropped('bad_payload', 'WELCOME', welcome_[:-2], session=1, call_id='handshake',
            says='too short')
    dropped('bad_kind', 'HELLO', says='from a server')
    c.cookie()
    c.hello(cookie='cookie')
    c.welcome()
    c.client_sees('ready')
    c.at(1 * MS)
    dropped('unexpected', 'REPLY', session='session', call_id=1, says='of no call')
    c.client_calls(1, 2)
    c.call()
    call = dict(session='session', call_id='call', service=1, method=2)
    dropped('unexpected', 'REPLY', **(call | dict(session=1)), says='of another session')
    dropped('unexpected', 'REPLY', **(call | dict(call_id=other)), says='of another call')
    dropped('unexpected', 'REPLY', **(call | dict(service=9)), says='of another object')
    dropped('unexpected', 'REPLY', **(call | dict(method=9)), says='of another method')
    dropped('unexpected', 'REFUSE', session=1, call_id='call', status='unknown_session',
            says='of another session')
    dropped('unexpected', 'REFUSE', session='session', call_id=other, status='unknown_session',
            says='of another call')
    dropped('unexpected', 'REFUSE', session='session', call_id='call', says='without a reason')
    dropped('unexpected', 'WELCOME', welcome_, session=1, call_id='handshake', says='a late copy')
    dropped('bad_kind', 'CALL', **call, says='from a server')
    dropped('bad_magic', 'REPLY', **call, magic=0)
    dropped('bad_length', 'REPLY', **call, payload_size=1)
    c.reply(payload='07')
    c.client_sees('result', status='ok', payload='07')
    dropped('unexpected', 'REPLY', '07', **call, flags=REPEATED, says='a copy of the reply')
    return c


def foreign_addresses():
    c = Conversation('foreign-address',
                     'Somebody at another address uses the session: calls are not run, and CLOSE '
                     'does not end it.',
                     ['hp-5.1-4', 'hp-4.5-1'], roles=['server'])
    c.handshake()
    c.at(1 * MS)
    c.call(1, way='network to server', address='other')
    c.counts('server', 'foreign_address')
    c.frame('network to server', 'CLOSE', session='session', address='other')
    c.counts('server', 'foreign_address')
    c.call(1, way='network to server', address='client')
    c.server_runs(1, 1, 2, '', c.now + S)
    c.server_completes(1)
    c.reply(1)
    c.frame('network to server', 'CLOSE', session='session', address='client')
    c.call(2, way='network to server', address='client')
    c.counts('server', 'unknown_session')
    c.refuse('unknown_session', 2, 'session')
    c.frame('network to server', 'CLOSE', session='session', address='client', says='a copy')
    c.counts('server', 'unknown_session')
    return c


def one_clock():
    c = Conversation('deadlines-on-one-clock',
                     'Both sides read one clock: the deadline counts from when the call was sent, '
                     'so that time spent in a socket counts. A time in the future is not believed.',
                     ['hp-5.4-2', 'hp-5.4-3'], roles=['server'],
                     client=dict(clock_domain=7), server=dict(clock_domain=7))
    c.handshake()
    way = dict(way='network to server', address='client')
    c.at(10 * MS)
    c.call(1, budget_us=1000, sender_time_ns=c.now - 400 * US, **way)
    c.server_runs(1, 1, 2, '', c.now + 600 * US)
    c.call(2, budget_us=1000, sender_time_ns=c.now - 1000 * US, **way)
    c.reply(2, status='expired')
    c.call(3, budget_us=1000, sender_time_ns=c.now + 1, **way)
    c.server_runs(3, 1, 2, '', c.now + 1000 * US)
    c.call(4, budget_us=1000, sender_time_ns=2**64 - 1, **way)
    c.server_runs(4, 1, 2, '', c.now + 1000 * US)
    return c


def two_clocks():
    c = Conversation('deadlines-on-two-clocks',
                     'The sides read different clocks, or do not know: the deadline counts from '
                     'the arrival.',
                     ['hp-5.4-2'], roles=['server'],
                     client=dict(clock_domain=7), server=dict(clock_domain=8))
    c.handshake()
    c.at(10 * MS)
    c.call(1, budget_us=1000, sender_time_ns=1, way='network to server', address='client')
    c.server_runs(1, 1, 2, '', c.now + 1000 * US)
    return c


def timeouts():
    c = Conversation('timeouts',
                     'Nobody answers, and the client gives up at its deadline: first in the '
                     'handshake, then in a call. A late reply is not taken for the next call.',
                     ['hp-5.1-1', 'hp-5.1-3', 'hp-5.4-1', 'hp-5.3-3'], roles=['client'])
    c.client_opens(patience_ns=4 * MS)
    c.hello(lost=True)
    c.at(4 * MS)
    c.client_waits()
    c.client_sees('timeout')
    c.handshake('handshake2')
    c.at(10 * MS)
    c.client_calls(1, 2, patience_ns=1_500_500)
    c.call(budget_us=1501, lost=True)
    c.at(12 * MS)
    c.client_waits()
    c.client_sees('timeout')
    c.client_calls(1, 2)
    c.call('call2')
    c.reply('call', payload='bad0')
    c.counts('client', 'unexpected')
    c.reply('call2', payload='900d')
    c.client_sees('result', status='ok', payload='900d')
    return c


def too_large_for_the_server():
    c = Conversation('too-large-for-the-server',
                     'The server takes small messages only: the client sends none that is larger.',
                     ['hp-4.3-2'], roles=['client'], server=dict(message_size_max=KIB))
    c.handshake()
    c.at(1 * MS)
    c.client_calls(1, 2, '00' * (KIB + 1))
    c.client_sees('too_large')
    c.client_calls(1, 2, '00' * KIB)
    c.call(payload='00' * KIB)
    return c


def second_hello_on_a_stream():
    c = Conversation('second-hello-tcp',
                     'A further HELLO on a TCP connection replaces the session.',
                     ['hp-4-4', 'hp-4.4-1'], medium='stream')
    c.handshake()
    c.exchange('call', at_ns=1 * MS)
    c.at(2 * MS)
    c.handshake('handshake2', session='session2')
    c.at(3 * MS)
    c.call(900, 'session', way='network to server', address='client', says='of the old session')
    c.counts('server', 'unknown_session')
    c.refuse('unknown_session', 900, 'session')
    c.counts('client', 'unexpected')
    c.exchange('call2', 'session2', at_ns=4 * MS)
    return c


def copies_on_a_stream():
    c = Conversation('copies-tcp',
                     'Nothing is repeated on a stream: the client waits, and a server that meets a '
                     'copy does not run it.',
                     ['hp-5.3-4', 'hp-5.2-1'], medium='stream')
    c.handshake()
    c.at(1 * MS)
    c.client_calls(1, 2)
    c.call()
    c.server_runs('<call>', 1, 2, '', c.now + S)
    c.at(900 * MS)
    c.client_waits()
    c.call('call', copy=True, way='network to server', address='client')
    c.counts('server', 'duplicate_running')
    c.server_completes('<call>')
    c.reply(took_us=898_900)
    c.client_sees('result', status='ok', payload='')
    c.call('call', copy=True, way='network to server', address='client')
    c.counts('server', 'stale_call')
    return c


def broken_stream(side):
    c = Conversation(f'broken-stream-at-the-{side}',
                     'After a bad header nobody knows where on a stream the next frame begins: '
                     f'the {side} ends the connection.',
                     ['hp-8-2', 'hp-2-1'], medium='stream', roles=[side])
    c.handshake()
    c.at(1 * MS)
    address = 'client' if side == 'server' else None
    c.frame(f'network to {side}', 'CALL', session='session', version=2, address=address)
    c.counts(side, 'bad_version')
    if side == 'server':
        c.step(server_sees='hang_up')
    else:
        c.client_sees('broken')
    return c


def lost_connection():
    c = Conversation('lost-connection-tcp',
                     'A TCP connection ends, and its session with it. The next connection has a '
                     'session of its own.',
                     ['hp-5.5-1', 'hp-4-1'], medium='stream')
    c.handshake()
    c.exchange('call', at_ns=1 * MS)
    c.at(2 * MS)
    c.step(network_does='disconnect')
    c.at(3 * MS)
    c.handshake('handshake2', session='session2')
    c.exchange('call2', 'session2', at_ns=4 * MS)
    return c


def silent_session():
    c = Conversation('silent-session',
                     'A table of sessions is full. The newcomer is refused while the only session '
                     'was heard within 30 s, by a copy of a call, too; then it takes its place.',
                     ['hp-5.5-1'], roles=['server'], server=dict(session_count_max=1))
    c.handshake()
    way = dict(way='network to server', address='client')
    c.at(29 * S)
    c.call(1, **way)
    c.server_runs(1, 1, 2, '', c.now + S)
    c.server_completes(1)
    c.reply(1)
    c.at(58 * S)
    c.hello(7, channel=2, **way)
    c.cookie(7, 'cookie2')
    c.hello(7, 'cookie2', channel=2, **way)
    c.refuse('overload', 7)
    c.at(59 * S)
    c.hello(7, 'cookie2', channel=2, **way)
    c.welcome(7, 'session2')
    c.call(2, 'session', **way)
    c.counts('server', 'unknown_session')
    c.refuse('unknown_session', 2, 'session')
    return c


def conversations():
    return [
        bind_and_call('udp'), bind_and_call('tcp'), lost_hello(), lost_call(), slow_method(),
        statuses(), late_copies(), beyond_the_window(),
        place_of_a_late_call(), refused_calls(),
        order_of_judging_calls(),
        refused_handshakes(), client_is_refused(), cookies(), repeated_hello(), restart(), strays(),
        foreign_addresses(), one_clock(), two_clocks(), timeouts(), too_large_for_the_server(),
        second_hello_on_a_stream(), copies_on_a_stream(), broken_stream('server'),
        broken_stream('client'), lost_connection(), silent_session(),
    ]
