"""Conversations beyond one call and its reply: fragments, oneways, cancellation, streams, replies in
another order, a server that stops."""

from conversations import BEGIN_NS, MS, S, US, Conversation
from frames import (ACK, ACK_WANTED, CREDIT, KIB, NO_REPLY, REPEATED, REPLY_ON_RECEIPT, lay_out,
                    size_of)

LEASE_US = 3_000_000
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
        self.client_calls(1, 2, '01', patience_ns=3600 * S, window=window)
        self.stream_call(window, call_id, **more)

    def stream_call(self, window=4, call_id='call', **more):
        self.call(call_id, payload='01', item=window, budget_us=LEASE_US,
                  says=f'a stream of up to {window} items at a time', **more)

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
        self.step(client_does='take', call_id=f'<{call_id}>')
        for number in numbers:
            self.step(client_sees='item', call_id=f'<{call_id}>', payload=f'{number % 256:02x}')

    def credit(self, first_missing, limit, later=0, asks=False, call_id='call', session='session',
               way='client to server', payload=None, **more):
        if payload is None:
            payload = lay_out(CREDIT, first_missing=first_missing, later=later)
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
    too_large = dict(fragment_index=0, fragment_count=2, message_size=16 * KIB + 1)
    c.frame('network to server', 'CALL', '00' * 8200, address='client', budget_us=1_000_000,
            says='of a message above the limit', **c.of_call(2), **too_large)
    c.reply(2, status='too_large')
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
    for i, (status, name) in enumerate(((18, 'call'), (65535, 'call2'))):
        c.at((10 + 10 * i) * MS)
        c.client_calls(1, 2, '01')
        c.call(name, payload='01')
        c.reply(name, status=status)
        c.client_sees('result', status='unknown', payload='')
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
                 server=dict(band=[20000, 25000], ceiling=24500))
    c.handshake()
    c.at(1 * MS)
    for number, wrong in enumerate((dict(priority=19999), dict(priority=24501), dict(budget_us=0),
                                    dict(payload='00' * 1345)), start=1):
        c.call(number, flags=NO_REPLY, **wrong, **TO_SERVER)
    c.call(5, 99, flags=NO_REPLY, **TO_SERVER)
    c.counts('server', 'unknown_session')
    c.refuse('unknown_session', 5, 99)
    c.call(6, flags=REPLY_ON_RECEIPT, budget_us=0, **TO_SERVER)
    c.reply(6, status='expired')
    c.call(7, flags=REPLY_ON_RECEIPT, **TO_SERVER)
    c.server_runs(7, 1, 2, '', c.now + S)
    c.step(server_does='receipt', call_id=7, status='no_such_object')
    c.reply(7, status='no_such_object')
    c.server_completes(7, 'no_such_object')
    # A oneway does not hold its place, a call does.
    c.call(8, flags=NO_REPLY, **TO_SERVER)
    c.server_runs(8, 1, 2, '', c.now + S)
    c.call(16, **TO_SERVER)
    c.server_runs(16, 1, 2, '', c.now + S)
    c.call(24, flags=NO_REPLY, **TO_SERVER)
    c.server_completes(16)
    c.reply(16)
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


def stream():
    c = Delivery('stream',
                 'A stream of five items, four at a time; one is lost, and repeated when a later '
                 'one is there.',
                 ['hp-5.10-1', 'hp-5.10-2', 'hp-5.10-4', 'hp-5.10-6', 'hp-5.10-7'])
    c.handshake()
    c.at(10 * MS)
    c.asks_for_stream()
    c.server_streams()
    for number in range(3):
        c.gives_item(number)
    c.takes_items(range(3))
    c.credit(3, 7)
    given = c.gives_item(3, lost=True)
    c.gives_item(4)
    c.credit(3, 7, later=1)
    c.item(3, copy=True, given=given)
    c.takes_items((3, 4))
    c.credit(5, 9)
    c.ends_stream(5)
    c.client_sees('result', status='ok', payload='')
    c.credit(5, 9)
    return c


def stream_whose_end_is_lost():
    c = Delivery('stream-whose-end-is-lost',
                 'The last item and the REPLY are lost. The client asks, and gets both again. When '
                 'it asks is its own affair within the limits: these are the times of the vector.',
                 ['hp-5.10-1', 'hp-5.10-5', 'hp-5.10-6'])
    c.handshake()
    c.at(10 * MS)
    c.asks_for_stream()
    c.server_streams()
    c.gives_item(0)
    c.takes_items((0,))
    given = c.gives_item(1, lost=True)
    ended = c.ends_stream(2, lost=True)
    c.at(600 * MS)
    c.client_waits()
    c.credit(1, 5, asks=True)
    c.item(1, copy=True, given=given, together=True)
    c.reply(item=2, took_us=c.took_us(ended), copy=True, sender_time_ns=ended)
    c.client_sees('result', status='ok', payload='')
    c.credit(2, 5)
    c.takes_items((1,))
    c.credit(2, 9, asks=True, **TO_SERVER)
    c.reply(item=2, took_us=c.took_us(ended), copy=True, sender_time_ns=ended)
    c.counts('client', 'unexpected')
    return c


def stream_whose_reply_comes_first():
    c = Delivery('stream-whose-reply-comes-first',
                 'The REPLY overtakes items: the client asks for them at once, and the stream ends '
                 'with the last of them. Another stream, which the server gave up, ends at once.',
                 ['hp-5.10-6', 'hp-5.10-2'], roles=['client'])
    c.handshake()
    c.at(10 * MS)
    c.asks_for_stream()
    c.item(4, way='network to client')
    c.counts('client', 'unexpected')
    c.reply(item=5, way='network to client')
    c.counts('client', 'unexpected')
    c.reply(status='servant_failed', item=2)
    c.credit(0, 4, asks=True)
    c.item(0)
    c.item(1)
    c.client_sees('result', status='servant_failed', payload='')
    c.credit(2, 4)
    c.takes_items((0, 1))
    c.at(20 * MS)
    c.asks_for_stream(call_id='call2')
    c.item(0, 'call2')
    c.reply('call2', status='stopping', item=3)
    c.client_sees('result', status='stopping', payload='')
    c.credit(1, 4, call_id='call2')
    c.takes_items((0,), 'call2')
    return c


def stream_whose_call_is_lost():
    c = Delivery('stream-whose-call-is-lost',
                 'The CALL is lost; its copy wants an ACK. A later copy finds that the stream '
                 'runs, though it gave no item yet; from then on the client asks with CREDIT.',
                 ['hp-5.10-3', 'hp-5.10-5', 'hp-5.3-2'])
    c.handshake()
    c.at(10 * MS)
    c.asks_for_stream(lost=True)
    c.at(20 * MS)
    c.client_waits()
    c.stream_call(copy=True, flags=ACK_WANTED)
    c.server_streams()
    c.at(40 * MS)
    c.client_waits()
    c.stream_call(copy=True, flags=ACK_WANTED)
    c.ack('server to client', 1, item=0)
    c.at(600 * MS)
    c.client_waits()
    c.credit(0, 4, asks=True)
    c.ack('server to client', 1, item=0)
    c.ends_stream(0, status='bad_request')
    c.client_sees('result', status='bad_request', payload='')
    c.credit(0, 4)
    return c


def stream_at_the_server():
    c = Delivery('stream-at-the-server',
                 'How far a server goes: not beyond what was granted, over UDP not 32 beyond what '
                 'is acknowledged; and CREDITs that lie, are malformed or come from elsewhere.',
                 ['hp-5.10-2', 'hp-5.10-4', 'hp-5.10-5', 'hp-5.10-8', 'hp-4.4-1', 'hp-5.1-4'],
                 roles=['server'])
    c.handshake()
    c.at(10 * MS)

    def blocked():
        c.step(server_does='item', call_id=1, payload='ff')
        c.step(server_sees='no_credit', call_id=1)

    def gives(numbers):
        given = {}
        for number in numbers:
            given[number] = c.now
            c.step(server_does='item', call_id=1, payload=f'{number:02x}')
            c.item(number, 1)
        return given

    def tells(first_missing, limit, **more):
        c.credit(first_missing, limit, **(dict(call_id=1) | TO_SERVER | more))

    c.stream_call(3, 1, **TO_SERVER)
    c.received = c.now
    c.server_runs(1, 1, 2, '01', c.now + LEASE_US * US)
    given = gives(range(3))
    blocked()
    tells(0, 100)
    given |= gives(range(3, 32))
    blocked()
    c.at(11 * MS)
    tells(1, 100, later=0b101)
    for number in (1, 3):
        c.item(number, 1, copy=True, given=given[number])
    given |= gives((32,))
    blocked()
    tells(34, 200, asks=True)
    c.ack('server to client', 1, 0, 1, item=33)
    blocked()
    tells(33, 34, payload='21000000010000000000000000000000')
    c.counts('server', 'bad_payload')
    tells(33, 34, payload='21000000000000000000000000000000' + '00')
    c.counts('server', 'bad_payload')
    tells(33, 34, way='network to server', address='other')
    c.counts('server', 'foreign_address')
    tells(33, 34, session=99)
    c.counts('server', 'unknown_session')
    c.refuse('unknown_session', 1, 99)
    blocked()
    tells(33, 100, asks=True)
    c.ack('server to client', 1, 0, 1, item=33)
    gives((33,))
    return c


def stream_without_a_client():
    c = Delivery('stream-without-a-client',
                 'Nothing is heard of the client for the time that it stated: the server ends the '
                 'stream and tells the method. Who asks later learns that it expired.',
                 ['hp-5.10-7', 'hp-4.6-2'], roles=['server'])
    c.handshake()
    c.at(10 * MS)
    c.stream_call(4, 1, **TO_SERVER)
    c.server_runs(1, 1, 2, '01', c.now + LEASE_US * US)
    c.step(server_does='item', call_id=1, payload='00')
    c.item(0, 1)
    c.at(2000 * MS)
    c.credit(1, 5, call_id=1, **TO_SERVER)
    c.at(4999 * MS)
    c.step(server_does='wait')
    c.step(server_does='item', call_id=1, payload='01')
    c.item(1, 1)
    c.at(5000 * MS)
    c.step(server_does='wait')
    c.step(server_sees='cancelled', call_id=1)
    c.step(server_does='item', call_id=1, payload='02')
    c.step(server_sees='no_credit', call_id=1)
    c.credit(2, 6, call_id=1, asks=True, **TO_SERVER)
    c.refuse('expired', 1, 'session')
    c.server_completes(1, 'cancelled')
    c.credit(2, 6, call_id=1, asks=True, **TO_SERVER)
    c.refuse('expired', 1, 'session')
    return c


def stream_without_a_server():
    c = Delivery('stream-without-a-server',
                 'Nothing comes of a stream any more: the client asks at least every 500 ms, and '
                 'after 3 s takes it for lost.', ['hp-5.10-5', 'hp-5.10-7', 'hp-4.6-2'],
                 roles=['client'])
    c.handshake()
    c.at(10 * MS)
    c.asks_for_stream()
    c.item(0)
    c.takes_items((0,))
    for question in range(1, 6):
        c.at((10 + 501 * question) * MS)
        c.client_waits()
        c.credit(1, 5, asks=True, lost=True)
    c.at(3100 * MS)
    c.client_waits()
    c.client_sees('timeout', call_id='<call>')
    c.cancel()
    return c


def cancelled_stream():
    c = Delivery('cancelled-stream',
                 'The client has enough of a stream; the server ends it.',
                 ['hp-5.9-2', 'hp-5.10-1'])
    c.handshake()
    c.at(10 * MS)
    c.asks_for_stream()
    c.server_streams()
    c.gives_item(0)
    c.step(client_does='cancel', call_id='<call>')
    c.cancel()
    c.step(server_sees='cancelled', call_id='<call>')
    c.step(server_does='item', call_id='<call>', payload='01')
    c.step(server_sees='no_credit', call_id='<call>')
    c.server_completes('<call>', 'cancelled')
    c.credit(1, 5, asks=True, **TO_SERVER)
    c.refuse('expired', 'call', 'session')
    c.counts('client', 'unexpected')
    return c


def stream_on_tcp():
    c = Delivery('stream-tcp',
                 'On TCP nothing is lost, and nothing repeated; but the client asks, so that the '
                 'server sees that somebody is there.',
                 ['hp-5.10-2', 'hp-5.10-5', 'hp-5.10-6'], medium='stream')
    c.handshake()
    c.at(10 * MS)
    c.asks_for_stream(2)
    c.server_streams()
    c.gives_item(0)
    c.gives_item(1)
    c.step(server_does='item', call_id='<call>', payload='ff')
    c.step(server_sees='no_credit', call_id='<call>')
    c.takes_items((0, 1))
    c.credit(2, 4)
    c.at(600 * MS)
    c.client_waits()
    c.credit(2, 4, asks=True)
    c.ack('server to client', 1, item=2)
    c.gives_item(2)
    c.takes_items((2,))
    c.credit(3, 5)
    c.ends_stream(3)
    c.client_sees('result', status='ok', payload='')
    c.credit(3, 5)
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
        large_request(), large_request_unanswered(), large_request_at_the_server(), large_reply(),
        large_reply_at_the_client(), ping(), several_calls(), unknown_status(),
        refusal_with_payload(), two_cookies(), order_of_judgement(), oneways(), oneways_not_run(),
        cancelled_call(), cancels_at_the_server(), items_that_nobody_takes(), stream(),
        stream_whose_end_is_lost(), stream_whose_reply_comes_first(), stream_whose_call_is_lost(),
        stream_at_the_server(), stream_without_a_client(), stream_without_a_server(),
        cancelled_stream(), stream_on_tcp(), server_stops(), malformed_closes(),
    ]
