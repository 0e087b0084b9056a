"""Conversations with streams: items small and large, gaps, credit, pauses and ends."""

from conversations import MS, S, US
from deliveries import LARGE, LEASE_US, TO_SERVER, Delivery, parts_of
from frames import ACK, ACK_WANTED, CREDIT, KIB, size_of


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


def gaps_of_a_stream():
    c = Delivery('gaps-of-a-stream',
                 'Each gap is told once, when the first frame behind it comes. A frame that was '
                 'there is dropped and brings no CREDIT, which would bring more of them.',
                 ['hp-5.10-4'], roles=['client'])
    c.handshake()
    c.at(10 * MS)
    c.asks_for_stream(8)
    c.item(0)
    c.item(2)
    c.credit(1, 8, later=1)
    c.item(4)
    c.credit(1, 8, later=0b101)
    for number in (2, 0, 4):
        c.item(number, copy=True)
        c.counts('client', 'unexpected')
    c.item(1, copy=True)
    c.item(3, copy=True)
    c.takes_items(range(5))
    c.credit(5, 13)
    c.reply(item=5)
    c.client_sees('result', status='ok', payload='')
    c.credit(5, 13)
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
    c.item(1000, way='network to client')
    c.counts('client', 'unexpected')
    c.reply(item=1000, way='network to client')
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
    tells(33, 34, payload='21000000' + '00a8000000000000000000')
    c.counts('server', 'bad_payload')
    tells(33, 34, payload='2100000000a800000000000000000000' + '00')
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
                 'stream and tells the method. Who asks later learns that it is lost.',
                 ['hp-5.10-7', 'hp-4.6-2'], roles=['server'])
    c.handshake()
    c.at(10 * MS)
    c.stream_call(4, 1, **TO_SERVER)
    c.server_runs(1, 1, 2, '01', c.now + LEASE_US * US)
    c.step(server_does='item', call_id=1, payload='00')
    c.item(0, 1)
    c.at(2000 * MS)
    c.credit(1, 5, call_id=1, **TO_SERVER)
    c.at(11999 * MS)
    c.step(server_does='wait')
    c.step(server_does='item', call_id=1, payload='01')
    c.item(1, 1)
    c.at(12000 * MS)
    c.step(server_does='wait')
    c.step(server_sees='cancelled', call_id=1)
    c.step(server_does='item', call_id=1, payload='02')
    c.step(server_sees='no_credit', call_id=1)
    c.credit(2, 6, call_id=1, asks=True, **TO_SERVER)
    c.refuse('lost', 1, 'session')
    c.server_completes(1, 'cancelled')
    c.credit(2, 6, call_id=1, asks=True, **TO_SERVER)
    c.refuse('lost', 1, 'session')
    return c


def stream_without_a_server():
    c = Delivery('stream-without-a-server',
                 'Nothing comes of a stream any more: the client asks at least every 500 ms, and '
                 '3 s after the first question takes it for lost, and says so by CANCEL.',
                 ['hp-5.10-5', 'hp-5.10-7', 'hp-4.6-2', 'hp-5.9-4'],
                 roles=['client'])
    c.handshake()
    c.at(10 * MS)
    c.asks_for_stream()
    c.item(0)
    c.takes_items((0,))
    for question in range(1, 7):
        c.at((10 + 501 * question) * MS)
        c.client_waits()
        c.credit(1, 5, asks=True, lost=True)
    c.at(3600 * MS)
    c.client_waits()
    c.client_sees('timeout', call_id='<call>')
    c.cancel()
    return c


def stream_that_pauses():
    c = Delivery('stream-that-pauses',
                 'A client takes no items and asks nothing for longer than it waits for answers, but '
                 'less than it stated: the stream goes on.',
                 ['hp-5.10-5', 'hp-5.10-7'])
    c.handshake()
    c.at(10 * MS)
    c.asks_for_stream()
    c.server_streams()
    c.gives_item(0)
    c.gives_item(1)
    c.takes_items((0, 1))
    c.credit(2, 6)
    c.at(9000 * MS)
    c.step(server_does='wait')
    c.client_waits()
    c.credit(2, 6, asks=True)
    c.ack('server to client', 1, item=2)
    c.gives_item(2)
    c.takes_items((2,))
    c.ends_stream(3)
    c.client_sees('result', status='ok', payload='')
    c.credit(3, 7)
    return c


def stream_for_as_long_as_its_connection():
    c = Delivery('stream-for-as-long-as-its-connection',
                 'On TCP a client may state no limit: the stream lasts as long as the connection.',
                 ['hp-5.10-7'], medium='stream', roles=['server'])
    c.handshake()
    c.at(10 * MS)
    c.stream_call(4, 1, **(TO_SERVER | dict(budget_us=2**32 - 1)))
    c.server_runs(1, 1, 2, '01', c.now + (2**32 - 1) * US)
    c.at(20 * S)
    c.step(server_does='wait')
    c.step(server_does='item', call_id=1, payload='00')
    c.item(0, 1)
    return c


def large_items():
    c = Delivery('large-items',
                 'A stream of an item in four fragments, a small one, and another large one. Of the '
                 'first the third fragment is lost, of the last the end: the client asks for that.',
                 ['hp-2-4', 'hp-5.10-1', 'hp-5.10-4', 'hp-5.10-5', 'hp-5.10-6', 'hp-5.10-9',
                  'hp-5.10-11'], **LARGE)
    c.handshake()
    c.at(10 * MS)
    c.asks_for_stream(8)
    c.server_streams()
    parts = parts_of(1344, 1344, 1344, 10)
    given = c.now
    c.step(server_does='item', call_id='<call>', payload=''.join(parts))
    c.part(parts, 0, together=True)
    c.part(parts, 1, together=True)
    c.part(parts, 2, together=True, lost=True)
    c.part(parts, 3)
    # What was moved to where the item is put together is granted again.
    c.credit(2, 8, later=1, byte_limit=43_008 + 2 * 1344)
    c.part(parts, 2, copy=True, given=given)
    c.takes([''.join(parts)])
    c.gives_item(4)
    last = parts_of(1344, 7)
    given = c.now
    c.step(server_does='item', call_id='<call>', payload=''.join(last))
    c.part(last, 0, 5, together=True)
    c.part(last, 1, 5, lost=True)
    ended = c.ends_stream(7, lost=True)
    c.at(600 * MS)
    c.client_waits()
    # The small item has not been taken, and what lies behind it waits.
    c.credit(6, 9, asks=True, byte_limit=43_008 + size_of(''.join(parts)))
    c.part(last, 1, 5, copy=True, given=given, together=True)
    c.reply(item=7, took_us=c.took_us(ended), copy=True, sender_time_ns=ended)
    c.client_sees('result', status='ok', payload='')
    c.credit(7, 9, byte_limit=43_008 + size_of(''.join(parts)))
    c.takes(['04', ''.join(last)])
    return c


def bytes_of_a_stream():
    c = Delivery('bytes-of-a-stream',
                 'A server sends no more bytes than were granted, 43008 at first; to acknowledge '
                 'frames grants none.', ['hp-5.10-2', 'hp-5.10-9'], roles=['server'],
                 client=dict(message_size_max=64 * KIB), server=dict(message_size_max=64 * KIB))
    c.handshake()
    c.at(10 * MS)
    c.stream_call(4, 1, **TO_SERVER)
    c.received = c.now
    c.server_runs(1, 1, 2, '01', c.now + LEASE_US * US)
    parts = parts_of(*[1344] * 33, 5)
    given = c.now
    c.step(server_does='item', call_id=1, payload=''.join(parts))
    for index in range(32):
        c.part(parts, index, call_id=1, given=given, together=index < 31)
    c.credit(32, 8, call_id=1, byte_limit=43_008, **TO_SERVER)
    c.credit(32, 8, call_id=1, byte_limit=43_008 + 1343, **TO_SERVER)
    c.credit(32, 8, call_id=1, byte_limit=43_008 + 1344, **TO_SERVER)
    c.part(parts, 32, call_id=1, given=given)
    c.credit(33, 8, call_id=1, byte_limit=0, **TO_SERVER)
    c.credit(33, 8, call_id=1, byte_limit=43_008 + 1349, **TO_SERVER)
    c.part(parts, 33, call_id=1, given=given)
    return c


def too_large_items():
    c = Delivery('too-large-items',
                 'The client takes items of 1 KiB: a method that gives a larger one is told so, and '
                 'the stream ends with too_large. What a server sends nevertheless is dropped, as '
                 'is a fragment that belongs to no item.',
                 ['hp-5.10-10', 'hp-5.10-11'], client=dict(message_size_max=KIB))
    c.handshake()
    c.at(10 * MS)
    c.asks_for_stream()
    c.server_streams()
    c.step(server_does='item', call_id='<call>', payload='a0' * (KIB + 1))
    c.step(server_sees='item_too_large', call_id='<call>')
    c.part(parts_of(KIB, 1), 0, way='network to client')
    c.counts('client', 'bad_length')
    c.part(parts_of(600, 1), 1, -1, way='network to client')
    c.counts('client', 'unexpected')
    c.ends_stream(0, status='too_large')
    c.client_sees('result', status='too_large', payload='')
    c.credit(0, 4)
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
    c.refuse('lost', 'call', 'session')
    c.counts('client', 'unexpected')
    return c


def refused_stream():
    c = Delivery('refused-stream',
                 'A stream that the server will not give: its REPLY may say why.',
                 ['hp-5.10-12', 'hp-7-1'], roles=['client'])
    c.handshake()
    c.at(10 * MS)
    words = 'this method gives no stream'.encode().hex()
    c.asks_for_stream()
    c.reply(status='bad_request', payload=words)
    c.client_sees('result', status='bad_request', payload=words)
    c.credit(0, 4)
    return c


def credits_of_no_stream():
    c = Delivery('credits-of-no-stream',
                 'CREDITs of a call that never came, and of one that is no stream.',
                 ['hp-5.10-7', 'hp-8-1'], roles=['server'])
    c.handshake()
    c.at(10 * MS)
    c.credit(0, 4, call_id=1, asks=True, **TO_SERVER)
    c.refuse('lost', 1, 'session')
    c.credit(0, 4, call_id=1, **TO_SERVER)
    c.counts('server', 'unexpected')
    c.call(2, **TO_SERVER)
    c.server_runs(2, 1, 2, '', c.now + S)
    c.credit(0, 4, call_id=2, asks=True, **TO_SERVER)
    c.refuse('lost', 2, 'session')
    c.credit(0, 4, call_id=2, **TO_SERVER)
    c.counts('server', 'unexpected')
    c.server_completes(2)
    c.reply(2)
    return c


def impossible_ends():
    c = Delivery('impossible-ends-of-a-stream',
                 'REPLYs that end a stream before a frame which came, or far beyond what was '
                 'granted, end nothing.', ['hp-5.10-6', 'hp-8-1'], roles=['client'])
    c.handshake()
    c.at(10 * MS)
    c.asks_for_stream()
    c.item(0)
    c.item(1)
    for count in (0, 1, 1000, 2**32 - 1):
        c.reply(item=count, way='network to client')
        c.counts('client', 'unexpected')
    c.reply(item=2)
    c.client_sees('result', status='ok', payload='')
    c.credit(2, 4)
    c.takes_items((0, 1))
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


def conversations():
    return [
        stream(), gaps_of_a_stream(), stream_whose_end_is_lost(), stream_whose_reply_comes_first(),
        stream_whose_call_is_lost(), stream_at_the_server(), stream_without_a_client(),
        stream_without_a_server(), stream_that_pauses(), stream_for_as_long_as_its_connection(),
        large_items(), bytes_of_a_stream(), too_large_items(), cancelled_stream(), stream_on_tcp(),
        refused_stream(), credits_of_no_stream(), impossible_ends(),
    ]
