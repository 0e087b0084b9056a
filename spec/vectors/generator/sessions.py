"""Conversations about what a session promises: its lane, its window, its end."""

from conversations import BEGIN_NS, MS, S
from deliveries import TO_SERVER, Delivery
from frames import NO_REPLY

BANDS = [[0, 16383], [16384, 32767]]
LOW, HIGH = 100, 24000


def two_lanes():
    c = Delivery('two-lanes',
                 'A server with two lanes. A client does not call outside its session\'s band: it '
                 'closes the session and opens one that serves the other priority.',
                 ['hp-4-1', 'hp-5.1-8', 'hp-11-1', 'hp-11-2', 'hp-4.5-1'],
                 server=dict(bands=BANDS))
    c.handshake()
    c.exchange('call', at_ns=1 * MS)
    c.at(2 * MS)
    c.priority = LOW
    c.client_calls(1, 2, '01')
    c.client_sees('wrong_band')
    c.step(client_does='close')
    c.frame('client to server', 'CLOSE', session='session', priority=HIGH)
    c.at(3 * MS)
    c.handshake('handshake2', 'cookie2', 'session2')
    c.exchange('call2', 'session2', at_ns=4 * MS)
    return c


def in_another_lane():
    c = Delivery('in-another-lane',
                 'Frames of a session reach the other lane of its server: CALL and CREDIT are '
                 'refused with wrong_band, and the session is good. Only a session that no lane '
                 'opened, or that the lane itself has not any more, is unknown.',
                 ['hp-4.4-4', 'hp-4.4-1', 'hp-5.1-5', 'hp-5.1-8', 'hp-5.8-1', 'hp-4.5-1'],
                 roles=['server'], server=dict(bands=BANDS))
    c.handshake()
    c.at(1 * MS)
    wrong = TO_SERVER | dict(priority=LOW)
    for copy in (False, True):
        c.call(1, copy=copy, **wrong)
        c.refuse('wrong_band', 1, 'session', priority=LOW)
    c.credit(0, 4, asks=True, call_id=2, **wrong)
    c.refuse('wrong_band', 2, 'session', priority=LOW)
    c.call(3, flags=NO_REPLY, **wrong)
    for kind in ('CANCEL', 'CLOSE'):
        fields = c.of_call(1) if kind == 'CANCEL' else dict(session='session')
        c.frame('network to server', kind, address='client', priority=LOW, **fields)
        c.counts('server', 'unknown_session')
    c.call(4, 99, **wrong)
    c.counts('server', 'unknown_session')
    c.refuse('unknown_session', 4, 99, priority=LOW)
    c.call(1, says='of the good session', **TO_SERVER)
    c.server_runs(1, 1, 2, '', c.now + S)
    c.server_completes(1)
    c.reply(1)
    c.frame('network to server', 'CLOSE', address='client', session='session')
    c.call(5, says='of a session that is closed', **TO_SERVER)
    c.counts('server', 'unknown_session')
    c.refuse('unknown_session', 5, 'session')
    c.at(2 * MS)
    c.server_epoch = 0x5e12e8
    c.step(server_does='restart', epoch=f'0x{c.server_epoch:016x}')
    c.call(6, says='of a former life', **wrong)
    c.counts('server', 'unknown_session')
    c.refuse('unknown_session', 6, 'session', priority=LOW)
    return c


def refused_by_another_lane():
    c = Delivery('refused-by-another-lane',
                 'REFUSE wrong_band ends a call, which has not run, and not its session.',
                 ['hp-4.4-4'], roles=['client'])
    c.handshake()
    c.at(1 * MS)
    for name in ('call', 'call2'):
        c.client_calls(1, 2, '01')
        c.call(name, payload='01')
    c.refuse('wrong_band', 'call', 'session')
    c.client_sees('result', call_id='<call>', status='wrong_band', payload='')
    c.reply('call2', payload='02')
    c.client_sees('result', call_id='<call2>', status='ok', payload='02')
    c.exchange('call3', at_ns=2 * MS)
    return c


def window_of_two():
    c = Delivery('window-of-two',
                 'A server that allows two calls at a time. The client begins no third; and while '
                 'one is still open, the numbers of later ones differ from its by odd numbers.',
                 ['hp-4.3-2', 'hp-4.3-1', 'hp-5.1-1'], roles=['client'], server=dict(window=2))
    c.handshake()
    c.at(1 * MS)
    for name in ('call', 'call2'):
        c.client_calls(1, 2, '01')
        c.call(name, payload='01')
    c.client_calls(1, 2, '01')
    c.client_sees('window_full')
    open_call = 'call'
    for number in range(3, 8):
        # The other one stays open.
        ended = 'call2' if number == 3 else f'call{number - 1}'
        c.at(number * MS)
        c.reply(ended)
        c.client_sees('result', call_id=f'<{ended}>', status='ok', payload='')
        c.client_calls(1, 2, '01')
        c.call(f'call{number}', payload='01')
    c.reply(open_call)
    c.client_sees('result', call_id=f'<{open_call}>', status='ok', payload='')
    c.client_calls(1, 2, '01')
    c.call('call8', payload='01')
    return c


def silent_server():
    c = Delivery('silent-server',
                 'Nothing comes for twelve seconds. The client repeats its call all the time, at '
                 'least each second: by that the server knows that the session is in use. Further '
                 'copies between these are its own affair (hp-5.3-1).',
                 ['hp-5.3-3', 'hp-5.3-2', 'hp-5.4-1'], roles=['client'])
    c.handshake()
    c.at(10 * MS)
    begun, patience = c.now, 30 * S
    c.client_calls(1, 2, '01', patience_ns=patience)
    c.call(payload='01', budget_us=patience // 1000, lost=True)
    for second in range(1, 13):
        c.at(begun - BEGIN_NS + second * S)
        c.client_waits()
        c.call(payload='01', budget_us=(patience - second * S) // 1000, copy=True, lost=True)
    c.reply(payload='02')
    c.client_sees('result', status='ok', payload='02')
    return c


def long_deadline():
    c = Delivery('long-deadline',
                 'A caller that waits for two hours: budget_us holds no more than 2³²−1 µs, and '
                 'each copy states that anew.', ['hp-5.4-1', 'hp-5.3-2'], roles=['client'])
    c.handshake()
    c.at(10 * MS)
    c.client_calls(1, 2, '01', patience_ns=7200 * S)
    c.call(payload='01', budget_us=2**32 - 1, lost=True)
    c.at(15 * MS)
    c.client_waits()
    c.call(payload='01', budget_us=2**32 - 1, copy=True)
    c.reply(payload='02')
    c.client_sees('result', status='ok', payload='02')
    return c


def traces():
    c = Delivery('traces',
                 'The caller\'s trace id goes with each frame about its call, copies too, and '
                 'comes back with the reply.',
                 ['hp-5.1-2', 'hp-5.3-2', 'hp-5.9-1', 'hp-5.10-1'])
    trace = 0x7ace7ace7ace7ace
    one = dict(trace_id=trace)
    c.handshake()
    c.at(10 * MS)
    c.client_calls(1, 2, '01', **one)
    c.call(payload='01', lost=True, **one)
    c.at(15 * MS)
    c.client_waits()
    c.call(payload='01', budget_us=995_000, copy=True, **one)
    c.server_runs('<call>', 1, 2, '01', c.now + 995 * MS)
    c.server_completes('<call>', payload='02')
    c.reply(payload='02', **one)
    c.client_sees('result', status='ok', payload='02')
    c.at(20 * MS)
    other = dict(trace_id=trace + 1)
    c.client_calls(1, 2, '03', **other)
    c.call('call2', payload='03', **other)
    c.server_runs('<call2>', 1, 2, '03', c.now + S)
    c.step(client_does='cancel', call_id='<call2>')
    c.cancel('call2', **other)
    c.step(server_sees='cancelled', call_id='<call2>')
    c.server_completes('<call2>', 'cancelled')
    c.at(30 * MS)
    c.asks_for_stream(call_id='call3', **one)
    c.server_streams('<call3>')
    c.gives_item(0, 'call3', **one)
    c.takes_items([0], 'call3')
    c.ends_stream(1, 'call3', **one)
    c.client_sees('result', call_id='<call3>', status='ok', payload='')
    c.credit(1, 5, call_id='call3', **one)
    return c


def lost_session():
    c = Delivery('lost-session',
                 'The server has forgotten the session, and is the same: a call that was begun '
                 'less than 30 s ago has not run, and may be sent again in a new session, as a new '
                 'call.', ['hp-5.5-2', 'hp-5.5-3', 'hp-5.1-1', 'hp-4-2', 'hp-4.4-1'],
                 roles=['client'])
    c.handshake()
    c.at(10 * MS)
    c.client_calls(1, 2, '01')
    c.call(payload='01')
    c.refuse('unknown_session', 'call', 'session')
    c.client_sees('lost')
    c.at(11 * MS)
    c.handshake('handshake2', 'cookie2', 'session2')
    c.client_sees('not_run', call_id='<call>')
    c.exchange('call2', 'session2', at_ns=12 * MS)
    c.at(13 * MS)
    c.refuse('unknown_session', 'call2', 'session')
    c.counts('client', 'unexpected')
    c.exchange('call3', 'session2', at_ns=14 * MS)
    return c


def old_call_of_a_lost_session():
    c = Delivery('old-call-of-a-lost-session',
                 'Two calls are open when the server, which is the same, refuses one as of an '
                 'unknown session. Both are over. The one that was begun 31 s ago may have run, '
                 'the other has not. Copies of the first, which are lost, are left out here.',
                 ['hp-5.5-2', 'hp-5.5-3'], roles=['client'])
    c.handshake()
    c.at(10 * MS)
    begun, patience = c.now, 100 * S
    c.client_calls(1, 2, '01', patience_ns=patience)
    c.call(payload='01', budget_us=patience // 1000, lost=True)
    c.at(begun - BEGIN_NS + 30 * S)
    c.client_calls(1, 2, '02', patience_ns=10 * S)
    c.call('call2', payload='02', budget_us=10_000_000)
    c.at(begun - BEGIN_NS + 31 * S)
    c.refuse('unknown_session', 'call2', 'session')
    c.client_sees('lost')
    c.handshake('handshake2', 'cookie2', 'session2')
    c.client_sees('may_have_run', call_id='<call>')
    c.client_sees('not_run', call_id='<call2>')
    return c


def refusal_of_a_former_call():
    c = Delivery('refusal-of-a-former-call',
                 'A REFUSE unknown_session of a call that is over. An open call goes on until it '
                 'is refused itself; without one the session is not used any more.',
                 ['hp-5.5-2', 'hp-5.5-3', 'hp-5.8-1'], roles=['client'])
    c.handshake()
    c.at(10 * MS)
    c.client_calls(1, 2, '01', delivery='sent')
    c.call(payload='01', flags=NO_REPLY)
    c.client_calls(1, 2, '02')
    c.call('call2', payload='02')
    c.refuse('unknown_session', 'call', 'session')
    c.counts('client', 'unexpected')
    c.refuse('unknown_session', 'call2', 'session')
    c.client_sees('lost')
    c.handshake('handshake2', 'cookie2', 'session2')
    c.client_sees('not_run', call_id='<call2>')
    return c


def fields_without_meaning(side):
    c = Delivery(f'fields-without-meaning-at-the-{side}',
                 'Fields that have no meaning in their frame hold something: the '
                 f'{side} does not look at it.', ['hp-2-7'], roles=[side])
    junk = dict(service=0x55, method=0x66, budget_us=0x77, trace_id=0x88)
    if side == 'server':
        # HELLO has no fields but call_id; its first form is answered as if they were 0.
        hello = lambda cookie: c.frame(
            'network to server', 'HELLO', c.hello_payload(cookie), address='client', call_id=1,
            session=0x44, status=3, **junk)
        hello(0)
        c.cookie(1)
        hello('cookie')
        c.welcome(1)
        c.at(1 * MS)
        c.call(1, status=3, **TO_SERVER)
        c.server_runs(1, 1, 2, '', c.now + S)
        c.frame('network to server', 'CANCEL', address='client', status=3, budget_us=7,
                **c.of_call(1))
        c.step(server_sees='cancelled', call_id=1)
        c.server_completes(1, 'cancelled')
        c.frame('network to server', 'CLOSE', address='client', session='session', call_id=0x33,
                status=3, **junk)
        c.call(2, **TO_SERVER)
        c.counts('server', 'unknown_session')
        c.refuse('unknown_session', 2, 'session')
        return c
    c.client_opens()
    c.hello()
    c.frame('network to client', 'COOKIE', '<cookie>', call_id='handshake', session=0x44, status=3,
            **junk)
    c.hello(cookie='cookie')
    c.frame('network to client', 'WELCOME', c.welcome_payload(), call_id='handshake',
            session='session', status=3, **junk)
    c.client_sees('ready')
    c.at(1 * MS)
    c.client_calls(1, 2)
    c.call()
    c.frame('network to client', 'REFUSE', call_id='call', session='session', status='overload',
            **junk)
    c.client_sees('result', status='overload', payload='')
    c.at(2 * MS)
    c.frame('network to client', 'CLOSE', session='session', call_id=0x33, status=3, **junk)
    c.client_sees('closed')
    return c


def conversations():
    return [
        two_lanes(), in_another_lane(), refused_by_another_lane(), window_of_two(),
        silent_server(), long_deadline(), traces(), lost_session(), old_call_of_a_lost_session(),
        refusal_of_a_former_call(), fields_without_meaning('server'),
        fields_without_meaning('client'),
    ]
