"""The program under test: how it is started, and the lines that it and the tool exchange."""

import os
import selectors
import socket
import subprocess
import time

GONE = object()
UNTALKABLE = 'cannot talk to the program under test: '


class SubjectError(Exception):
    """The program under test does not start, has ended, or breaks the line protocol."""


class CannotPlay(Exception):
    """The vector cannot be played against this program, or over a socket; the text says why."""


def parse_line(line):
    """`sees run 7 method=2 payload=` as (['sees', 'run', '7'], {'method': '2', 'payload': ''})."""
    words, values = [], {}
    for part in line.split():
        name, equals, value = part.partition('=')
        if equals:
            values[name] = value
        else:
            words.append(part)
    return words, values


def write_line(*words, **values):
    return ' '.join([*words, *(f'{name}={value}' for name, value in values.items())])


class LineReader:
    """Complete lines out of what a descriptor gives."""

    def __init__(self):
        self.rest = b''

    def feed(self, data):
        *lines, self.rest = (self.rest + data).split(b'\n')
        return [line.decode('utf-8', 'replace').strip() for line in lines if line.strip()]


class Subject:
    """A process that speaks the line protocol of README.md on its stdin and stdout."""

    def __init__(self, command):
        try:
            self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        except OSError as error:
            raise SubjectError(f'{command[0]}: {error.strerror}') from error
        os.set_blocking(self.process.stdout.fileno(), False)
        self.reader = LineReader()

    def fileno(self):
        return self.process.stdout.fileno()

    def tell(self, *words, **values):
        try:
            self.process.stdin.write((write_line(*words, **values) + '\n').encode())
            self.process.stdin.flush()
        except OSError as error:
            raise SubjectError(f'it ended: {self.describe_end()}') from error

    def read(self):
        """Lines that are there now; GONE at the end of its output."""
        try:
            data = os.read(self.fileno(), 1 << 20)
        except BlockingIOError:
            return []
        return self.reader.feed(data) if data else [GONE]

    def describe_end(self):
        try:
            return f'exit status {self.process.wait(1)}'
        except subprocess.TimeoutExpired:
            return 'it closed its stdout, but runs'

    def end(self):
        """Asks it to quit, and kills it if it does not."""
        try:
            if self.process.poll() is None:
                self.process.stdin.write(b'quit\n')
                self.process.stdin.flush()
        except OSError:
            pass
        try:
            self.process.stdin.close()
        except OSError:
            pass
        try:
            self.process.wait(2)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.process.stdout.close()


class FrameSplitter:
    """Frames out of a stream, by payload_size; hands on what is no frame as it is."""

    def __init__(self):
        self.rest = b''

    def feed(self, data):
        self.rest += data
        frames = []
        while len(self.rest) >= 64:
            size = 64 + int.from_bytes(self.rest[28:32], 'little')
            if self.rest[:2] != b'HP' or size > 65536:
                size = len(self.rest)
            if len(self.rest) < size:
                break
            frames.append(self.rest[:size])
            self.rest = self.rest[size:]
        return frames


class Wire:
    """The sockets towards the program under test. Frames go to and come from `client` or `other`,
    the addresses of the vectors. A client under test is always its own `client`."""

    def __init__(self, role, medium, listen=('127.0.0.1', 0)):
        self.role, self.medium = role, medium
        self.ends = {}  # Name to socket.
        self.listener = None
        self.peer = None  # Where a client under test is.
        self.splitter = FrameSplitter()
        self.is_closed_by_peer = False
        if role == 'client':
            kind = socket.SOCK_DGRAM if medium == 'datagram' else socket.SOCK_STREAM
            server = socket.socket(socket.AF_INET, kind)
            server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            server.bind(listen)
            server.setblocking(False)
            if medium == 'datagram':
                server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 21)
                self.ends['client'] = server
            else:
                server.listen(4)
                self.listener = server
            self.address = server.getsockname()
        else:
            self.address = None

    def aim(self, address):
        """Where the server under test is."""
        self.address = address

    def end(self, name):
        """The socket of this name to a server under test, opened when it is first used."""
        if name not in self.ends:
            if self.medium == 'datagram':
                new = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
                new.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 21)
                new.connect(self.address)
            else:
                new = socket.create_connection(self.address, timeout=5)
                new.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self.splitter = FrameSplitter()
                self.is_closed_by_peer = False
            new.setblocking(False)
            self.ends[name] = new
        return self.ends[name]

    def sockets(self):
        return list(self.ends.values()) + ([self.listener] if self.listener else [])

    def send(self, frame, name='client'):
        if self.role == 'client' and self.medium == 'datagram':
            if self.peer is None:
                return False
            self.ends['client'].sendto(frame, self.peer)
            return True
        if self.role == 'client' and 'client' not in self.ends:
            return False
        end = self.end(name)
        try:
            end.setblocking(True)
            end.settimeout(5)
            end.sendall(frame) if self.medium == 'stream' else end.send(frame)
        except OSError:
            return False
        finally:
            end.setblocking(False)
        return True

    def receive(self, ready):
        """What came in at the socket `ready`: (end's name, frames, whether it ended)."""
        if ready is self.listener:
            connection, self.peer = self.listener.accept()
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            connection.setblocking(False)
            if 'client' in self.ends:
                self.ends['client'].close()
            self.ends['client'] = connection
            self.splitter = FrameSplitter()
            self.is_closed_by_peer = False
            return 'client', [], False
        name = next(name for name, end in self.ends.items() if end is ready)
        try:
            if self.medium == 'datagram':
                frame, sender = ready.recvfrom(1 << 17)
                self.peer = sender if self.role == 'client' else self.peer
                return name, [frame], False
            data = ready.recv(1 << 20)
        except BlockingIOError:
            return name, [], False
        except OSError:
            data = b''
            if self.medium == 'datagram':
                return name, [], False  # No listener: the missing frame is reported later.
        if data:
            return name, self.splitter.feed(data), False
        ready.close()
        del self.ends[name]
        self.is_closed_by_peer = True
        return name, [], True

    def disconnect(self):
        for end in self.ends.values():
            end.close()
        self.ends.clear()

    def close(self):
        self.disconnect()
        if self.listener:
            self.listener.close()


def wait_readable(files, until):
    """Those of `files` that can be read, none at the time `until`."""
    with selectors.DefaultSelector() as selector:
        for file in files:
            selector.register(file, selectors.EVENT_READ)
        return [key.fileobj for key, _ in selector.select(max(until - time.monotonic(), 0))]
