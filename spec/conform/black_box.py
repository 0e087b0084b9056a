"""A server without a COMMAND: method 2 answers at once, with the number of its runs."""

import time

from layout import (CONSTANTS, HEADER_SIZE, Pattern, encode, encode_payload, header_of, kind_of,
                    number)
from steps import bands_of
from subject import CannotPlay, SubjectError

PATH, INTERFACE = b'lab/arm0', b'lab.Arm'
COUNT_SIZE = 8
USUAL_SETUP = dict(ceiling=32767, clock_domain='0x0000000000000000', window=8)


def check_playable(conversation):
    """Raises CannotPlay for a conversation in which the application has to do more."""
    setup = conversation['setup']['server']
    if bands_of(setup) != [[0, 32767]]:
        raise CannotPlay('needs a COMMAND: sets the bands')
    for name, usual in USUAL_SETUP.items():
        if setup[name] != usual:
            raise CannotPlay(f'needs a COMMAND: sets {name}')
    if setup['session_count_max'] != 4:
        raise CannotPlay('needs a COMMAND: sets session_count_max')
    if 'large_message_count_max' in setup:
        raise CannotPlay('needs a COMMAND: sets large_message_count_max')
    steps = conversation['steps']
    running = None
    for step in steps:
        what = step.get('server_does')
        if what in ('stop', 'restart', 'item', 'receipt') or step.get('status', 'ok') != 'ok' and \
                what == 'complete':
            raise CannotPlay('needs a COMMAND: stops, restarts, streams, other statuses than ok')
        if what == 'complete':
            if running != step['call_id']:
                raise CannotPlay('needs a COMMAND: a call ends later than it begins')
            running = None
        elif step.get('server_sees') == 'run':
            running = step['call_id']
        elif is_input(step):
            running = None
        if step.get('server_sees') in ('cancelled', 'no_credit', 'item_too_large'):
            raise CannotPlay('needs a COMMAND: the method reports cancellation or credit')
        if step.get('frame') == 'server to client' and is_large_reply(step, conversation['free']):
            raise CannotPlay('needs a COMMAND: a large reply')


def is_input(step):
    return 'frame' in step and not step.get('is_lost') and step['frame'].endswith(' to server')


def is_large_reply(step, free):
    header = header_of(Pattern(step['hex'], free).fill({}))
    return header['kind'] == CONSTANTS['kinds']['REPLY'] and header['fragment_count'] > 1


def unfinished_calls(steps):
    """The calls whose end the vector leaves out: this server answers them all the same."""
    ended = {step['call_id'] for step in steps if step.get('server_does') == 'complete'}
    return {step['call_id'] for step in steps
            if step.get('server_sees') == 'run' and step['call_id'] not in ended}


def text(value):
    return len(value).to_bytes(2, 'little') + value


def find_service(peer):
    """Binds the object in a session of its own, and closes it; gives the object's number."""
    call_id = 0x7e570000
    about = dict(priority=24000, call_id=call_id)

    def exchange(kind, payload, **fields):
        for _ in range(5):
            if not peer.wire.send(encode(kind, payload, sender_time_ns=time.monotonic_ns(),
                                         **(about | fields)), 'finder'):
                break
            event = peer.next_event(time.monotonic() + 0.3)
            while event is not None and not hasattr(event, 'data'):
                event = peer.next_event(time.monotonic() + 0.3)
            if event is not None:
                return event.data
        raise SubjectError('no server answers at %s:%d' % peer.address)

    def hello(cookie):
        return exchange('HELLO', encode_payload(
            'HELLO', version_min=1, version_max=1, client_epoch=0xf17de5, channel=1,
            message_size_max=1344, cookie=cookie))

    answer = hello(bytes(16))
    if kind_of(answer) == 'COOKIE':
        answer = hello(answer[HEADER_SIZE:])
    session = header_of(answer)['session']
    bind = bytes(8) + text(PATH) + text(INTERFACE)
    reply = exchange('CALL', bind, session=session, method=CONSTANTS['method_bind'],
                     budget_us=2_000_000)
    if kind_of(reply) != 'REPLY' or header_of(reply)['status'] != 0:
        raise SubjectError(f'the server at {peer.address[0]}:{peer.address[1]} has no object '
                           f'{PATH.decode()} of the interface {INTERFACE.decode()}')
    peer.wire.send(encode('CLOSE', priority=24000, session=session,
                          sender_time_ns=time.monotonic_ns()), 'finder')
    peer.wire.ends.pop('finder').close()
    return number(reply[HEADER_SIZE:HEADER_SIZE + 4])


class RunCounter:
    """Whether the counts in the replies grow by one from run to run, and copies repeat theirs."""

    def __init__(self):
        self.last = None
        self.counts = {}

    def objection(self, key, payload):
        if len(payload) != COUNT_SIZE:
            return f'is not {COUNT_SIZE} bytes: the number of runs'
        count = number(payload)
        if key in self.counts:
            return count != self.counts[key] and 'is not that of the reply which this repeats'
        if self.last is not None and count != self.last + 1:
            return f'is {count - self.last} runs after the last reply'
        self.last = self.counts[key] = count
        return None
