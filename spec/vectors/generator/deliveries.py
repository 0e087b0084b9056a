"""Conversations beyond one call and its reply: fragments, oneways, cancellation, replies in another
order, a server that stops."""

from conversations import BEGIN_NS, MS, S, US, Conversation
from frames import (ACK, ACK_WANTED, CREDIT, KIB, NO_REPLY, REPEATED, REPLY_ON_RECEIPT, lay_out,
                    size_of)

LEASE_US = 10_000_000
BYTES_FIRST = dict(datagram=43_008, stream=65_472)
LARGE = dict(client=dict(message_size_max=16 * KIB), server=dict(message_size_max=16 * KIB))
TO_SERVER = dict(way='network to server', address='client')


class Delivery(Conversation):
    """A conversation about calls of method 2 of service 1."""

    def of_call(self, call_id='call', session='session'):
        return dict(session=session, call_id=call_id, service=1, method=2)

    def fragment(self, kind, parts, index, call_id='call', way=None, flags=0, **more):
        """One of the fragments of the message that `parts` make."""
        if kind == 'CALL':
            more.setdefault('budget_us', 1_000_000)
        way = way or ('client to server' if kind == 'CALL' else 'server to client')
        self.frame(way, kind, parts[index], fragment_index=index, fragment_count=len(parts),
                   message_size=sum(size_of(part) for part in parts), flags=flags,
                   says=f'fragment {index} of {len(parts)}', **self.of_call(call_id), **more)

    def ack(self, way, first_missing, later=0, call_id='call', flags=0, **more):
        self.frame(way, 'ACK', lay_out(ACK, first_missing=first_missing, later=later), flags=flags,
                   says=f'first missing {first_missing}', **self.of_call(call_id), **more)

    def cancel(self, call_id='call', session='session', way='client to server', payload='', **more):
        self.frame(way, 'CANCEL', payload, **(self.of_call(call_id, session) | more))

    def close(self, way, payload='', session='session', priority=0, **more):
        """A server's CLOSE has a priority of the band; RTPM takes the lowest."""
        self.frame(way, 'CLOSE', payload, session=session, priority=priority, **more)

    # ---- streams ----

    def asks_for_stream(self, window=4, call_id='call', **more):
        trace_id = more.get('trace_id', 0)
        self.client_calls(1, 2, '01', patience_ns=3600 * S, window=window, trace_id=trace_id)
        self.stream_call(window, call_id, **more)

    def stream_call(self, window=4, call_id='call', **more):
        self.call(call_id, payload='01', item=window,
                  says=f'a stream of up to {window} items at a time',
                  **(dict(budget_us=LEASE_US) | more))

    def server_streams(self, call_id='<call>'):
        self.received = self.now
        self.server_runs(call_id, 1, 2, '01', self.now + LEASE_US * US)

    def item(self, number, call_id='call', copy=False, way='server to client', given=None, **more):
        """An ITEM alone; `given`: when, if it is a copy."""
        self.frame(way, 'ITEM', f'{number % 256:02x}', item=number,
                   flags=REPEATED if copy else 0, says=f'number {number}',
                   **self.of_call(call_id), **(dict(sender_time_ns=given) if given else {}), **more)

    def gives_item(self, number, call_id='call', **more):
        """The server's application gives an item, and it goes out; gives when."""
        given = self.now
        self.step(server_does='item', call_id=f'<{call_id}>', payload=f'{number % 256:02x}')
        self.item(number, call_id, **more)
        return given

    def takes_items(self, numbers, call_id='call'):
        self.takes([f'{number % 256:02x}' for number in numbers], call_id)

    def takes(self, payloads, call_id='call'):
        self.step(client_does='take', call_id=f'<{call_id}>')
        for payload in payloads:
            self.step(client_sees='item', call_id=f'<{call_id}>', payload=payload)
        self.taken_bytes[call_id] = (self.taken_bytes.get(call_id, 0) +
                                     sum(size_of(payload) for payload in payloads))

    def part(self, parts, index, first=0, call_id='call', copy=False, given=None, **more):
        """An ITEM with a fragment of the item that `parts` make, whose frames begin at `first`."""
        self.frame(more.pop('way', 'server to client'), 'ITEM', parts[index], item=first + index,
                   fragment_index=index, fragment_count=len(parts),
                   message_size=sum(size_of(part) for part in parts),
                   flags=REPEATED if copy else 0, says=f'fragment {index} of {len(parts)}',
                   **self.of_call(call_id), **(dict(sender_time_ns=given) if given else {}), **more)

    def credit(self, first_missing, limit, later=0, asks=False, call_id='call', session='session',
               way='client to server', payload=None, byte_limit=None, **more):
        """`byte_limit`: as many bytes as at first beyond those of the items that were taken."""
        if byte_limit is None:
            byte_limit = BYTES_FIRST[self.head['medium']] + self.taken_bytes.get(call_id, 0)
        if payload is None:
            payload = lay_out(CREDIT, first_missing=first_missing, byte_limit=byte_limit,
                              later=later)
        fields = dict(item=limit, budget_us=LEASE_US, flags=ACK_WANTED if asks else 0)
        self.frame(way, 'CREDIT', payload,
                   says=f'first missing {first_missing}, up to {limit}{", asks" if asks else ""}',
                   **(self.of_call(call_id, session) | fields | more))

    def ends_stream(self, count, call_id='call', status='ok', **more):
        """The server's application ends the stream, and its REPLY goes out; gives when."""
        ended = self.now
        self.step(server_does='complete', call_id=f'<{call_id}>', status=status, payload='')
        self.reply(call_id, status=status, item=count, took_us=self.took_us(ended), **more)
        return ended

    def took_us(self, ended):
        return (ended - self.received) // US


def parts_of(*sizes):
    """A message in parts of these sizes, each of other bytes."""
    return [f'{0xa0 + i:02x}' * size for i, size in enumerate(sizes)]


def large_request():
    c = Delivery('large-request',
                 'A request in three fragments, of which the second is lost: ACK shows it, and it '
                 'is sent again. The method runs once, with the whole message.',
                 ['hp-2-4', 'hp-5.6-1', 'hp-5.6-2', 'hp-5.6-3', 'hp-5.6-4', 'hp-5.6-6', 'hp-5.3-2'],
                 **LARGE)
    c.handshake()
    c.at(10 * MS)
    parts = parts_of(1344, 1344, 100)
    c.client_calls(1, 2, ''.join(parts))
    c.fragment('CALL', parts, 0, together=True)
    c.fragment('CALL', parts, 1, lost=True)
    c.fragment('CALL', parts, 2, flags=ACK_WANTED)
    c.ack('server to client', 1, 1)
    budget_us = (BEGIN_NS + 10 * MS + S - c.now) // US
    c.fragment('CALL', parts, 1, flags=REPEATED | ACK_WANTED, budget_us=budget_us)
    c.server_runs('<call>', 1, 2, ''.join(parts), c.now + budget_us * US)
    c.server_completes('<call>', payload='0b')
    c.reply(payload='0b')
    c.client_sees('result', status='ok', payload='0b')
    return c


def large_request_unanswered():
    c = Delivery('large-request-unanswered',
                 'Neither ACK nor reply comes: the client sends the first fragment that is not '
                 'acknowledged; and, when all are, the first once more, to learn what became of '
                 'the call.', ['hp-5.6-7', 'hp-5.6-3'], roles=['client'], **LARGE)
    c.handshake()
    c.at(10 * MS)
    parts = parts_of(1344, 100)
    c.client_calls(1, 2, ''.join(parts))
    c.fragment('CALL', parts, 0, lost=True)
    c.fragment('CALL', parts, 1, flags=ACK_WANTED, lost=True)
    c.at(20 * MS)
    c.client_waits()
    c.fragment('CALL', parts, 0, flags=REPEATED | ACK_WANTED, budget_us=990_000)
    c.ack('server to client', 2)
    c.at(50 * MS)
    c.client_waits()
    c.fragment('CALL', parts, 0, flags=REPEATED | ACK_WANTED, budget_us=960_000)
    c.reply(payload='0c')
    c.client_sees('result', status='ok', payload='0c')
    return c


def window_of_fragments(side):
    c = Delivery(f'window-of-fragments-at-the-{side}',
                 'A message of 34 fragments: no more than 32 are on their way. The first half of '
                 'the window is acknowledged, and the rest goes out.',
                 ['hp-5.6-2', 'hp-5.6-3', 'hp-5.6-1'], roles=[side],
                 client=dict(message_size_max=64 * KIB), server=dict(message_size_max=64 * KIB))
    c.handshake()
    c.at(10 * MS)
    parts = parts_of(*[1344] * 33, 7)
    asking = (15, 31, 33)

    def send(kind, indexes, call_id, **more):
        for index in indexes:
            c.fragment(kind, parts, index, call_id, together=True,
                       flags=ACK_WANTED if index in asking else 0, **more)

    if side == 'client':
        c.client_calls(1, 2, ''.join(parts))
        send('CALL', range(32), 'call')
        c.at(13 * MS)
        c.ack('network to client', 16)
        send('CALL', (32, 33), 'call', budget_us=997_000)
        c.at(14 * MS)
        c.reply(payload='0d')
        c.client_sees('result', status='ok', payload='0d')
        return c
    c.call(1, payload='01', **TO_SERVER)
    c.server_runs(1, 1, 2, '01', c.now + S)
    c.server_completes(1, payload=''.join(parts))
    send('REPLY', range(32), 1)
    c.at(13 * MS)
    c.ack('network to server', 16, call_id=1, address='client')
    send('REPLY', (32, 33), 1)
    c.at(14 * MS)
    c.ack('network to server', 34, call_id=1, address='client')
    c.call(1, payload='01', copy=True, **TO_SERVER)
    c.counts('server', 'stale_call')
    return c


def large_request_at_the_server():
    c = Delivery('large-request-at-the-server',
                 'Fragments in disorder, copies, and fragments that do not belong together. What '
                 'the first one said of the call stands.',
                 ['hp-5.6-1', 'hp-5.6-4', 'hp-5.6-5', 'hp-5.6-9', 'hp-5.2-1'],
                 roles=['server'], **LARGE)
    c.handshake()
    c.at(1 * MS)
    parts = parts_of(10, 10, 10, 3)
    message = ''.join(parts)

    def send(index, call_id=1, **more):
        c.fragment('CALL', parts, index, call_id, **(TO_SERVER | more))

    send(2)
    send(0, flags=ACK_WANTED)
    c.ack('server to client', 1, 1, 1)
    send(0, flags=REPEATED | ACK_WANTED)
    c.ack('server to client', 1, 1, 1)
    for name, wrong in (('another priority', dict(priority=32767)), ('a stream', dict(item=4)),
                        ('another size', dict(message_size=34)),
                        ('reply on receipt', dict(flags=REPLY_ON_RECEIPT))):
        fields = dict(fragment_index=1, fragment_count=4, message_size=33, budget_us=1_000_000)
        c.frame('network to server', 'CALL', parts[1], address='client', says=name,
                **(c.of_call(1) | fields | wrong))
        c.counts('server', 'bad_fragment')
    for name, wrong in (('another object', dict(service=9)), ('another method', dict(method=9))):
        c.frame('network to server', 'CALL', parts[1], address='client', says=name,
                fragment_index=1, fragment_count=4, message_size=33, budget_us=1_000_000,
                **(c.of_call(1) | wrong))
        c.counts('server', 'bad_fragment')
    send(3)
    send(1)
    c.server_runs(1, 1, 2, message, c.now + S)
    send(1, flags=REPEATED)
    c.counts('server', 'duplicate_running')
    send(0, flags=REPEATED | ACK_WANTED)
    c.ack('server to client', 4, 0, 1)
    c.server_completes(1, payload='0d')
    c.reply(1, payload='0d')
    send(0, flags=REPEATED | ACK_WANTED)
    c.reply(1, payload='0d', copy=True)
    too_large = dict(fragment_index=0, fragment_count=13, message_size=16 * KIB + 1)
    c.frame('network to server', 'CALL', '00' * 1344, address='client', budget_us=1_000_000,
            says='of a message above the limit', **c.of_call(2), **too_large)
    c.reply(2, status='too_large')
    return c


def large_requests_left_unfinished():
    c = Delivery('large-requests-left-unfinished',
                 'Three requests in fragments are never finished, and the server has room for no '
                 'more. One is heard of now and then, and stays; of the others, the one that was '
                 'silent longest gives way to a new one after 3 s.',
                 ['hp-5.6-5', 'hp-5.6-10', 'hp-5.1-5'], roles=['server'],
                 client=LARGE['client'],
                 server=LARGE['server'] | dict(large_message_count_max=3))
    c.handshake()
    parts = parts_of(10, 10, 10, 3)

    def send(index, call_id, **more):
        c.fragment('CALL', parts, index, call_id, budget_us=60_000_000, flags=ACK_WANTED,
                   **(TO_SERVER | more))

    for call_id in (1, 2, 3):
        c.at(call_id * MS)
        send(0, call_id)
        c.ack('server to client', 1, 0, call_id)
    c.at(1 * S + 500 * MS)
    send(0, 2)
    c.ack('server to client', 1, 0, 2)
    c.at(2 * S)
    send(0, 4)
    c.reply(4, status='overload')
    c.at(3 * S + 500 * MS)
    send(0, 5)
    c.ack('server to client', 1, 0, 5)
    send(1, 1)
    c.refuse('overload', 1, 'session')
    send(1, 2)
    c.ack('server to client', 2, 0, 2)
    send(1, 3)
    c.ack('server to client', 2, 0, 3)
    return c


def large_reply():
    c = Delivery('large-reply',
                 'A reply in three fragments. First a middle one is lost, then, in another call, '
                 'the last: the client asks for it when nothing comes. The last ACK lets the '
                 'server forget the reply.',
                 ['hp-5.6-1', 'hp-5.6-3', 'hp-5.6-4', 'hp-5.6-6', 'hp-5.6-7', 'hp-5.6-8'], **LARGE)
    c.handshake()
    parts = parts_of(1344, 1344, 100)
    message = ''.join(parts)
    for name, lost, begin in (('call', 1, 10 * MS), ('call2', 2, 100 * MS)):
        c.at(begin)
        c.client_calls(1, 2, '01')
        c.call(name, payload='01')
        c.server_runs(f'<{name}>', 1, 2, '01', c.now + S)
        c.server_completes(f'<{name}>', payload=message)
        sent = c.now
        for index in range(3):
            c.fragment('REPLY', parts, index, name, lost=index == lost, together=index < 2,
                       flags=ACK_WANTED if index == 2 else 0)
        if lost == 2:
            c.at(begin + 50 * MS)
            c.client_waits()
            c.ack('client to server', 2, 0, name, flags=ACK_WANTED)
        else:
            c.now = sent + c.flight_ns
            c.ack('client to server', 1, 1, name)
        c.fragment('REPLY', parts, lost, name, flags=REPEATED | ACK_WANTED)
        c.client_sees('result', status='ok', payload=message)
        c.ack('client to server', 3, 0, name)
    c.call('call2', payload='01', copy=True, **TO_SERVER)
    c.counts('server', 'stale_call')
    return c


def large_reply_at_the_client():
    c = Delivery('large-reply-at-the-client',
                 'Fragments of a reply that do not fit: above the limit that the client stated, or '
                 'of another message.', ['hp-5.6-5', 'hp-5.6-9', 'hp-5.1-3'], roles=['client'],
                 client=dict(message_size_max=2 * KIB))
    c.handshake()
    c.at(10 * MS)
    c.client_calls(1, 2, '01')
    c.call(payload='01')
    parts = parts_of(20, 20, 5)
    wrong = dict(fragment_index=0, fragment_count=2, message_size=2 * KIB + 1)
    c.frame('network to client', 'REPLY', '00' * 1300, says='above the limit', **c.of_call(),
            **wrong)
    c.counts('client', 'bad_length')
    c.fragment('REPLY', parts, 1, way='network to client')
    c.fragment('REPLY', parts_of(20, 20, 6), 2, way='network to client')
    c.counts('client', 'bad_fragment')
    c.fragment('REPLY', parts_of(21, 21, 3), 0, way='network to client')
    c.counts('client', 'bad_fragment')
    c.fragment('REPLY', parts, 2, way='network to client')
    c.fragment('REPLY', parts, 0, way='network to client', flags=ACK_WANTED)
    c.client_sees('result', status='ok', payload=''.join(parts))
    c.ack('client to server', 3)
    return c


def ping():
    c = Delivery('ping', 'Method 2 of the session itself: it shows that the path works both ways.',
                 ['hp-6.2-1', 'hp-4.6-1'])
    c.handshake()
    c.exchange('call', service=0, method=2, payload='', answer='', at_ns=10 * MS)
    c.at(20 * MS)
    c.call(900, service=0, method=2, payload='01', says='with a payload, which is ignored',
           **TO_SERVER)
    c.server_runs(900, 0, 2, '01', c.now + S)
    c.server_completes(900)
    c.reply(900, service=0, method=2)
    c.counts('client', 'unexpected')
    return c


def ping_above_the_ceiling():
    c = Delivery('ping-above-the-ceiling',
                 'A ceiling within the band: above it a ping is answered, and nothing else is '
                 'run.', ['hp-6.2-1', 'hp-5.1-5'], server=dict(band=[20000, 25000], ceiling=23999))
    c.handshake()
    c.exchange('call', service=0, method=2, payload='', answer='', at_ns=10 * MS)
    for i, (name, service, method) in enumerate((('call2', 0, 1), ('call3', 0, 3),
                                                 ('call4', 1, 2))):
        c.at((20 + 10 * i) * MS)
        c.client_calls(service, method)
        c.call(name, service=service, method=method)
        c.reply(name, service=service, method=method, status='priority_not_allowed')
        c.client_sees('result', status='priority_not_allowed', payload='')
    return c


def several_calls():
    c = Delivery('several-calls',
                 'Three calls of one channel are open at a time, and end in another order than '
                 'they began.', ['hp-5.1-6', 'hp-5.1-1', 'hp-5.1-3'])
    c.handshake()
    c.at(10 * MS)
    names = ('call', 'call2', 'call3')
    begun = {}
    for i, name in enumerate(names):
        c.client_calls(1, 2, f'{i:02x}')
        c.call(name, payload=f'{i:02x}')
        begun[name] = c.now
        c.server_runs(f'<{name}>', 1, 2, f'{i:02x}', c.now + S)
    for name in ('call3', 'call', 'call2'):
        took_us = (c.now - begun[name]) // US
        payload = f'{0x10 + names.index(name):02x}'
        c.server_completes(f'<{name}>', payload=payload)
        c.reply(name, payload=payload, took_us=took_us)
        c.client_sees('result', call_id=f'<{name}>', status='ok', payload=payload)
    return c


def unknown_status():
    c = Delivery('unknown-status',
                 'A status that this version does not list: the call is over, and may have run.',
                 ['hp-5.1-7', 'hp-7'], roles=['client'])
    c.handshake()
    for i, (status, name) in enumerate(((20, 'call'), (65535, 'call2'))):
        c.at((10 + 10 * i) * MS)
        c.client_calls(1, 2, '01')
        c.call(name, payload='01')
        c.reply(name, status=status)
        c.client_sees('result', status='unknown', payload='')
    return c


def words_of_refusals():
    c = Delivery('words-of-refusals',
                 'A request out of range, and a method that failed, say why; the call ends as '
                 'without words.', ['hp-7-1', 'hp-7'], roles=['client'])
    c.handshake()
    for i, (status, words) in enumerate((('bad_request', 'x is 30, but must be -20 to 20 newton'),
                                         ('servant_failed', 'the gripper is stuck'))):
        c.at((10 + 10 * i) * MS)
        c.client_calls(1, 2, '01')
        name = ('call', 'call2')[i]
        c.call(name, payload='01')
        c.reply(name, status=status, payload=words.encode().hex())
        c.client_sees('result', status=status, payload=words.encode().hex())
    return c


def refusal_with_payload():
    c = Delivery('refusal-with-payload',
                 'A REFUSE has no payload; one that has is dropped, and the right one taken.',
                 ['hp-4.4-2'], roles=['client'])
    c.client_opens()
    c.hello()
    c.frame('network to client', 'REFUSE', '00', call_id='handshake', status='wrong_band')
    c.counts('client', 'bad_payload')
    c.cookie()
    c.hello(cookie='cookie')
    c.welcome()
    c.client_sees('ready')
    c.at(10 * MS)
    c.client_calls(1, 2, '01')
    c.call(payload='01')
    c.frame('network to client', 'REFUSE', '00', session='session', call_id='call',
            status='unknown_session')
    c.counts('client', 'bad_payload')
    c.refuse('overload', 'call', 'session')
    c.client_sees('result', status='overload', payload='')
    return c


def two_cookies():
    c = Delivery('two-cookies',
                 'A second COOKIE before the client repeated its HELLO by itself: it is not '
                 'answered; its cookie goes with the next repetition.', ['hp-4.2-4', 'hp-4.2-3'],
                 roles=['client'])
    c.client_opens()
    c.hello()
    c.cookie()
    c.hello(cookie='cookie')
    c.cookie(cookie='cookie2')
    c.at(10 * MS)
    c.client_waits()
    c.hello(cookie='cookie2', copy=True)
    c.welcome()
    c.client_sees('ready')
    return c


def flood_of_cookies():
    c = Delivery('flood-of-cookies',
                 'A forger answers a HELLO with 40 COOKIEs. The client answers one of them at '
                 'once; the cookie of the last one goes with the next repetition.',
                 ['hp-4.2-4'], roles=['client'])
    c.client_opens()
    c.hello()
    c.cookie()
    c.hello(cookie='cookie')
    for number in range(2, 41):
        c.cookie(cookie=f'cookie{number}')
    c.at(10 * MS)
    c.client_waits()
    c.hello(cookie='cookie40', copy=True)
    c.welcome()
    c.client_sees('ready')
    return c


def order_of_judgement():
    c = Delivery('order-of-judgement',
                 'HELLOs with several faults each: the first in the order of hp-4.1-5 decides.',
                 ['hp-4.1-5', 'hp-4.1-2', 'hp-4.1-3'], roles=['server'],
                 server=dict(band=[20000, 25000], session_count_max=1))
    c.handshake()
    c.priority = 1
    wrong = dict(channel=2, cookie=7, way='network to server', address='client')
    c.hello(2, epoch=0, versions=(2, 2), limit=0, says='no epoch, and all the rest', **wrong)
    c.counts('server', 'bad_payload')
    c.hello(2, versions=(2, 2), limit=0, says='version, limit, band, cookie', **wrong)
    c.refuse('version_unsupported', 2)
    c.hello(2, limit=0, says='limit, band, cookie', **wrong)
    c.refuse('bad_limits', 2)
    c.hello(2, says='band, cookie', **wrong)
    c.refuse('wrong_band', 2)
    c.priority = 24000
    c.hello(2, says='cookie, no room', **wrong)
    c.counts('server', 'bad_cookie')
    c.cookie(2, 'cookie2')
    c.hello(2, **(wrong | dict(cookie='cookie2', says='no room')))
    c.refuse('overload', 2)
    return c


def oneways():
    c = Delivery('oneways',
                 'A call without reply; and one with its reply on receipt, whose first copy and '
                 'first receipt are lost.',
                 ['hp-5.8-1', 'hp-5.8-3', 'hp-5.8-4', 'hp-5.2-1', 'hp-5.3-2'])
    c.handshake()
    c.at(10 * MS)
    c.client_calls(1, 2, '01', delivery='sent')
    c.call(payload='01', flags=NO_REPLY)
    c.server_runs('<call>', 1, 2, '01', c.now + S)
    c.call(payload='01', flags=NO_REPLY | ACK_WANTED, copy=True, **TO_SERVER)
    c.counts('server', 'duplicate_running')
    c.server_completes('<call>')
    c.call(payload='01', flags=NO_REPLY, copy=True, **TO_SERVER)
    c.counts('server', 'stale_call')

    c.at(20 * MS)
    c.client_calls(1, 2, '02', delivery='receipt')
    c.call('call2', payload='02', flags=REPLY_ON_RECEIPT, lost=True)
    c.at(25 * MS)
    c.client_waits()
    again = dict(payload='02', flags=REPLY_ON_RECEIPT, copy=True)
    c.call('call2', budget_us=995_000, **again)
    c.server_runs('<call2>', 1, 2, '02', c.now + 995 * MS)
    sent = c.now
    c.step(server_does='receipt', call_id='<call2>', status='ok')
    c.reply('call2', lost=True)
    c.at(35 * MS)
    c.client_waits()
    c.call('call2', budget_us=985_000, **again)
    c.reply('call2', copy=True, sender_time_ns=sent)
    c.client_sees('result', status='ok', payload='')
    c.server_completes('<call2>', 'servant_failed')
    return c


def oneways_not_run():
    c = Delivery('oneways-not-run',
                 'Oneways that the server will not run: without reply they are only counted, but '
                 'for an unknown session; on receipt the REPLY says why.',
                 ['hp-5.8-1', 'hp-5.8-3', 'hp-5.8-4', 'hp-4.4-1', 'hp-5.2-4'], roles=['server'],
                 server=dict(band=[20000, 25000], ceiling=24500, message_size_max=KIB))
    c.handshake()
    c.at(1 * MS)
    for number, wrong in enumerate((dict(priority=19999), dict(priority=24501), dict(budget_us=0),
                                    dict(payload='00' * (KIB + 1))), start=1):
        c.call(number, flags=NO_REPLY, **wrong, **TO_SERVER)
    c.call(5, 99, flags=NO_REPLY, **TO_SERVER)
    c.counts('server', 'unknown_session')
    c.refuse('unknown_session', 5, 99)
    c.call(6, flags=REPLY_ON_RECEIPT, budget_us=0, **TO_SERVER)
    c.reply(6, status='expired')
    # A oneway does not hold its place, a call does.
    c.call(8, flags=NO_REPLY, **TO_SERVER)
    c.server_runs(8, 1, 2, '', c.now + S)
    c.call(16, **TO_SERVER)
    c.server_runs(16, 1, 2, '', c.now + S)
    c.call(24, flags=NO_REPLY, **TO_SERVER)
    c.server_completes(16)
    c.reply(16)
    return c


def receipt_that_says_why():
    c = Delivery('receipt-that-says-why',
                 'A oneway on receipt that the server will not run, as it finds: its REPLY says '
                 'why, and is kept like any other.', ['hp-5.8-3', 'hp-5.1-5'], roles=['server'])
    c.handshake()
    c.at(1 * MS)
    c.call(1, flags=REPLY_ON_RECEIPT, **TO_SERVER)
    c.server_runs(1, 1, 2, '', c.now + S)
    c.step(server_does='receipt', call_id=1, status='no_such_object')
    sent = c.now
    c.reply(1, status='no_such_object')
    c.server_completes(1, 'no_such_object')
    c.call(1, flags=REPLY_ON_RECEIPT, copy=True, **TO_SERVER)
    c.reply(1, status='no_such_object', copy=True, sender_time_ns=sent)
    return c


def cancelled_call():
    c = Delivery('cancelled-call',
                 'A client cancels a call that runs: the method is told, and no REPLY is sent. '
                 'The next call is another matter.', ['hp-5.9-2', 'hp-5.9-1'])
    c.handshake()
    c.at(10 * MS)
    c.client_calls(1, 2, '01')
    c.call(payload='01')
    c.server_runs('<call>', 1, 2, '01', c.now + S)
    c.at(11 * MS)
    c.step(client_does='cancel', call_id='<call>')
    c.cancel()
    c.step(server_sees='cancelled', call_id='<call>')
    c.server_completes('<call>', 'cancelled')
    c.call(payload='01', copy=True, **TO_SERVER)
    c.counts('server', 'stale_call')
    c.exchange('call2', at_ns=20 * MS)
    return c


def cancels_at_the_server():
    c = Delivery('cancels-at-the-server',
                 'CANCELs that overtook their calls, of half a message, from elsewhere, with a '
                 'payload, of no session, of what the session left behind.',
                 ['hp-5.9-1', 'hp-5.9-2', 'hp-5.2-4'], roles=['server'], **LARGE)
    c.handshake()
    c.at(1 * MS)
    c.cancel(1, **TO_SERVER)
    c.call(1, **TO_SERVER)
    c.counts('server', 'stale_call')
    c.call(2, **TO_SERVER)
    c.server_runs(2, 1, 2, '', c.now + S)
    c.cancel(2, way='network to server', address='other')
    c.counts('server', 'foreign_address')
    c.cancel(2, payload='00', **TO_SERVER)
    c.counts('server', 'bad_payload')
    c.cancel(2, 99, **TO_SERVER)
    c.counts('server', 'unknown_session')
    c.server_completes(2, payload='02')
    c.reply(2, payload='02')
    parts = parts_of(10, 10)
    c.fragment('CALL', parts, 0, 3, **TO_SERVER)
    c.cancel(3, **TO_SERVER)
    c.fragment('CALL', parts, 1, 3, **TO_SERVER)
    c.counts('server', 'stale_call')
    # The place of a cancelled call is free; an older CANCEL does not touch the newer call.
    c.call(4, **TO_SERVER)
    c.server_runs(4, 1, 2, '', c.now + S)
    c.cancel(4, **TO_SERVER)
    c.step(server_sees='cancelled', call_id=4)
    c.call(12, **TO_SERVER)
    c.server_runs(12, 1, 2, '', c.now + S)
    c.cancel(4, **TO_SERVER)
    c.counts('server', 'stale_call')
    c.server_completes(12, payload='0c')
    c.reply(12, payload='0c')
    return c


def items_that_nobody_takes():
    c = Delivery('items-that-nobody-takes',
                 'Items of a call that is not open any more: the client cancels it again. Items of '
                 'another session are nothing to it.', ['hp-5.9-3', 'hp-8-1'], roles=['client'])
    c.handshake()
    c.at(10 * MS)
    c.item(5, 77, way='network to client')
    c.counts('client', 'unexpected')
    c.cancel(77)
    c.frame('network to client', 'ITEM', '00', item=5, **c.of_call(77, 99))
    c.counts('client', 'unexpected')
    return c


def server_stops():
    c = Delivery('server-stops',
                 'A server stops: it ends one call with stopping, then closes the session while '
                 'another is open. Both may have run.', ['hp-4.5-2', 'hp-4.4-1'])
    c.handshake()
    c.at(10 * MS)
    c.client_calls(1, 2, '01')
    c.call(payload='01')
    begun = c.now
    c.server_runs('<call>', 1, 2, '01', c.now + S)
    c.client_calls(1, 2, '02')
    c.call('call2', payload='02')
    c.server_runs('<call2>', 1, 2, '02', c.now + S)
    took_us = (c.now - begun) // US
    c.server_completes('<call>', 'stopping')
    c.reply(status='stopping', took_us=took_us)
    c.client_sees('result', call_id='<call>', status='stopping', payload='')
    c.step(server_does='stop')
    c.close('server to client', together=True)
    c.step(server_sees='cancelled', call_id='<call2>')
    c.client_sees('closed')
    c.close('network to client', says='a copy')
    c.counts('client', 'unexpected')
    return c


def malformed_closes():
    c = Delivery('malformed-closes',
                 'A CLOSE with a payload, or of another session, ends nothing.',
                 ['hp-4.5-2', 'hp-4.5-3', 'hp-4.5-1'])
    c.handshake()
    c.at(10 * MS)
    c.close('network to client', '00')
    c.counts('client', 'bad_payload')
    c.close('network to client', session=99)
    c.counts('client', 'unexpected')
    c.close('network to server', '00', address='client')
    c.counts('server', 'bad_payload')
    c.exchange('call', at_ns=11 * MS)
    return c


def conversations():
    return [
        large_request(), large_request_unanswered(), large_request_at_the_server(),
        window_of_fragments('client'), window_of_fragments('server'),
        large_requests_left_unfinished(), large_reply(), large_reply_at_the_client(), ping(),
        several_calls(), unknown_status(), words_of_refusals(), refusal_with_payload(),
        two_cookies(), flood_of_cookies(),
        order_of_judgement(), oneways(), oneways_not_run(), receipt_that_says_why(), cancelled_call(),
        cancels_at_the_server(), items_that_nobody_takes(), server_stops(), malformed_closes(),
        ping_above_the_ceiling(),
    ]
