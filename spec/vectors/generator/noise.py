"""Handshakes and frames of sealed sessions as security.md says, on Python's `cryptography`.

Both sides, without any I/O: a start for a client of one's own.
"""

import hashlib
import hmac

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.asymmetric.x25519 import X25519PrivateKey, X25519PublicKey
from cryptography.hazmat.primitives.ciphers.aead import AESGCM, ChaCha20Poly1305
from cryptography.hazmat.primitives.serialization import (Encoding, NoEncryption, PrivateFormat,
                                                          PublicFormat)

NAMES = ('Noise_IKpsk2_25519_ChaChaPoly_SHA256', 'Noise_IKpsk2_25519_AESGCM_SHA256')
NO_PSK = bytes(32)
WINDOW = 1024
GENERATION_BITS = 22
COUNTER_END = 2**48


class Refused(Exception):
    """A message or frame that is not to be taken; its text is the reason."""


def new_key():
    return X25519PrivateKey.generate().private_bytes(Encoding.Raw, PrivateFormat.Raw, NoEncryption())


def public_of(private):
    key = X25519PrivateKey.from_private_bytes(private).public_key()
    return key.public_bytes(Encoding.Raw, PublicFormat.Raw)


def agree(private, public):
    try:
        shared = X25519PrivateKey.from_private_bytes(private).exchange(
            X25519PublicKey.from_public_bytes(public))
    except ValueError:
        raise Refused('a key of small order') from None
    if shared == bytes(32):
        raise Refused('a key of small order')
    return shared


class Cipher:
    """One key of a suite; n is the number in the nonce."""

    def __init__(self, suite, key):
        self.suite, self.key = suite, key
        self.aead = AESGCM(key) if suite else ChaCha20Poly1305(key)

    def nonce(self, n):
        return bytes(4) + n.to_bytes(8, 'big' if self.suite else 'little')

    def seal(self, n, associated, plain):
        return self.aead.encrypt(self.nonce(n), plain, associated)

    def open(self, n, associated, sealed):
        try:
            return self.aead.decrypt(self.nonce(n), sealed, associated)
        except InvalidTag:
            raise Refused('bad_seal') from None

    def next(self):
        return Cipher(self.suite, self.seal(2**64 - 1, b'', bytes(32))[:32])


class Handshake:
    """The state that both sides go through (3.5)."""

    def __init__(self, suite, server_public, prologue):
        self.suite = suite
        name = NAMES[suite].encode()
        self.h = self.ck = name if len(name) == 32 else hashlib.sha256(name).digest()
        self.cipher, self.n = None, 0
        self.mix_hash(prologue)
        self.mix_hash(server_public)

    def mix_hash(self, data):
        self.h = hashlib.sha256(self.h + data).digest()

    def derive(self, data, count):
        t = hmac.digest(self.ck, data, 'sha256')
        outputs, last = [], b''
        for i in range(count):
            last = hmac.digest(t, last + bytes([i + 1]), 'sha256')
            outputs.append(last)
        return outputs

    def take_key(self, key):
        self.cipher, self.n = Cipher(self.suite, key), 0

    def mix_key(self, data):
        self.ck, key = self.derive(data, 2)
        self.take_key(key)

    def mix_key_and_hash(self, data):
        self.ck, middle, key = self.derive(data, 3)
        self.mix_hash(middle)
        self.take_key(key)

    def mix_ephemeral(self, public):
        self.mix_hash(public)
        self.mix_key(public)

    def encrypt(self, plain):
        sealed = self.cipher.seal(self.n, self.h, plain)
        self.n += 1
        self.mix_hash(sealed)
        return sealed

    def decrypt(self, sealed):
        plain = self.cipher.open(self.n, self.h, sealed)
        self.n += 1
        self.mix_hash(sealed)
        return plain

    def keys(self):
        """The client's and the server's."""
        return self.derive(b'', 2)


class Client(Handshake):
    def __init__(self, suite, private, server_public, ephemeral, prologue, psk=NO_PSK):
        super().__init__(suite, server_public, prologue)
        self.private, self.server_public = private, server_public
        self.ephemeral, self.psk = ephemeral, psk

    def message_1(self, payload):
        e = public_of(self.ephemeral)
        self.mix_ephemeral(e)
        self.mix_key(agree(self.ephemeral, self.server_public))
        static = self.encrypt(public_of(self.private))
        self.mix_key(agree(self.private, self.server_public))
        return e + static + self.encrypt(payload)

    def read_message_2(self, message):
        e = message[:32]
        self.mix_ephemeral(e)
        self.mix_key(agree(self.ephemeral, e))
        self.mix_key(agree(self.private, e))
        self.mix_key_and_hash(self.psk)
        return self.decrypt(message[32:])


class Server(Handshake):
    def __init__(self, suite, private, prologue, psk=NO_PSK):
        super().__init__(suite, public_of(private), prologue)
        self.private, self.psk = private, psk

    def read_message_1(self, message):
        """The client's public key, and the payload."""
        self.client_ephemeral = message[:32]
        self.mix_ephemeral(self.client_ephemeral)
        self.mix_key(agree(self.private, self.client_ephemeral))
        self.client_public = self.decrypt(message[32:80])
        self.mix_key(agree(self.private, self.client_public))
        return self.client_public, self.decrypt(message[80:])

    def message_2(self, ephemeral, payload):
        e = public_of(ephemeral)
        self.mix_ephemeral(e)
        self.mix_key(agree(ephemeral, self.client_ephemeral))
        self.mix_key(agree(ephemeral, self.client_public))
        self.mix_key_and_hash(self.psk)
        return e + self.encrypt(payload)


class Keys:
    """The keys of one direction, by generation (5-5)."""

    def __init__(self, suite, key):
        self.ciphers = [Cipher(suite, key)]

    def of(self, counter):
        while len(self.ciphers) <= counter >> GENERATION_BITS:
            self.ciphers.append(self.ciphers[-1].next())
        return self.ciphers[counter >> GENERATION_BITS]


class Sender:
    def __init__(self, suite, key):
        self.keys, self.counter = Keys(suite, key), 0

    def seal(self, header, payload, counter=None):
        """The frame; `header` has the flag already."""
        if counter is None:
            counter, self.counter = self.counter, self.counter + 1
        sealed = self.keys.of(counter).seal(counter, header, payload)
        return header + sealed[:-16] + counter.to_bytes(8, 'little') + sealed[-16:]


class Receiver:
    def __init__(self, suite, key):
        self.keys, self.received, self.largest = Keys(suite, key), set(), -1

    def open(self, frame):
        """The payload."""
        counter = int.from_bytes(frame[-24:-16], 'little')
        newest = max(self.largest, 0)
        generation = counter >> GENERATION_BITS
        if counter in self.received or counter + WINDOW <= self.largest:
            raise Refused('replayed')
        if counter >= COUNTER_END or abs(generation - (newest >> GENERATION_BITS)) > 1:
            raise Refused('bad_seal')
        payload = self.keys.of(counter).open(counter, frame[:64], frame[64:-24] + frame[-16:])
        self.received.add(counter)
        self.largest = max(self.largest, counter)
        return payload
