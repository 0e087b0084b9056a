#!/usr/bin/env python3
"""A client that was written from spec/security.md alone, on Python's `cryptography`, talks to RTPM's
server of sealed sessions over UDP: to its half without transports, and to a whole one.

    interop_test.py PATH-OF-sealed_server PATH-OF-secured_server
"""

import base64
import os
import pathlib
import socket
import subprocess
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
GENERATOR = pathlib.Path(__file__).resolve().parents[3] / 'spec/vectors/generator'
sys.path.insert(0, str(GENERATOR))

try:
    import noise
except ImportError:
    print('[  SKIPPED ] needs the Debian package python3-cryptography')
    sys.exit(0)

from frames import HELLO, KINDS, frame, lay_out  # noqa: E402
from sealed import FLAG_SEALED, prologue_of  # noqa: E402

SERVER, SECURED_SERVER = sys.argv.pop(1), sys.argv.pop(1)
SECONDS_MAX = 10


def field(data, offset, size):
    return int.from_bytes(data[offset:offset + size], 'little')


class Client:
    """One channel over UDP."""

    def __init__(self, port, server_public, psk=noise.NO_PSK, private=None):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(('127.0.0.1', port))
        self.socket.settimeout(SECONDS_MAX)
        self.private = private or noise.new_key()
        self.server_public, self.psk = server_public, psk
        self.epoch = int.from_bytes(os.urandom(8), 'little') | 1
        self.number = int.from_bytes(os.urandom(3), 'little')
        self.call_id = 0

    def send(self, data):
        self.socket.send(data)

    def receive(self):
        return self.socket.recv(2048)

    def hello(self, features, cookie=bytes(16), message=b''):
        payload = bytes.fromhex(lay_out(HELLO, client_epoch=self.epoch, channel=1,
                                        message_size_max=1320, features=features,
                                        cookie=int.from_bytes(cookie, 'little'))) + message
        return bytes.fromhex(frame('HELLO', payload.hex(), priority=1000, call_id=self.number))

    def ask_for_cookie(self):
        self.send(self.hello(1))
        answer = self.receive()
        assert answer[3] == KINDS['COOKIE'] and len(answer) == 120, answer.hex()
        return answer[64:]

    def hello_with_message_1(self, suite, cookie, former=0):
        features = 1 | suite << 1
        bare = self.hello(features, cookie[:16])
        self.noise = noise.Client(suite, self.private, self.server_public, noise.new_key(),
                                  prologue_of(bare, cookie), self.psk)
        message = self.noise.message_1(former.to_bytes(8, 'little'))
        return self.hello(features, cookie[:16], message)

    def take_welcome(self, suite, welcome):
        assert welcome[3] == KINDS['WELCOME'] and len(welcome) == 176, welcome.hex()
        inside = self.noise.read_message_2(welcome[64:])
        self.session = field(inside, 0, 8)
        assert self.session == field(welcome, 8, 8) and len(inside) == 64
        self.features, self.former = field(inside, 16, 4), inside[56]
        ours, theirs = self.noise.keys()
        self.sender, self.receiver = noise.Sender(suite, ours), noise.Receiver(suite, theirs)

    def open(self, suite, former=0):
        self.number += 1
        self.send(self.hello_with_message_1(suite, self.ask_for_cookie(), former))
        self.take_welcome(suite, self.receive())

    def call_frame(self, payload, repeats=False):
        if not repeats:
            self.call_id += 1
        plain = frame('CALL', payload.hex(), priority=1000, session=self.session,
                      call_id=self.call_id, service=1, method=1, budget_us=5_000_000,
                      flags=FLAG_SEALED | repeats)
        return self.sender.seal(bytes.fromhex(plain)[:64], payload)

    def take_reply(self):
        reply = self.receive()
        assert reply[3] == KINDS['REPLY'] and field(reply, 6, 2) & FLAG_SEALED, reply.hex()
        assert field(reply, 16, 4) == self.call_id
        return self.receiver.open(reply)

    def call(self, payload):
        self.send(self.call_frame(payload))
        return self.take_reply()


class InteropTest(unittest.TestCase):
    psk = b''

    def command(self):
        return [SERVER, self.psk.hex()]

    def setUp(self):
        self.process = subprocess.Popen(self.command(), stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, text=True)
        port, suites, key = self.process.stdout.readline().split()
        self.port, self.suites, self.key = int(port), int(suites), bytes.fromhex(key)
        self.clients = []

    def tearDown(self):
        for client in self.clients:
            client.socket.close()
        self.process.stdin.close()
        self.process.stdout.close()
        self.assertEqual(self.process.wait(SECONDS_MAX), 0)

    def client(self, **options):
        self.clients.append(Client(self.port, self.key, **options))
        return self.clients[-1]

    def all_suites(self):
        return [suite for suite in (0, 1) if self.suites >> suite & 1]

    def test_both_suites_carry_calls(self):
        for suite in self.all_suites():
            with self.subTest(suite=noise.NAMES[suite]):
                client = self.client()
                client.open(suite)
                self.assertEqual(client.features, 1 | suite << 1)
                for size in (0, 1, 48, 1320):
                    payload = os.urandom(size)
                    self.assertEqual(client.call(payload), payload[::-1])

    def test_the_cookie_shows_the_key_and_the_suites(self):
        cookie = self.client().ask_for_cookie()
        self.assertEqual(cookie[16:48], self.key)
        self.assertEqual(field(cookie, 48, 4), self.suites)

    def test_a_copy_of_a_call_gets_the_same_reply_under_another_counter(self):
        client = self.client()
        client.open(0)
        self.assertEqual(client.call(b'one'), b'eno')
        client.send(client.call_frame(b'one', repeats=True))
        self.assertEqual(client.take_reply(), b'eno')
        self.assertEqual(client.receiver.largest, 1)

    # The server answers in the order in which frames come: what it says next shows that it said
    # nothing before.
    def test_replayed_and_changed_frames_get_no_answer(self):
        for suite in self.all_suites():
            client = self.client()
            client.open(suite)
            good = client.call_frame(b'one')
            client.send(good)
            self.assertEqual(client.take_reply(), b'eno')
            client.send(good)
            for at in (4, 40, 64, len(good) - 24, len(good) - 1):
                client.send(good[:at] + bytes([good[at] ^ 1]) + good[at + 1:])
            self.assertEqual(client.call(b'two'), b'owt')

    def test_frames_of_the_next_key_are_opened(self):
        for suite in self.all_suites():
            client = self.client()
            client.open(suite)
            for counter in (2**22 - 1, 2**22, 2**22 + 5, 2**22 - 2, 2**23, 3 * 2**22):
                client.sender.counter = counter
                self.assertEqual(client.call(b'one'), b'eno')

    def test_a_copy_of_a_hello_gets_the_same_welcome(self):
        client = self.client()
        hello = client.hello_with_message_1(0, client.ask_for_cookie())
        client.send(hello)
        welcome = client.receive()
        client.send(hello)
        self.assertEqual(client.receive(), welcome)
        client.take_welcome(0, welcome)
        self.assertEqual(client.call(b'one'), b'eno')

    def test_a_server_tells_what_became_of_a_session(self):
        client = self.client()
        client.open(0)
        client.call(b'one')
        self.assertEqual(client.former, 0)
        session, sender, receiver = client.session, client.sender, client.receiver
        client.open(0, former=session)
        self.assertEqual((client.former, client.session), (1, session))
        client.sender, client.receiver = sender, receiver
        self.assertEqual(client.call(b'two'), b'owt')
        client.open(0, former=session ^ 1 << 60)
        self.assertEqual(client.former, 2)

    def test_message_1_for_another_server_gets_no_answer(self):
        client = self.client()
        cookie = client.ask_for_cookie()
        client.server_public = noise.public_of(noise.new_key())
        client.send(client.hello_with_message_1(0, cookie))
        client.server_public = self.key
        client.open(0)
        self.assertEqual(client.call(b'one'), b'eno')


class PresharedKeyTest(InteropTest):
    psk = bytes(range(32))

    def client(self):
        return super().client(psk=self.psk)

    def test_without_the_pre_shared_key_there_is_no_session(self):
        client = self.client()
        client.psk = noise.NO_PSK
        with self.assertRaises(noise.Refused):
            client.open(0)


class SecuredServerTest(InteropTest):
    """A whole server, which has grants for one key."""

    def command(self):
        self.private = noise.new_key()
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        key = base64.b64encode(noise.public_of(self.private)).decode()
        authorized = pathlib.Path(self.folder.name, 'authorized')
        authorized.write_text(f'rtpm25519 {key} role=command on=reverse\n')
        authorized.chmod(0o600)
        return [SECURED_SERVER, self.folder.name]

    def client(self, **options):
        return super().client(**{'private': self.private, **options})

    def test_a_stranger_is_refused(self):
        client = self.client(private=noise.new_key())
        client.number += 1
        client.send(client.hello_with_message_1(0, client.ask_for_cookie()))
        refusal = client.receive()
        self.assertEqual((refusal[3], field(refusal, 26, 2)), (KINDS['REFUSE'], 19))

    def test_an_unsealed_client_is_refused(self):
        client = self.client()
        client.send(client.hello(0))
        refusal = client.receive()
        self.assertEqual((refusal[3], field(refusal, 26, 2)), (KINDS['REFUSE'], 19))


if __name__ == '__main__':
    unittest.main()
