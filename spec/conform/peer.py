"""The program under test together with the sockets to it."""

import collections
import time

import black_box
from subject import GONE, CannotPlay, Subject, SubjectError, Wire, parse_line, wait_readable

START_S = 60.0  # So long a program may take to start, several at a time on a busy machine.


class Failure(Exception):
    """The program under test did something else than the vector says."""

    def __init__(self, text, rules, differences=(), frames=()):
        super().__init__(text)
        self.rules = list(dict.fromkeys(rules))
        self.differences = list(differences)
        self.frames = list(frames)  # Pairs of a title and bytes.
        self.step = None


Frame = collections.namedtuple('Frame', 'data end at')
Line = collections.namedtuple('Line', 'words values text at')
End = collections.namedtuple('End', 'at')


class Peer:
    """The program under test and the sockets to it; what comes from either, in order."""

    def __init__(self, role, medium, options):
        self.role, self.medium, self.options = role, medium, options
        self.patience_s = options.patience
        self.subject = None
        self.wire = None
        self.events = collections.deque()
        self.counted = collections.Counter()  # Drops that the program has to have counted.
        self.has_counters = True
        self.notes = []
        self.service = 1
        self.address = None

    def start(self, setup):
        """Starts the program under test. Its answer to `setup` is `ready` or `cannot`."""
        if self.wire is None:
            self.wire = Wire(self.role, self.medium, self.options.listen)
        if not self.options.command:
            self.address = self.options.address
            self.wire.aim(self.address)
            self.service = black_box.find_service(self)
            self.has_counters = False
            self.notes.append('dropped frames are not checked: counters need a COMMAND')
            return
        self.subject = Subject(self.options.command)
        if self.role == 'client':
            host, port = self.wire.address
        else:
            host, port = self.address or self.options.address or ('127.0.0.1', 0)
        self.subject.tell('setup', role=self.role, medium=self.medium, address=f'{host}:{port}',
                          **setup)
        line = self.answer('ready', START_S)
        if 'address' in line.values:
            self.address = address_of(line.values['address'])
            if self.role == 'server':
                self.wire.aim(self.address)
            elif self.medium == 'datagram':
                self.wire.peer = self.address
        elif self.role == 'server':
            self.address = (host, port)
            self.wire.aim(self.address)
        self.service = int(line.values.get('service', 1))

    def restart(self, setup):
        self.subject.end()
        self.subject = None
        self.counted.clear()
        self.start(setup)

    def stop(self):
        if self.subject:
            self.subject.end()
        if self.wire:
            self.wire.close()

    def tell(self, *words, **values):
        if self.subject is None:
            raise CannotPlay('needs a COMMAND')
        self.subject.tell(*words, **values)

    # ---- what comes in ----

    def poll(self, until):
        """Takes up what is there, waiting for it until `until`."""
        files = self.wire.sockets() + ([self.subject] if self.subject else [])
        for ready in wait_readable(files, until):
            now = time.monotonic()
            if ready is self.subject:
                for text in self.subject.read():
                    self.take_line(text, now)
            elif ready in self.wire.sockets():
                end, frames, is_over = self.wire.receive(ready)
                self.events.extend(Frame(frame, end, now) for frame in frames)
                if is_over:
                    self.events.append(End(now))

    def take_line(self, text, now):
        if text is GONE:
            how = self.subject.describe_end()
            raise SubjectError(f'the program under test ended: {how}')
        words, values = parse_line(text)
        if words and words[0] == 'cannot':
            raise CannotPlay(f'the program under test says: {text[7:].strip() or "cannot"}')
        self.events.append(Line(words, values, text, now))

    def next_event(self, until):
        """The next event, or nothing at the time `until`."""
        while not self.events:
            self.poll(until)
            if not self.events and time.monotonic() >= until:
                return None
        return self.events.popleft()

    def answer(self, word, patience_s=None):
        """The line that begins with `word`; what else comes meanwhile keeps its order."""
        patience_s = self.patience_s if patience_s is None else patience_s
        until = time.monotonic() + patience_s
        kept = []
        try:
            while True:
                event = self.next_event(until)
                if event is None:
                    raise SubjectError(f'the program under test did not answer `{word}` within '
                                       f'{patience_s:g} s')
                if isinstance(event, Line) and event.words and event.words[0] == word:
                    return event
                kept.append(event)
        finally:
            self.events.extendleft(reversed(kept))

    # ---- counters ----

    def counters(self):
        """What the program under test has dropped, by reason; nothing if it can't tell."""
        if not self.has_counters or self.subject is None:
            return None
        self.subject.tell('counters')
        line = self.answer('counters')
        if 'unknown' in line.words:
            self.has_counters = False
            self.notes.append('dropped frames are not checked: the program has no counters')
            return None
        return collections.Counter({name: int(value) for name, value in line.values.items()
                                    if int(value)})

    def check_counters(self):
        """Waits until the program under test has counted what it has to."""
        until = time.monotonic() + self.patience_s
        while True:
            there = self.counters()
            if there is None or there == self.counted:
                return
            if there - self.counted or time.monotonic() > until:
                raise Failure('its counters of dropped frames differ: expected '
                              f'{tell_counts(self.counted)}, counted {tell_counts(there)}',
                              ['hp-8-1'])
            time.sleep(0.005)


def tell_counts(counts):
    return ', '.join(f'{count} {reason}' for reason, count in sorted(counts.items())) or 'none'


def address_of(text):
    host, _, port = text.rpartition(':')
    return host, int(port)
