"""Plays a conversation against the program under test, as the side that it is not."""

import time

import black_box
from compare import Comparer, is_copy
from layout import (ACK_WANTED, CONSTANTS, HEADER_SIZE, encode, encode_payload, header_of, is_bind,
                    kind_of, number)
from peer import Failure, Frame, Line, Peer
from steps import bands_of, check_playable, judge, steps_of_session, tell_step
from subject import CannotPlay, SubjectError

SETTLE_S = 0.03  # Between orders that reach the program under test by different ways.
PAUSE_SLACK_S = 0.7  # A busy machine may take so long to send a copy and to take it.
QUIET_S = 0.15  # So long nothing more may come at the end.
BINDING_TIMEOUT_US = 20_000_000  # The vectors of bindings state no deadline.
CROSSING_S = 1.0  # A copy may cross its answer for so long.
HELLO_COUNT_MAX = 20  # Of one handshake of the vectors: even one that repeats each 10 ms sends less.
GAP_S = 0.025  # A question (hp-5.10-5) comes later than that; a CREDIT at a gap hardly does.
RUN_SLACK_US = 2000  # Between what the tool sees of a run and what the server does.

# Where a vector waits until just before a limit, the wait over a socket is so much shorter.
EARLY_S = {'stream-without-a-client': 0.15}


def setup_of(conversation, role):
    setup = dict(conversation['setup'][role])
    setup.pop('epoch', None)
    setup.pop('channel', None)
    setup.pop('window', None)
    if role == 'server':
        setup['bands'] = ','.join(f'{low}-{high}' for low, high in bands_of(setup))
        setup.pop('band', None)
    elif conversation.get('level'):
        setup['level'] = conversation['level']
    return setup


class GoOn(Exception):
    """The program under test leaves out, or does later, what the vector has at this place."""

    def __init__(self, at):
        super().__init__()
        self.at = at  # The step that comes instead.


class Player:
    """One conversation, step by step."""

    def __init__(self, conversation, role, options, name=''):
        self.name, self.role, self.options = name, role, options
        self.conversation = conversation
        self.medium = conversation['medium']
        self.steps = conversation['steps']
        self.compare = Comparer(conversation, role)
        self.peer = Peer(role, self.medium, options)
        self.setup = setup_of(conversation, role)
        self.sent = []  # Frames that the program under test sent and that were taken.
        self.answered = {}  # When the tool answered a call or handshake, by (is call, number).
        self.real_times = {}  # What a time of the vector was on the real clock.
        self.given_at = None  # When the last frame was given.
        self.words = {}  # The names that the lines use: of a call's number, and of a call's <name>.
        self.is_skipped = False  # The last step could not be given.
        self.heard_at = {}  # When a call was sent last, by number.
        self.of_session = steps_of_session(self.steps)
        self.unfinished = set()
        if role == 'server' and not options.command:
            self.compare.run_counter = black_box.RunCounter()
            self.unfinished = black_box.unfinished_calls(self.steps)
        self.last_way = None
        self.anchor = None
        self.is_hung_up = False
        self.receipts = []  # Those that the server under test was told to send.
        self.early = []  # Those that it sent by itself before.
        self.first_handshake = None  # The number of the first HELLO of a client under test.
        self.hello_counts = {}  # Of a client under test, by handshake number.
        self.gaps = []  # For each gap of a stream: whether only a question told of it.
        self.passed_over = []  # Frames that were taken as no answer to the step that is waited for.
        self.runs = {}  # When a call was seen to run.

    @property
    def notes(self):
        return self.peer.notes

    def play(self):
        """Raises Failure, CannotPlay or SubjectError if it does not go as the vector says."""
        check_playable(self.conversation, self.role, self.options)
        if self.compare.run_counter:
            black_box.check_playable(self.conversation)
        self.find_words()
        at = 0
        try:
            self.peer.start(self.setup)
            self.compare.service = self.peer.service
            self.anchor = (self.steps[0]['at_ns'], time.monotonic())
            while at < len(self.steps):
                kind = self.judge(at)
                if kind == 'output':
                    begin = at
                    while at < len(self.steps) and self.judge(at) != 'input':
                        at += 1
                    try:
                        self.expect([(i, self.steps[i]) for i in range(begin, at)
                                     if self.judge(i) == 'output'])
                    except GoOn as other:
                        at = other.at
                    continue
                if kind == 'input':
                    self.give(at, self.steps[at])
                at += 1
            self.expect_silence(time.monotonic() + QUIET_S)
            self.peer.check_counters()
            self.check_gaps()
        except Failure as failure:
            if failure.step is None:
                failure.step = min(at, len(self.steps) - 1)
            raise
        finally:
            self.peer.stop()

    def judge(self, index):
        """What a step is to the program under test. What the session itself does is nothing."""
        step = self.steps[index]
        if self.compare.run_counter and 'frame' not in step and \
                ('server_does' in step or step.get('server_sees') == 'run'):
            return 'nothing'
        return 'nothing' if index in self.of_session else judge(step, self.role)

    def find_words(self):
        """Names the calls that the client's application makes by the frame that each gives."""
        for i, step in enumerate(self.steps):
            if step.get('client_does') != 'call':
                continue
            self.words[i] = f'c{i}'
            for later in self.steps[i:]:
                pattern = later.get('frame') == 'client to server' and later['hex']
                if pattern and pattern[6:8] == '05':
                    call = self.call_name(pattern)
                    self.words[call] = f'c{i}'
                    break

    def call_name(self, hex_text):
        """What stands in a frame's call_id: `<call2>`, or a number."""
        cells = self.compare.pattern(hex_text)
        return f'<{cells.name_at(16)}>' if cells.name_at(16) else number(bytes(cells.cells[16:20]))

    # ---- time ----

    def wait_for(self, virtual_ns):
        """Until the vector's time has come, counted from the step before; nothing may come."""
        begun_ns, begun = self.anchor
        wait_s = (virtual_ns - begun_ns) / 1e9
        if wait_s > EARLY_S.get(self.name, 0) * 2:
            wait_s -= EARLY_S.get(self.name, 0)
        if begun + wait_s > time.monotonic():
            self.expect_silence(begun + wait_s)

    def passed(self, virtual_ns):
        self.anchor = (virtual_ns, time.monotonic())

    # ---- what is given to the program under test ----

    def give(self, index, step):
        what = step.get(f'{self.role}_does')
        if what == 'wait':
            return
        virtual_ns = step.get('arrives_ns', step['at_ns'])
        self.wait_for(virtual_ns)
        way = 'wire' if 'frame' in step else 'network' if 'network_does' in step else 'lines'
        if self.last_way not in (None, way):
            self.expect_silence(time.monotonic() + SETTLE_S)
        self.last_way = way
        if way == 'wire':
            self.give_frame(index, step)
        elif way == 'network':
            self.peer.wire.disconnect()
            self.last_way = None
            self.expect_silence(time.monotonic() + 2 * SETTLE_S)
        elif self.role == 'client':
            self.client_does(index, step)
        else:
            self.server_does(step)
        self.passed(virtual_ns)

    def give_frame(self, index, step):
        frame = bytearray(self.compare.fill(step['hex']))
        if len(frame) >= HEADER_SIZE:
            self.stamp(frame, step)
            self.note_given(frame)
        self.given_at = time.monotonic()
        self.is_skipped = not self.peer.wire.send(bytes(frame), step.get('address', 'client'))
        if self.is_skipped:
            self.notes.append(f'step {index} was not sent: the address of the client is unknown '
                              'until its first frame')

    def stamp(self, frame, step):
        """Gives a frame the real time, the same as before where the vector's is the same, and a
        REPLY the time that it really took."""
        virtual = number(frame[48:56])
        key = (kind_of(frame), bytes(frame[16:20]), bytes(frame[44:48]), virtual)
        if abs(virtual - step['at_ns']) < 1e12:
            now = self.real_times.setdefault(key, time.monotonic_ns())
            frame[48:56] = now.to_bytes(8, 'little')
        if kind_of(frame) == 'REPLY' and self.role == 'client':
            call_id = number(frame[16:20])
            took_us = min(number(frame[40:44]), self.took_us(call_id))
            took_us = self.real_times.setdefault(key + ('took',), took_us)
            frame[40:44] = took_us.to_bytes(4, 'little')

    def took_us(self, call_id):
        begun = next((event.at for event in self.sent if kind_of(event.data) == 'CALL' and
                      number(event.data[16:20]) == call_id), None)
        return 0 if begun is None else int((time.monotonic() - begun) * 1e6)

    def note_given(self, frame):
        kind, call_id = kind_of(frame), number(frame[16:20])
        if kind in ('COOKIE', 'WELCOME', 'REPLY', 'REFUSE', 'ITEM', 'ACK', 'CLOSE'):
            self.answered[kind in ('REPLY', 'ITEM', 'ACK', 'REFUSE'), call_id] = time.monotonic()
        if kind == 'CALL':
            self.compare.asked_at.setdefault(call_id, time.monotonic())

    def client_does(self, index, step):
        what = step['client_does']
        left_us = max((step.get('deadline_ns', 0) - step['at_ns']) // 1000, 0)
        if what == 'open':
            self.peer.tell('does', 'open', priority=step['priority'], timeout_us=left_us)
        elif what == 'call':
            word = self.words[index]
            self.peer.tell('does', 'call', word, service=step['service'], method=step['method'],
                           priority=step['priority'], timeout_us=left_us,
                           trace_id=step['trace_id'], delivery=step.get('delivery', 'reply'),
                           window=step.get('window', 0), payload=step['payload'])
        elif what in ('take', 'cancel'):
            self.peer.tell('does', what, self.words[step['call_id']])
        elif what == 'close':
            self.peer.tell('does', 'close')
        else:
            self.binding_does(what, step)

    def binding_does(self, what, step):
        """What the application of a client does that looks after sessions by itself."""
        values = dict(priority=step['priority'], timeout_us=BINDING_TIMEOUT_US)
        if what == 'bind':
            methods = (f'{one["id"]}:{one["fingerprint"]}' for one in step['methods'])
            self.peer.tell('does', 'bind_object', path=step['path'], interface=step['interface'],
                           fingerprint=step['fingerprint'], methods=','.join(methods), **values)
        else:
            self.peer.tell('does', 'call_object', method=step['method'],
                           is_idempotent=int(step['is_idempotent']), trace_id=step['trace_id'],
                           payload=step['payload'], **values)

    def server_does(self, step):
        what = step['server_does']
        if what == 'restart':
            if self.peer.subject is None:
                raise CannotPlay('needs a COMMAND: restarts')
            self.peer.restart(self.setup)
            return
        if what == 'stop':
            self.peer.tell('does', 'stop')
            return
        word = self.words.get(self.compare.bindings.number(step['call_id']))
        if word is None:  # The session itself runs it.
            return
        values = {key: step[key] for key in ('status', 'payload') if key in step}
        self.note_run_time(what, self.compare.bindings.number(step['call_id']))
        self.peer.tell('does', what, word, **values)
        if what == 'receipt':
            self.receipts.append(step)
            self.peer.events.extendleft(reversed(self.early))
            self.early.clear()

    def note_run_time(self, what, call_id):
        """hp-5.7-1: a REPLY states at least as much as its method ran."""
        seen = self.runs.pop(call_id, None)
        if what == 'item' and seen is not None:
            self.runs[call_id] = seen
        elif what == 'complete' and seen is not None:
            ran_us = int((time.monotonic() - seen) * 1e6) - RUN_SLACK_US
            self.compare.ran_us[call_id] = max(ran_us, 0)

    # ---- what the program under test has to do ----

    def expect(self, group):
        """Everything in `group`, in any order, and nothing else."""
        self.passed_over.clear()
        counts = [step[f'{self.role}_counts'] for _, step in group if f'{self.role}_counts' in step]
        pending = [(i, step) for i, step in group if f'{self.role}_counts' not in step]
        begun_ns, begun = self.anchor
        last_ns = max(step['at_ns'] for _, step in group)
        until = max(time.monotonic(), begun + (last_ns - begun_ns) / 1e9) + self.peer.patience_s
        while pending:
            event = self.peer.next_event(until)
            if event is None:
                raise self.missing(pending)
            self.take(event, pending)
        if counts and not self.is_skipped:
            self.peer.counted.update(counts)
            self.peer.check_counters()
        if len(counts) < len(group) or (self.peer.has_counters and self.peer.subject):
            self.last_way = None  # What was given before has been taken.
        self.passed(last_ns)

    def expect_silence(self, until):
        while True:
            event = self.peer.next_event(until)
            if event is None:
                return
            self.take(event, [])

    def missing(self, pending):
        index, step = pending[0]
        failure = Failure(f'nothing came within {self.peer.patience_s:g} s of: {tell_step(step)}',
                          self.conversation['rules'])
        if 'frame' in step:
            failure.frames = [('expected', self.compare.fill(step['hex']))]
            self.add_nearest(failure, step)
        failure.step = index
        return failure

    def add_nearest(self, failure, step):
        """The frame that came meanwhile, was taken for something else, and differs least."""
        found = [(self.compare.differences(step['hex'], event.data, event.at), event.data)
                 for event in self.passed_over]
        found = [one for one in found if one[0]]
        if found:
            differences, data = min(found, key=lambda one: (one[0][0].field == 'kind', len(one[0])))
            failure.differences = differences
            failure.frames.append((f'the nearest that came, a {kind_of(data)}', data))

    def take(self, event, pending):
        """Takes `event` as one of `pending`, or as something that is allowed at any time."""
        if isinstance(event, Line):
            self.take_line(event, pending)
        elif isinstance(event, Frame):
            self.take_frame(event, pending)
        else:
            self.take_end(pending)

    def take_end(self, pending):
        for entry in pending:
            if entry[1].get('server_sees') == 'hang_up' or entry[1].get('client_sees') == 'broken':
                pending.remove(entry)
                self.is_hung_up = True
                return
        if self.role == 'client':
            return  # A client may end a connection that it does not need.
        raise Failure('it ended the connection', ['hp-8-2', 'hp-5.5-1'])

    def take_frame(self, event, pending):
        self.check_pause(event)
        self.check_hello(event)
        frames = [entry for entry in pending if 'frame' in entry[1]]
        closest = None
        if self.is_early_receipt(event):
            self.early.append(event)
            return
        for entry in frames:
            found = self.compare.differences(entry[1]['hex'], event.data, event.at)
            if not found:
                pending.remove(entry)
                self.sent.append(event)
                self.check_way(entry, event)
                self.note_gap(entry[1], event)
                return
            if closest is None or len(found) < len(closest[1]):
                closest = (entry, found)
        if self.is_tolerated(event):
            self.passed_over.append(event)
            return
        self.check_fragment_size(event, frames)
        if closest is None or closest[1][0].field == 'kind':
            where = tell_step(pending[0][1]) if pending else 'nothing more'
            raise Failure(f'it sent {kind_of(event.data)}; expected: {where}',
                          self.surplus_rules(event), closest[1] if closest else (),
                          [('received', event.data)])
        (index, step), found = closest
        failure = Failure(f'its {kind_of(event.data)} is not as expected: {tell_step(step)}',
                          [difference.rule for difference in found], found,
                          [('expected', self.compare.fill(step['hex'])), ('received', event.data)])
        failure.step = index
        raise failure

    def is_early_receipt(self, event):
        """A server may answer a CALL with *reply on receipt* before it is told to."""
        if self.role != 'server' or kind_of(event.data) != 'REPLY':
            return False
        due = [step for step in self.steps if step.get('server_does') == 'receipt' and
               step not in self.receipts]
        calls = {self.compare.bindings.number(step['call_id']) for step in due}
        return number(event.data[16:20]) in calls

    def check_pause(self, event):
        """hp-5.3-3: copies of a call that is not answered are at most 1 s apart."""
        if self.medium == 'stream' or kind_of(event.data) != 'CALL':
            return
        call_id = number(event.data[16:20])
        pause_s = event.at - self.heard_at.get(call_id, event.at)
        self.heard_at[call_id] = event.at
        if pause_s > 1 + PAUSE_SLACK_S and (True, call_id) not in self.answered:
            raise Failure(f'it repeated an unanswered call only after {pause_s:.1f} s',
                          ['hp-5.3-3'], frames=[('received', event.data)])

    def check_hello(self, event):
        """hp-4.2-4: COOKIEs are not answered one by one."""
        if self.role != 'client' or kind_of(event.data) != 'HELLO':
            return
        handshake = number(event.data[16:20])
        if self.first_handshake is None:
            self.first_handshake = handshake
        count = self.hello_counts[handshake] = self.hello_counts.get(handshake, 0) + 1
        if count > HELLO_COUNT_MAX:
            raise Failure(f'it sent {count} HELLOs of one handshake: it answers every COOKIE',
                          ['hp-4.2-4'], frames=[('received', event.data)])

    def note_gap(self, step, event):
        """hp-5.10-4: a gap is told of at once, and not by the next question (hp-5.10-5) alone."""
        if self.role != 'client' or kind_of(event.data) != 'CREDIT' or not self.given_at:
            return
        wanted = self.compare.fill(step['hex'])
        if any(wanted[HEADER_SIZE + 8:]) and not number(wanted[6:8]) & ACK_WANTED:
            is_question = number(event.data[6:8]) & ACK_WANTED != 0
            self.gaps.append(is_question and event.at - self.given_at > GAP_S)

    def check_gaps(self):
        if len(self.gaps) > 1 and all(self.gaps):
            raise Failure('it told of no gap of a stream at once, but asked later', ['hp-5.10-4'])

    def check_way(self, entry, event):
        """An answer goes to where the frame came from."""
        index, step = entry
        before = [s for s in self.steps[:index] if s.get('frame', '').endswith(f'to {self.role}')]
        wanted = before[-1].get('address', 'client') if before else 'client'
        if self.role == 'server' and wanted == 'other' and event.end != 'other':
            raise Failure('it sent the answer to another address than the one that asked',
                          ['hp-4.2-1'], frames=[('received', event.data)])

    def surplus_rules(self, event):
        if kind_of(event.data) in ('CALL', 'HELLO') and self.medium == 'stream':
            return ['hp-5.3-4']
        return self.conversation['rules']

    def check_fragment_size(self, event, frames):
        if len(event.data) < HEADER_SIZE:
            return
        header = header_of(event.data)
        for _, step in frames:
            wanted = header_of(self.compare.fill(step['hex']))
            if header['fragment_count'] > wanted['fragment_count'] > 1 and \
                    header['message_size'] == wanted['message_size']:
                raise CannotPlay(f'it cuts messages at {header["payload_size"]} bytes, the vector '
                                 f'at {wanted["payload_size"]}')

    def is_tolerated(self, event):
        """What vectors/README.md leaves to a client: copies at other times, questions after streams
        and fragments; and binds and pings of its own, which are answered."""
        if len(event.data) < HEADER_SIZE:
            return False
        header = header_of(event.data)
        kind = kind_of(event.data)
        if self.role == 'server':
            return kind == 'REPLY' and header['call_id'] in {
                self.compare.bindings.number(call) for call in self.unfinished}
        if kind == 'CALL' and header['service'] == 0 and not any(
                is_copy(event.data, earlier.data, self.medium) for earlier in self.sent):
            return self.serve_session(event, header)
        if kind in ('ACK', 'CREDIT') and header['flags'] & ACK_WANTED:
            return True
        if kind == 'CREDIT' and not any(event.data[HEADER_SIZE + 8:]):
            return True  # When it is sent without a gap is a SHOULD (hp-5.10-4).
        for earlier in self.sent:
            if is_copy(event.data, earlier.data, self.medium):
                answered = self.answered.get((kind != 'HELLO', header['call_id']))
                return answered is None or event.at - answered < CROSSING_S
        return False

    def serve_session(self, event, header):
        """Answers a bind or a ping that the client makes by itself."""
        if header['method'] not in (CONSTANTS['method_bind'], CONSTANTS['method_ping']):
            return False
        payload = b''
        if is_bind(header):
            fingerprint = number(event.data[HEADER_SIZE:HEADER_SIZE + 8])
            payload = encode_payload('bind reply', service=1, flags=2, fingerprint=fingerprint)
        about = {name: header[name] for name in ('session', 'call_id', 'service', 'method',
                                                 'priority', 'trace_id')}
        self.peer.wire.send(encode('REPLY', payload, sender_time_ns=time.monotonic_ns(), **about))
        self.sent.append(event)
        self.answered[True, header['call_id']] = time.monotonic()
        return True

    def take_line(self, event, pending):
        words = event.words
        if len(words) < 2 or words[0] != 'sees':
            raise SubjectError(f'unknown line: {event.text}')
        if words[1] == 'broken' and any(step.get('client_sees') == 'broken' for _, step in pending):
            return  # That it ends the connection is what counts.
        for entry in pending:
            objection = self.line_objection(entry[1], words, event.values)
            if objection is None and words[1] == 'run':
                self.runs[self.compare.bindings.number(entry[1]['call_id'])] = event.at
            if objection is None:
                pending.remove(entry)
                return
        if words[1] == 'broken' and self.is_hung_up:
            return
        if pending and self.compare.is_binding:
            self.look_further(event, *pending[0])
        sees = [tell_step(step) for _, step in pending if f'{self.role}_sees' in step]
        raise Failure(f'it says `{event.text}`; expected: {", or ".join(sees) or "nothing more"}',
                      self.line_rules(words, pending))

    def look_further(self, event, index, step):
        """vectors/README.md: a client with bindings need not compare texts, and may wait with a
        handshake until a call needs it. Raises GoOn if it does so."""
        sees = next((i for i in range(index, len(self.steps)) if 'client_sees' in self.steps[i]), 0)
        if 'frame' not in step or self.steps[sees].get('client_sees') != event.words[1]:
            return
        first = header_of(self.compare.fill(step['hex']))
        if event.words[1] == 'not_bound' and first['method'] == CONSTANTS['method_describe']:
            go_on = sees
        elif event.words[1] == 'bound' and first['kind'] == CONSTANTS['kinds']['HELLO']:
            handshake = self.steps[index:sees]
            self.steps[index:sees + 2] = self.steps[sees:sees + 2] + handshake
            go_on = index
        else:
            return
        self.peer.events.appendleft(event)
        raise GoOn(go_on)

    def line_rules(self, words, pending):
        if words[1] == 'run' and self.role == 'server':
            return ['hp-5.2-1', *self.conversation['rules']]
        return self.conversation['rules']

    def line_objection(self, step, words, values):
        """Why this line is not what the step says; nothing if it is. Learns the names of calls."""
        what = step.get(f'{self.role}_sees')
        if what != words[1]:
            return 'another event'
        word = words[2] if len(words) > 2 else None
        if what == 'run':
            call = self.compare.bindings.number(step['call_id'])
            service = step['service'] if step['service'] != 1 else self.compare.service
            wanted = dict(service=service, method=step['method'], payload=step['payload'])
            for name, value in wanted.items():
                if name in values and values[name] != str(value):
                    return f'another {name}'
            if 'payload' not in values:
                raise SubjectError('its line `sees run` has no payload')
            self.words[call] = word
            return None
        if 'call_id' in step:
            key = step['call_id'] if self.role == 'client' else \
                self.compare.bindings.number(step['call_id'])
            if word is not None and self.words.get(key) != word:
                return 'another call'
        for name in ('status', 'payload'):
            if name in step and not (name == 'payload' and step.get('status', 'ok') != 'ok'):
                if values.get(name, '') != str(step[name]):
                    return f'another {name}'
        return None
