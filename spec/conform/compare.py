"""Whether a frame of the program under test is the one that a vector says, field by field."""

import collections

from layout import (ACK_WANTED, CONSTANTS, HEADER_SIZE, KIND_NAMES, REPEATED, STATUS_NAMES, Pattern,
                    fields_of, header_of, is_bind, kind_of, number)
from steps import bands_of

MIB = 1 << 20
FRAGMENT_WINDOW = CONSTANTS['limits']['fragment_window']
BUDGET_SLACK_US = 500_000  # A busy machine may take so long from an order to the frame.

# What a wrong field breaks, by kind of frame and by field. What is not here breaks the rules that
# the conversation is about.
RULES = {
    'magic': 'hp-2-1', 'version': 'hp-2-1', 'kind': 'hp-2-1', 'reserved': 'hp-2-2',
    'payload_size': 'hp-2-3', 'fragment_index': 'hp-5.6-1', 'fragment_count': 'hp-5.6-1',
    'message_size': 'hp-2-4', 'version_min': 'hp-4.1', 'version_max': 'hp-4.1',
    'client_epoch': 'hp-4.1-1', 'message_size_max': 'hp-4.1-2', 'cookie': 'hp-4.2-3',
    'window': 'hp-4.3-1', 'server_epoch': 'hp-4.3-1', 'band_low': 'hp-4.3-1',
    'band_high': 'hp-4.3-1', 'ceiling': 'hp-4.3-1', 'first_missing': 'hp-5.6-4',
    'later': 'hp-5.6-4',
    ('HELLO', 'call_id'): 'hp-4-2', ('CALL', 'flags'): 'hp-5.6-3', ('COOKIE', 'call_id'): 'hp-4-2',
    ('WELCOME', 'call_id'): 'hp-4-2', ('COOKIE', 'priority'): 'hp-4-2',
    ('WELCOME', 'priority'): 'hp-4-2', ('REFUSE', 'payload'): 'hp-4.4-2',
    ('REFUSE', 'call_id'): 'hp-4.4', ('REFUSE', 'session'): 'hp-4.4',
    ('REFUSE', 'status'): 'hp-4.4', ('CALL', 'call_id'): 'hp-5.1-1',
    ('CALL', 'budget_us'): 'hp-5.4-1', ('CALL', 'priority'): 'hp-5.3-2',
    ('REPLY', 'payload'): 'hp-5.2-1', ('REPLY', 'flags'): 'hp-5.2-1',
    ('REPLY', 'budget_us'): 'hp-5.7-1', ('REPLY', 'item'): 'hp-5.10-6',
    ('REPLY', 'status'): 'hp-5.1-5', ('CLOSE', 'payload'): 'hp-4.5-3',
    ('CANCEL', 'payload'): 'hp-5.9-1', ('ITEM', 'item'): 'hp-5.10-1',
    ('ITEM', 'sender_time_ns'): 'hp-5.10-1', ('REPLY', 'sender_time_ns'): 'hp-5.2-1',
    ('CREDIT', 'item'): 'hp-5.10-4', ('CREDIT', 'first_missing'): 'hp-5.10-4',
    ('CREDIT', 'later'): 'hp-5.10-4', ('CREDIT', 'byte_limit'): 'hp-5.10-9',
    ('CREDIT', 'budget_us'): 'hp-5.10-7',
    ('ACK', 'item'): 'hp-5.10-5', ('bind reply', 'reserved'): 'hp-6.1-5',
}
for _kind, _rule in (('REPLY', 'hp-5.1-2'), ('ITEM', 'hp-5.10-1'), ('ACK', 'hp-5.6'),
                     ('CANCEL', 'hp-5.9')):
    for _field in ('session', 'call_id', 'service', 'method', 'priority', 'trace_id'):
        RULES.setdefault((_kind, _field), _rule)

Difference = collections.namedtuple('Difference', 'field offset size expected received rule why')


def rule_of(kind, field):
    return RULES.get((kind, field)) or RULES.get(field) or 'hp-2'


def show(field, data):
    """A field's bytes as its reader would write them."""
    if field in ('kind', 'status'):
        names = KIND_NAMES if field == 'kind' else STATUS_NAMES
        return names.get(number(data), str(number(data)))
    if len(data) > 8 or field in ('magic', 'reserved', 'later', 'payload'):
        return (data.hex(' ') if len(data) <= 24 else f'{data[:24].hex(" ")} …') or 'nothing'
    if field in ('session', 'trace_id', 'client_epoch', 'server_epoch', 'clock_domain'):
        return f'{number(data):#x}'
    return str(number(data))


class Bindings:
    """The bytes that a side is free to choose: learned where the program under test chooses them,
    the vector's example where the other side does."""

    def __init__(self, free, role):
        self.known = {name: bytes.fromhex(choice['example']) for name, choice in free.items()
                      if choice['chosen_by'] != role}
        self.other = {}  # What has no `<name>`, as epochs and times; by field and vector's value.

    def objection(self, name, value):
        """Why `name` can't be `value`, or nothing. README.md of the vectors: names that differ in
        their number only are different choices; calls and handshakes are numbered upward."""
        if name in self.known:
            return None if self.known[name] == value else 'is not what it was before'
        stem = name.rstrip('0123456789')
        for other, known in self.known.items():
            if other.rstrip('0123456789') != stem or stem == 'cookie':
                continue
            if known == value:
                return f'is the same as <{other}>'
            if stem in ('call', 'handshake') and is_before(number(value), number(known)):
                return f'is not later than <{other}>'
        return None

    def number(self, value):
        """A call_id of a step: itself, or that of `<name>`."""
        if isinstance(value, int):
            return value
        return number(self.known.get(value.strip('<>'), b''))


class Comparer:
    """Compares frames of the program under test with those of one conversation."""

    def __init__(self, conversation, role):
        self.role = role
        self.free = conversation['free']
        self.bindings = Bindings(self.free, role)
        self.setup = conversation['setup']
        self.is_binding = conversation.get('level') == 'bindings'
        self.service = 1  # What stands for service 1 of the vectors at the server under test.
        self.budgets = {}  # The last one that the program under test stated, by kind and call.
        self.run_counter = None  # Of a server that answers with how often it has run.
        self.bytes_first = CONSTANTS['limits'][f'stream_bytes_first_{conversation["medium"]}']
        self.byte_limits = {}  # What a client granted last, by call.
        self.windows = {}  # How many items a client takes at a time, by call.
        self.asked_at = {}  # When a call was first sent to the server under test.
        self.ran_us = {}  # How long its method ran at least, by call: the tool ended it.

    def pattern(self, hex_text):
        return Pattern(hex_text, self.free)

    def fill(self, hex_text):
        """A frame of the vector for the program under test, with the vector's times."""
        frame = bytearray(self.pattern(hex_text).fill(self.bindings.known))
        if self.role == 'server' and len(frame) >= HEADER_SIZE and number(frame[20:24]) == 1:
            frame[20:24] = self.service.to_bytes(4, 'little')
        return bytes(frame)

    def differences(self, hex_text, frame, now):
        """What is wrong with `frame`; learns what it chose if nothing is."""
        pattern = self.pattern(hex_text)
        wanted = pattern.fill(self.bindings.known)
        if len(frame) < HEADER_SIZE:
            return [Difference('header', 0, HEADER_SIZE, f'{HEADER_SIZE} bytes',
                               f'{len(frame)} bytes', 'hp-2-1', '')]
        kind = kind_of(wanted)
        if frame[3] != wanted[3]:
            return [Difference('kind', 3, 1, kind, kind_of(frame), 'hp-2-1', '')]
        found, learned, noted = [], {}, {}
        is_service_answer = kind == 'REPLY' and is_bind(header_of(wanted)) and \
            wanted[26:28] == b'\0\0'
        is_count = self.run_counter is not None and kind == 'REPLY' and not is_service_answer and \
            wanted[24:28] == b'\2\0\0\0' and number(wanted[20:24]) == 1
        for field, offset, size in fields_of(wanted):
            data = frame[offset:offset + size]
            if field == 'methods' or (field in ('payload_size', 'message_size') and
                                      (is_service_answer or is_count)):
                continue
            if is_count and offset >= HEADER_SIZE:
                continue
            if offset >= HEADER_SIZE and field == 'payload':
                data = frame[offset:]
            name = pattern.name_at(offset)
            if name:
                why = learned.get(name, data) != data and 'differs within the frame'
                why = why or self.bindings.objection(name, data)
                learned[name] = data
                expected = f'<{name}>'
                if name in self.bindings.known:
                    expected = show(field, self.bindings.known[name])
            else:
                expected = show(field, wanted[offset:offset + size])
                why = self.objection(kind, (field, offset, size), wanted, frame, noted, now)
            if why:
                found.append(Difference(field, offset, size, expected, show(field, data),
                                        rule_of(kind, field), '' if why is True else why))
        if is_service_answer:
            found += self.bind_reply_faults(frame)
        elif is_count:
            found += self.count_faults(frame) if not found else []
        elif not found and len(frame) != len(wanted):
            found.append(Difference('payload', HEADER_SIZE, len(frame) - HEADER_SIZE,
                                    f'{len(wanted) - HEADER_SIZE} bytes',
                                    f'{len(frame) - HEADER_SIZE} bytes', 'hp-2-3', ''))
        if not found:
            self.bindings.known.update(learned)
            self.bindings.other.update(noted)
            self.note(kind, frame)
        return found

    def count_faults(self, frame):
        key = frame[8:16], frame[16:20]
        why = self.run_counter.objection(key, frame[HEADER_SIZE:])
        return [Difference('payload', HEADER_SIZE, len(frame) - HEADER_SIZE, 'the count of runs',
                           frame[HEADER_SIZE:][:24].hex(' '), 'hp-5.2-1', why)] if why else []

    def note(self, kind, frame):
        header = header_of(frame)
        if kind == 'CALL':
            self.windows[header['call_id']] = header['item']
        if kind in ('CALL', 'CREDIT'):
            self.budgets[kind, header['call_id'], header['fragment_index']] = header['budget_us']
        if kind == 'CREDIT':
            self.byte_limits[header['call_id']] = number(frame[HEADER_SIZE + 4:HEADER_SIZE + 8])

    def objection(self, kind, place, wanted, frame, noted, now):
        """Why this field may not have this value; True: because it is another than the vector's."""
        field, offset, size = place
        want, have = wanted[offset:offset + size], frame[offset:offset + size]
        if offset >= HEADER_SIZE:
            check = self.PAYLOAD_CHECKS.get((kind, field)) or self.PAYLOAD_CHECKS.get(field)
        else:
            check = self.HEADER_CHECKS.get((kind, field)) or self.HEADER_CHECKS.get(field)
        if check:
            return check(self, field, want, have, frame, noted, now)
        if offset >= HEADER_SIZE and field == 'payload':
            have = frame[offset:]
        return want != have

    # ---- fields that the vector does not decide alone ----

    def any_value(self, field, want, have, frame, noted, now):
        return None

    def service_number(self, field, want, have, frame, noted, now):
        expected = number(want)
        if self.role == 'server' and expected == 1:
            expected = self.service
        return number(have) != expected

    def hello_flags(self, field, want, have, frame, noted, now):
        return number(have) & ~REPEATED != 0 and 'has other flags than repeated'

    def asking_flags(self, field, want, have, frame, noted, now):
        """That a client asks for an answer where it need not does no harm."""
        return number(want) & ~ACK_WANTED != number(have) & ~ACK_WANTED

    def fragment_flags(self, field, want, have, frame, noted, now):
        """That fragments ask at each half of the window is a SHOULD (hp-5.6-3)."""
        header = header_of(frame)
        if header['fragment_count'] == 1 or (number(want) ^ number(have)) & ~ACK_WANTED:
            return want != have
        is_half = header['fragment_index'] % FRAGMENT_WINDOW == FRAGMENT_WINDOW // 2 - 1
        return number(want) & ~number(have) != 0 and not is_half

    def close_priority(self, field, want, have, frame, noted, now):
        if self.role == 'client':
            return want != have
        return not any(low <= number(have) <= high for low, high in
                       bands_of(self.setup['server'])) and 'is outside the band'

    def call_budget(self, field, want, have, frame, noted, now):
        header = header_of(frame)
        before = self.budgets.get((kind_of(frame), header['call_id'], header['fragment_index']))
        if self.is_binding:
            return not number(have) and 'is 0'
        if header['flags'] & REPEATED and before is not None:
            return not 0 < number(have) <= before and f'was {before} before'
        if number(have) > number(want):
            return 'is more than was left'
        if number(have) < number(want) - BUDGET_SLACK_US or (number(want) and not number(have)):
            return 'is much less than was left'
        return None

    def credit_limit(self, field, want, have, frame, noted, now):
        """A client that sends CREDIT before it took all items that are there grants less, for now:
        at most half of its window (hp-5.10-4)."""
        window = self.windows.get(header_of(frame)['call_id'], 0)
        return not number(want) - window // 2 <= number(have) <= number(want)

    def credit_bytes(self, field, want, have, frame, noted, now):
        """A client may grant more than the vector, and as little as its next CREDIT would add less
        (hp-5.10-4), but takes nothing back (hp-5.10-9)."""
        if self.role != 'client':
            return want != have
        before = self.byte_limits.get(header_of(frame)['call_id'], self.bytes_first)
        if is_before(number(have), before):
            return f'was {before} before'
        return is_before(number(have), (number(want) - self.bytes_first // 2) % 2**32)

    def reply_budget(self, field, want, have, frame, noted, now):
        asked = self.asked_at.get(header_of(frame)['call_id'])
        if asked is not None and number(have) > (now - asked) * 1e6 + 1:
            return f'is more than the {int((now - asked) * 1e6)} µs between request and reply'
        ran_us = self.ran_us.get(header_of(frame)['call_id'], 0)
        if number(have) < ran_us:
            return f'is less than the {ran_us} µs that the method ran'
        return None

    def time(self, field, want, have, frame, noted, now):
        """Where the vector says that a time is that of an earlier frame, it has to be."""
        key = (kind_of(frame), header_of(frame)['call_id'], header_of(frame)['item'], want)
        before = self.bindings.other.get(key)
        if before is not None and frame[3] in (6, 10) and number(frame[6:8]) & REPEATED:
            return before != have and 'is not that of the frame which this repeats'
        noted[key] = have
        return None

    def chosen_number(self, field, want, have, frame, noted, now):
        """An epoch or a channel: free, not 0 for an epoch, and kept as long as the vector's is."""
        if field == 'channel' and self.is_binding:
            return None  # It may have several.
        if field != 'channel' and number(have) == 0:
            return 'is 0'
        key = (field, want)
        noted[key] = have
        before = self.bindings.other.get(key, have)
        if before != have:
            return 'is not what it was before'
        if field == 'server_epoch' and any(
                len(other) == 2 and other[0] == field and other[1] != want and value == have
                for other, value in self.bindings.other.items()):
            return 'is that of another life'
        return None

    def version_range(self, field, want, have, frame, noted, now):
        is_min = field == 'version_min'
        return (number(have) > 1) if is_min else (number(have) < 1)

    def client_limit(self, field, want, have, frame, noted, now):
        if number(want) == 1344:
            return not 1024 <= number(have) <= 16 * MIB
        return want != have

    def server_limit(self, field, want, have, frame, noted, now):
        """A server that is not set up has the limit that it has, if the conversation fits."""
        if self.run_counter is not None:
            return not number(want) <= number(have) <= 16 * MIB
        return want != have

    def window(self, field, want, have, frame, noted, now):
        return number(have) == 0

    def bound_service(self, field, want, have, frame, noted, now):
        if self.role == 'client':
            return want != have
        return number(have) != self.service

    def bind_flags(self, field, want, have, frame, noted, now):
        return number(have) > 3 and 'has a reserved bit set'

    def bind_reply_faults(self, frame):
        """hp-6.1: the methods are as many as method_count says, and their reserved bytes are 0."""
        payload = frame[HEADER_SIZE:]
        if len(payload) < 24:
            return [Difference('payload', HEADER_SIZE, len(payload), '24 bytes or more',
                               f'{len(payload)} bytes', 'hp-6.1', '')]
        count = number(payload[16:18])
        if len(payload) != 24 + 8 * count:
            return [Difference('method_count', HEADER_SIZE + 16, 2, f'{(len(payload) - 24) / 8:g}',
                               str(count), 'hp-6.1', 'is not as many as follow')]
        entries = [payload[24 + 8 * i:32 + 8 * i] for i in range(count)]
        return [Difference('methods', HEADER_SIZE + 26 + 8 * i, 2, '0', str(number(entry[2:4])),
                           'hp-6.1-5', '')
                for i, entry in enumerate(entries) if entry[2:4] != b'\0\0']

    HEADER_CHECKS = {
        'service': service_number, ('HELLO', 'flags'): hello_flags, 'sender_time_ns': time,
        ('CALL', 'flags'): fragment_flags, ('REPLY', 'flags'): fragment_flags,
        ('CREDIT', 'flags'): asking_flags, ('ACK', 'flags'): asking_flags,
        ('CLOSE', 'priority'): close_priority, ('CALL', 'budget_us'): call_budget,
        ('CREDIT', 'item'): credit_limit, ('CREDIT', 'budget_us'): call_budget,
        ('REPLY', 'budget_us'): reply_budget,
    }
    PAYLOAD_CHECKS = {
        'client_epoch': chosen_number, 'server_epoch': chosen_number, 'channel': chosen_number,
        'clock_domain': any_value, ('HELLO', 'features'): any_value,
        'version_min': version_range, 'version_max': version_range,
        ('HELLO', 'message_size_max'): client_limit, ('WELCOME', 'message_size_max'): server_limit,
        'window': window, ('CREDIT', 'byte_limit'): credit_bytes,
        ('REPLY', 'service'): bound_service, ('REPLY', 'priority'): any_value,
        ('REPLY', 'flags'): bind_flags, ('REPLY', 'fingerprint'): any_value,
        ('REPLY', 'method_count'): any_value,
    }


def is_before(one, other):
    """Of two numbers that begin again at 0 after 2³²−1."""
    return (one - other) % 2**32 >= 2**31


def is_copy(frame, earlier, medium):
    """Whether `frame` is what hp-5.3-2 calls a copy of `earlier`."""
    if len(frame) != len(earlier) or len(frame) < HEADER_SIZE:
        return False
    if medium == 'stream' or not number(frame[6:8]) & REPEATED:
        return False
    return strip_copy(frame) == strip_copy(earlier)


def strip_copy(frame):
    """A frame without what differs in a copy of it: flags that a repetition sets, what is left of
    the budget, the time, and of a HELLO the cookie."""
    stripped = bytearray(frame)
    flags = number(frame[6:8]) & ~(REPEATED | ACK_WANTED)
    stripped[6:8] = flags.to_bytes(2, 'little')
    stripped[40:44] = bytes(4)
    stripped[48:56] = bytes(8)
    if kind_of(frame) == 'HELLO' and len(frame) == 128:
        stripped[104:120] = bytes(16)
    return bytes(stripped)
