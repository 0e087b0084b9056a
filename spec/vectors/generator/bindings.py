"""Conversations of a client that has bound an object, and looks after session and number itself."""

from conversations import MS, wide
from deliveries import Delivery
from frames import bind_reply, bind_request
from sessions import BANDS, LOW

PATH, INTERFACE, FINGERPRINT = 'lab/arm0', 'lab.Arm', 0x0123456789abcdef
METHODS = [(1, 0x11111111), (2, 0x22222222)]
REQUEST = bind_request(PATH, INTERFACE, FINGERPRINT)


class Binding(Delivery):
    """The application binds lab/arm0 and calls its method 2, whatever its number is."""

    def __init__(self, name, about, rules, **more):
        super().__init__(name, about, rules, roles=['client'], **more)
        self.head['level'] = 'bindings'

    def binds(self, call_id='call', session='session', service=1, **more):
        self.call(call_id, session, service=0, method=1, payload=REQUEST, says='bind')
        reply = bind_reply(METHODS, service=service, **(dict(fingerprint=FINGERPRINT) | more))
        self.reply(call_id, session, service=0, method=1, payload=reply)

    def hellos(self, handshake='handshake', cookie='cookie', session='session'):
        self.hello(handshake)
        self.cookie(handshake, cookie)
        self.hello(handshake, cookie)
        self.welcome(handshake, session)

    def opens(self, **more):
        self.step(client_does='bind', path=PATH, interface=INTERFACE, priority=self.priority,
                  fingerprint=wide(FINGERPRINT, 8),
                  methods=[dict(id=id_, fingerprint=print_) for id_, print_ in METHODS])
        self.hellos()
        self.binds(**more)
        self.client_sees('bound')

    def calls_object(self, payload='01', is_idempotent=False, trace_id=0):
        self.step(client_does='call_object', method=2, priority=self.priority, payload=payload,
                  is_idempotent=is_idempotent, trace_id=wide(trace_id, 8))

    def good_call(self, call_id, session='session', service=1, payload='01', answer='02', **more):
        self.calls_object(payload, **more)
        self.call(call_id, session, service, payload=payload, **more)
        self.reply(call_id, session, service, payload=answer, **more)
        self.client_sees('result', status='ok', payload=answer)

    def refused_call(self, call_id, service=1, is_idempotent=False):
        self.calls_object(is_idempotent=is_idempotent)
        self.call(call_id, service=service, payload='01')
        self.refuse('unknown_session', call_id, 'session')


def bound_again():
    c = Binding('binding-in-a-new-epoch',
                'The server restarts. The call that met it may have run in the former life, and '
                'is not sent again. Before the next call the client binds again: the object has '
                'another number now.', ['hp-6.1-4', 'hp-5.5-2', 'hp-4.4-1', 'hp-5.1-1'])
    c.opens()
    c.good_call('call2', trace_id=0x7ace)
    c.at(10 * MS)
    c.server_epoch = 0x5e12e8
    c.refused_call('call3')
    c.hellos('handshake2', 'cookie2', 'session2')
    c.client_sees('may_have_run')
    c.at(20 * MS)
    c.calls_object()
    c.binds('call4', 'session2', service=5)
    c.call('call5', 'session2', 5, payload='01')
    c.reply('call5', 'session2', 5, payload='02')
    c.client_sees('result', status='ok', payload='02')
    c.good_call('call6', 'session2', 5)
    return c


def sent_again():
    c = Binding('binding-in-a-new-session',
                'The session is lost, and the server is the same: the client sends the call again '
                'in a new session, as a new call, to the number that it knows.',
                ['hp-5.5-2', 'hp-6.1-4', 'hp-5.1-1', 'hp-4-2'])
    c.opens()
    c.good_call('call2')
    c.at(10 * MS)
    c.refused_call('call3')
    c.hellos('handshake2', 'cookie2', 'session2')
    c.call('call4', 'session2', payload='01', says='as a new call')
    c.reply('call4', 'session2', payload='02')
    c.client_sees('result', status='ok', payload='02')
    return c


def idempotent():
    c = Binding('binding-of-an-idempotent-method',
                'The server restarts during a call that may run twice: the client binds again and '
                'sends it to the new life.', ['hp-5.5-2', 'hp-6.1-4'])
    c.opens()
    c.at(10 * MS)
    c.server_epoch = 0x5e12e8
    c.refused_call('call2', is_idempotent=True)
    c.hellos('handshake2', 'cookie2', 'session2')
    c.binds('call3', 'session2', service=5)
    c.call('call4', 'session2', 5, payload='01')
    c.reply('call4', 'session2', 5, payload='02')
    c.client_sees('result', status='ok', payload='02')
    return c


def two_lanes():
    c = Binding('binding-in-two-lanes',
                'An object of a server with two lanes is called at a priority of each: the client '
                'opens a session for the other one, and uses the number that it knows there, too.',
                ['hp-5.1-8', 'hp-6.1-4', 'hp-4-1'], server=dict(bands=BANDS))
    c.opens()
    c.good_call('call2')
    c.at(10 * MS)
    c.priority = LOW
    c.calls_object()
    c.hellos('other', 'cookie2', 'session2')
    c.call('low', 'session2', payload='01')
    c.reply('low', 'session2', payload='02')
    c.client_sees('result', status='ok', payload='02')
    return c


def server_declared():
    c = Binding('binding-of-a-server-declared-object',
                'The object declares its priority: calls go out at it, whatever the caller\'s is, '
                'and in a session that serves it.', ['hp-6.1-3', 'hp-5.1-8'],
                server=dict(bands=BANDS))
    c.step(client_does='bind', path=PATH, interface=INTERFACE, priority=LOW,
           fingerprint=wide(FINGERPRINT, 8),
           methods=[dict(id=id_, fingerprint=print_) for id_, print_ in METHODS])
    c.priority = LOW
    c.hellos()
    c.binds(flags=3, priority=24000)
    c.priority = 24000
    c.hellos('other', 'cookie2', 'session2')
    c.client_sees('bound')
    c.step(client_does='call_object', method=2, priority=LOW, payload='01', is_idempotent=False,
           trace_id=wide(0, 8))
    c.call('high', 'session2', payload='01')
    c.reply('high', 'session2', payload='02')
    c.client_sees('result', status='ok', payload='02')
    return c


def no_fingerprint():
    c = Binding('binding-without-a-fingerprint',
                'A server that has no fingerprint of its interface: the client compares the '
                'methods, and does not use the object whose method differs.',
                ['hp-6.1-6', 'hp-6.1-2'])
    c.step(client_does='bind', path=PATH, interface=INTERFACE, priority=c.priority,
           fingerprint=wide(0, 8), methods=[dict(id=2, fingerprint=0x33333333)])
    c.hellos()
    c.call(service=0, method=1, payload=bind_request(PATH, INTERFACE, 0), says='bind')
    c.reply(service=0, method=1, payload=bind_reply(METHODS, service=1, fingerprint=0))
    c.call('call2', service=0, method=3, payload='01000000', says='describe')
    c.reply('call2', service=0, method=3, status='no_such_method')
    c.client_sees('not_bound')
    return c


def conversations():
    return [bound_again(), sent_again(), idempotent(), two_lanes(), server_declared(),
            no_fingerprint()]
