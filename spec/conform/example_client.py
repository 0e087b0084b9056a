#!/usr/bin/env python3
"""A client of level 0, calls over TCP, that rtpm-conform can tell what to do. It knows the protocol
from the page alone, and is short rather than useful: an example of the lines of README.md.

    rtpm-conform client --level 0 --only bind-and-call-tcp -- python3 example_client.py
"""

import os
import secrets
import selectors
import socket
import struct
import sys
import time

HEADER = struct.Struct('<2sBBHHQIIHHIHHIIIQQ')  # Section 2.
HELLO, WELCOME, REFUSE, CALL, REPLY, CLOSE = 1, 3, 4, 5, 6, 7
STATUSES = ('ok overload expired no_such_method no_such_object bad_request not_lease_holder gone '
            'servant_failed too_large priority_not_allowed wrong_band unknown_session '
            'version_unsupported bad_limits wrong_interface cancelled stopping lost '
            'not_allowed').split()
EPOCH = secrets.randbits(64) | 1


def say(line):
    print(line, flush=True)


def status_name(number):
    return STATUSES[number] if number < len(STATUSES) else 'unknown'


class Client:
    def __init__(self, setup):
        host, _, port = setup['address'].rpartition(':')
        self.server = (host, int(port))
        self.limit = int(setup['message_size_max'])
        self.connection = None
        self.received = b''
        self.session = self.server_limit = self.priority = 0
        self.handshake = secrets.randbits(32)
        self.is_opening = False
        self.call_id = 0
        self.calls = {}  # By number: the tool's word, service, method, deadline.
        self.open_until = None

    def send(self, kind, payload=b'', call_id=0, session=0, service=0, method=0, budget_us=0,
             trace_id=0, priority=None):
        priority = self.priority if priority is None else priority
        self.connection.sendall(HEADER.pack(
            b'HP', 1, kind, priority, 0, session, call_id, service, method, 0, len(payload), 0, 1,
            len(payload), budget_us, 0, time.monotonic_ns(), trace_id) + payload)

    # ---- orders ----

    def open(self, values):
        if self.connection is None:
            self.connection = socket.create_connection(self.server, 5)
            self.connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.priority = int(values['priority'])
        self.handshake = (self.handshake + 1) % 2**32
        self.is_opening = True
        self.open_until = time.monotonic() + int(values['timeout_us']) / 1e6
        self.send(HELLO, struct.pack('<HHIQQQII16sQ', 1, 1, 0, EPOCH, 1, 0, self.limit, 0,
                                     bytes(16), 0), call_id=self.handshake)

    def call(self, word, values):
        payload = bytes.fromhex(values['payload'])
        if int(values['window']) or values['delivery'] != 'reply' or len(payload) > 65472:
            return say('cannot do more than level 0')
        if len(payload) > self.server_limit:
            return say(f'sees too_large {word}')
        self.call_id += 1
        service, method, timeout_us = (int(values[name]) for name in ('service', 'method',
                                                                      'timeout_us'))
        self.calls[self.call_id] = (word, service, method, time.monotonic() + timeout_us / 1e6)
        return self.send(CALL, payload, self.call_id, self.session, service, method, timeout_us,
                         int(values['trace_id'], 0), int(values['priority']))

    def take_order(self, line):
        words = [part for part in line.split() if '=' not in part]
        values = dict(part.split('=', 1) for part in line.split() if '=' in part)
        if words[:1] == ['counters']:
            say('counters unknown')
        elif words[:2] == ['does', 'open']:
            self.open(values)
        elif words[:2] == ['does', 'call']:
            self.call(words[2], values)
        elif words[:2] == ['does', 'close']:
            self.send(CLOSE, session=self.session)
        else:
            say('cannot ' + ' '.join(words[:2]))

    # ---- frames ----

    def is_good(self, header, kind):
        """The checks of section 2, and that nothing is in fragments."""
        magic, version, _, priority, flags, *_ = header
        size, index, count, message_size, item = (header[i] for i in (10, 11, 12, 13, 15))
        return magic == b'HP' and version == 1 and 1 <= kind <= 11 and \
            priority <= 32767 and flags & ~3 == 0 and size <= 65472 and \
            (item == 0 or kind in (5, 6, 8, 10, 11)) and \
            (index, count, message_size) == (0, 1, size)

    def read(self):
        data = self.connection.recv(65536)
        self.received += data
        while len(self.received) >= 64:
            header = HEADER.unpack_from(self.received)
            if not self.is_good(header, header[2]):
                say('sees broken')
                data = b''
                break
            end = 64 + header[10]
            if len(self.received) < end:
                break
            payload, self.received = self.received[64:end], self.received[end:]
            self.take_frame(header, payload)
        if not data:
            self.connection.close()
            self.connection, self.received, self.session = None, b'', 0

    def take_frame(self, header, payload):
        kind, session, call_id, service, method, status = (header[i] for i in (2, 5, 6, 7, 8, 9))
        if self.is_opening and call_id == self.handshake and kind in (WELCOME, REFUSE):
            if kind == REFUSE and status and not payload:
                self.is_opening = False
                say(f'sees refused status={status_name(status)}')
            elif kind == WELCOME and self.is_welcome(session, payload):
                self.is_opening = False
                self.session = session
                say('sees ready')
        elif kind in (REPLY, REFUSE) and session == self.session and call_id in self.calls:
            word, *place, _ = self.calls[call_id]
            if kind == REPLY and place != [service, method]:
                return
            if kind == REFUSE and (payload or status == 0):
                return
            del self.calls[call_id]
            if kind == REFUSE and status == STATUSES.index('unknown_session'):
                say('sees lost')
            else:
                say(f'sees result {word} status={status_name(status)} payload={payload.hex()}')
        elif kind == CLOSE and session == self.session and session and not payload:
            self.session, self.calls = 0, {}
            say('sees closed')

    def is_welcome(self, session, payload):
        """4.3-1."""
        if len(payload) != 48:
            return False
        version, low, high, ceiling, features, window, reserved, epoch, _, limit, rest = \
            struct.unpack('<HHHHIHHQQI12s', payload)
        self.server_limit = limit
        return version == 1 and low <= self.priority <= high <= 32767 and ceiling <= 32767 and \
            features == 0 and reserved == 0 and not any(rest) and 1024 <= limit <= 1 << 24 and \
            0 not in (session, window, epoch) and window & (window - 1) == 0

    # ---- time ----

    def next_time(self):
        times = [until for *_, until in self.calls.values()]
        return min(times + [self.open_until] * self.is_opening, default=None)

    def look_at_the_time(self):
        now = time.monotonic()
        if self.is_opening and self.open_until <= now:
            self.is_opening = False
            say('sees timeout')
        for call_id, (word, *_, until) in list(self.calls.items()):
            if until <= now:
                del self.calls[call_id]
                say(f'sees timeout {word}')


def main():
    client, rest = None, b''
    while True:
        selector = selectors.DefaultSelector()
        selector.register(sys.stdin, selectors.EVENT_READ)
        if client and client.connection:
            selector.register(client.connection, selectors.EVENT_READ)
        until = client.next_time() if client else None
        ready = selector.select(None if until is None else max(until - time.monotonic(), 0))
        selector.close()
        files = [key.fileobj for key, _ in ready]
        if client and client.connection in files:
            client.read()
        if client:
            client.look_at_the_time()
        if sys.stdin not in files:
            continue
        data = os.read(0, 65536)
        *lines, rest = (rest + data).split(b'\n')
        for line in map(bytes.decode, lines):
            if line.startswith('setup'):
                client = Client(dict(part.split('=', 1) for part in line.split()[1:]))
                say('ready' if 'medium=stream' in line else 'cannot use UDP')
            elif line == 'quit':
                return
            else:
                client.take_order(line)
        if not data:
            return


if __name__ == '__main__':
    main()
