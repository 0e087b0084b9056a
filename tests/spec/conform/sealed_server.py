#!/usr/bin/env python3
"""A server of sealed sessions over UDP with faults to be found, for spec/conform.

sealed_server.py KEY ADMITTED... [--keeps-half-open] [--tells-all-keys] [--admits-all]
    KEY: its private key, ADMITTED: public keys, all in Base64. Prints its address; ends with stdin.
"""

import base64
import os
import pathlib
import select
import socket
import sys
import time

SPEC = pathlib.Path(__file__).resolve().parents[3] / 'spec'
sys.path[:0] = [str(SPEC / 'conform'), str(SPEC / 'vectors' / 'generator')]

import noise  # noqa: E402
from layout import encode, encode_payload, header_of, kind_of  # noqa: E402

SEALED = 1 << 4
HALF_OPEN_S = 2.0


class Session:
    def __init__(self, handshake, suite, client, peer):
        theirs, ours = handshake.keys()
        self.client, self.peer, self.opened = client, peer, time.monotonic()
        self.is_confirmed = False
        self.receiver, self.sender = noise.Receiver(suite, theirs), noise.Sender(suite, ours)


class Server:
    def __init__(self, private, admitted, faults):
        self.private, self.admitted, self.faults = private, admitted, faults
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(('127.0.0.1', 0))
        self.cookie = os.urandom(16)
        self.sessions, self.welcomes, self.replies = {}, {}, {}
        self.run_count = 0

    def give_cookie(self, header):
        payload = self.cookie + noise.public_of(self.private) + (3).to_bytes(4, 'little') + bytes(4)
        return encode('COOKIE', payload, priority=header['priority'], call_id=header['call_id'])

    def find(self, number):
        session = self.sessions.get(number)
        is_old = session and time.monotonic() - session.opened > HALF_OPEN_S
        if is_old and not session.is_confirmed and '--keeps-half-open' not in self.faults:
            session = self.sessions.pop(number) and None
        return session

    def on_hello(self, frame, peer):
        header = header_of(frame)
        if len(frame) != 64 + 168:
            return self.give_cookie(header)
        if frame in self.welcomes:
            return self.welcomes[frame]
        suite = frame[68] >> 1 & 1
        prologue = (b'H-Protocol 1.0 S' + frame[4:6] + frame[16:20] + frame[64:128] +
                    self.give_cookie(header)[64:])
        handshake = noise.Server(suite, self.private, prologue)
        client, former = handshake.read_message_1(frame[128:])
        if client not in self.admitted and '--admits-all' not in self.faults:
            return encode('REFUSE', priority=header['priority'], call_id=header['call_id'],
                          status=19)
        number = int.from_bytes(former, 'little')
        known = self.find(number)
        goes_on = known and (known.client == client or '--tells-all-keys' in self.faults)
        if not goes_on:
            became, number = (2 if number else 0), int.from_bytes(os.urandom(6), 'little') | 1
        else:
            became = 1
        welcome = encode_payload('WELCOME', version=1, band_high=32767, ceiling=32767, window=8,
                                 features=frame[68], server_epoch=7, message_size_max=1320)
        inside = number.to_bytes(8, 'little') + welcome + bytes([became]) + bytes(7)
        message = handshake.message_2(noise.new_key(), inside)
        if not goes_on:
            self.sessions[number] = Session(handshake, suite, client, peer)
        self.welcomes[frame] = encode('WELCOME', message, priority=header['priority'],
                                      call_id=header['call_id'], session=number)
        return self.welcomes[frame]

    def on_call(self, frame, peer):
        header = header_of(frame)
        session = self.find(header['session'])
        about = {name: header[name] for name in ('session', 'call_id', 'priority')}
        if session is None or session.peer != peer:
            return encode('REFUSE', status=12, **about)
        session.receiver.open(frame)
        session.is_confirmed = True
        key = header['session'], header['call_id']
        if key not in self.replies:
            payload = b''
            if header['service'] == 0 and header['method'] == 1:
                payload = encode_payload('bind reply', service=1, flags=2)
            elif header['service'] == 1:
                self.run_count += 1
                payload = self.run_count.to_bytes(8, 'little')
            self.replies[key] = payload
        reply = encode('REPLY', self.replies[key], service=header['service'],
                       method=header['method'], flags=SEALED, **about)
        return session.sender.seal(reply[:64], self.replies[key])

    def answer(self, frame, peer):
        kinds = {'HELLO': self.on_hello, 'CALL': self.on_call}
        try:
            return kinds[kind_of(frame)](frame, peer) if kind_of(frame) in kinds else None
        except noise.Refused:
            return None

    def serve(self):
        while True:
            ready, _, _ = select.select([self.socket, sys.stdin], [], [])
            if sys.stdin in ready and not os.read(0, 1):
                return
            if self.socket in ready:
                frame, peer = self.socket.recvfrom(2048)
                answer = self.answer(frame, peer)
                if answer:
                    self.socket.sendto(answer, peer)


def main(arguments):
    faults = {word for word in arguments if word.startswith('--')}
    keys = [base64.b64decode(word) for word in arguments if word not in faults]
    server = Server(keys[0], keys[1:], faults)
    print('%s:%d' % server.socket.getsockname(), flush=True)
    server.serve()


if __name__ == '__main__':
    main(sys.argv[1:])
