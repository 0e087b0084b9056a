#!/usr/bin/env python3
"""Java's and TypeScript's clients and servers against spec/conform: all that a socket can play
passes, and ten faults that are put into their sources are found.

languages_test.py LANGUAGE FOLDER PROGRAM...
    FOLDER: where the language's build has its output; PROGRAM: java and javac, or node.
"""

import base64
import concurrent.futures
import importlib.util
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

SOURCE = pathlib.Path(__file__).resolve().parents[3]
TOOL = SOURCE / 'spec' / 'conform' / 'rtpm-conform'

# Why a conversation may be left out.
REASONS = re.compile(r'takes \d+ s: --wait-max \d+ plays it|a call has a budget of [\d.]+ ms,|'
                     r'.*see the unit tests')


class Java:
    # Role, conversation, how the broken rule begins, file, text, and that with the fault.
    faults = [
        ('server', 'lost-call', 'hp-5.2-1', 'ServerSessions',
         'if (slot.state != State.EMPTY) {',
         'if (slot.state != State.EMPTY && slot.callId != header.callId) {'),
        ('server', 'slow-method', 'hp-5.7-1', 'ServerSessions',
         'header.budgetUs = (int) Math.min(Math.max(us, 0), 0xffff_ffffL);', ''),
        ('server', 'lost-hello', 'hp-4.2-1', 'ServerSessions',
         'config.medium == Medium.STREAM\n            || cookies', 'true || cookies'),
        ('server', 'foreign-address', 'hp-8-1', 'ServerSessions',
         'if (!session.peer.equals(peer)) {', 'if (session.peer == null) {'),
        ('server', 'refused-calls', 'hp-5.4-3', 'ServerSessions',
         'if (deadline <= now) {', 'if (deadline < 0) {'),
        ('client', 'flood-of-cookies', 'hp-4.2-', 'ClientChannel',
         'mayAnswerCookie = false;\n', '\n'),
        ('client', 'large-reply', 'hp-5.6-8', 'ClientChannel',
         'server release the reply.\n      sendReplyAck(call, false, now);', ''),
        ('client', 'bind-and-call-udp', 'hp-5.4-1', 'ClientChannel',
         'call.header.budgetUs = budget(call, now);', ''),
        ('client', 'strays-at-the-client', 'hp-8-1', 'ClientChannel',
         'if (read.statusNumber == Status.OK.number()) {', 'if (read == null) {'),
        ('client', 'items-that-nobody-takes', 'hp-5.9-3', 'ClientChannel',
         'if (call == null && isReady && read.session == session) {', 'if (read == null) {'),
    ]

    def __init__(self, folder, java, javac):
        self.classes = f'{folder}/classes:{folder}/test-classes'
        self.java, self.javac = [java, '-XX:TieredStopAtLevel=1', '-XX:+UseSerialGC'], javac

    def is_there(self):
        return all(pathlib.Path(one).is_dir() for one in self.classes.split(':'))

    def subject(self, classes=None):
        return [*self.java, '-cp', classes or self.classes, 'org.rtpm.conform.Subject']

    def server(self, *keys):
        return [*self.java, '-cp', self.classes, 'org.rtpm.conform.CountingServer', *keys]

    def with_fault(self, name, text, faulty, folder):
        path = f'org/rtpm/internal/wire/{name}.java'
        sound = (SOURCE / 'clients/java/src/main/java' / path).read_text(encoding='utf-8')
        write_fault(sound, text, faulty, folder / path)
        subprocess.run([self.javac, '-nowarn', '-proc:none', '-cp', self.classes, '-d', folder,
                        folder / path], check=True)
        return self.subject(f'{folder}:{self.classes}')


class TypeScript:
    faults = [
        ('server', 'lost-call', 'hp-5.2-1', 'server_sessions',
         'if (slot !== undefined) {\n            if (slot.callId === header.callId)',
         'if (slot !== undefined && slot.callId !== header.callId) {\n            if (false)'),
        ('server', 'slow-method', 'hp-5.7-1', 'server_sessions',
         'header.budgetUs = Math.min(', 'const us = Math.min('),
        ('server', 'lost-hello', 'hp-4.2-1', 'server_sessions',
         'const isProven = ', 'const isProven = true || '),
        ('server', 'foreign-address', 'hp-8-1', 'server_sessions',
         'if (session.peer.key !== peer.key) {', 'if (session === peer) {'),
        ('server', 'refused-calls', 'hp-5.4-3', 'server_sessions',
         'if (deadline <= now)', 'if (deadline < 0)'),
        ('client', 'flood-of-cookies', 'hp-4.2-', 'client_channel',
         'this.mayAnswerCookie = false;', ''),
        ('client', 'large-reply', 'hp-5.6-8', 'client_channel',
         'this.sendReplyAck(call, call.reply, false, now); // hp-5.6-8', ''),
        ('client', 'bind-and-call-udp', 'hp-5.4-1', 'client_channel',
         'call.header.budgetUs = this.budgetOf(call, now);', ''),
        ('client', 'strays-at-the-client', 'hp-8-1', 'client_channel',
         'if (header.status === Status.ok)', 'if (header === this)'),
        ('client', 'items-that-nobody-takes', 'hp-5.9-3', 'client_channel',
         'this.sendCancel(header, now);', ''),
    ]

    def __init__(self, folder, node):
        self.folder, self.node = pathlib.Path(folder), node

    def is_there(self):
        return (self.folder / 'dist').is_dir()

    def subject(self, dist=None):
        return [self.node, (dist or self.folder / 'dist') / 'test' / 'conform_subject.js']

    def server(self, *keys):
        return [self.node, self.folder / 'dist' / 'test' / 'counting_server.js', *keys]

    def with_fault(self, name, text, faulty, folder):
        shutil.copytree(self.folder / 'dist', folder / 'dist')
        shutil.copy(self.folder / 'package.json', folder)
        path = folder / 'dist' / 'src' / 'core' / f'{name}.js'
        write_fault(path.read_text(encoding='utf-8'), text, faulty, path)
        return self.subject(folder / 'dist')


def write_fault(sound, text, faulty, path):
    assert text in sound, f'{path.name} has no more: {text}'
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(sound.replace(text, faulty), encoding='utf-8')


def run_tool(role, *options, command=()):
    """Gives its exit status, the results and its output."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / 'results.json'
        ran = subprocess.run([sys.executable, TOOL, role, '--json', path, *options,
                              *(('--', *command) if command else ())],
                             capture_output=True, text=True, timeout=200)
        results = json.loads(path.read_text(encoding='utf-8'))['results'] if path.exists() else []
        return ran.returncode, results, ran.stdout + ran.stderr


def count(results, outcome):
    return sum(one['outcome'] == outcome for one in results)


def judge(role, language):
    """All passes but what may be left out."""
    # A machine that is busy with other tests starts eight virtual machines slowly.
    status, results, output = run_tool(role, '--jobs', '4', '--patience', '20',
                                       command=language.subject())
    unsaid = [one['name'] for one in results if one['kind'] == 'conversations'
              and one['outcome'] == 'not played' and not REASONS.match(one['reason'])]
    print(f'{role}: {count(results, "passed")} of {len(results)} passed')
    assert status == 0, output
    assert not unsaid, unsaid
    assert count(results, 'passed') > 320, output


def judge_sealed(language):
    if importlib.util.find_spec('cryptography') is None:
        print('sealed: not played, it needs the Debian package python3-cryptography')
        return
    sys.path.insert(0, str(SOURCE / 'spec' / 'vectors' / 'generator'))
    import noise
    with tempfile.TemporaryDirectory() as folder:
        files, publics = [], []
        for name in ('own', 'second'):
            private = noise.new_key()
            files.append(pathlib.Path(folder) / name)
            files[-1].write_text(f'rtpm25519 {base64.b64encode(private).decode()}\n')
            files[-1].chmod(0o600)
            publics.append(base64.b64encode(noise.public_of(private)).decode())
        server = subprocess.Popen(language.server(*publics), stdout=subprocess.PIPE, text=True)
        try:
            key, address = (server.stdout.readline().strip() for _ in range(2))
            status, results, output = run_tool(
                'sealed', '--address', address, '--server-key', key,
                '--own-key', files[0], '--second-key', files[1])
        finally:
            server.kill()
            server.communicate()
    print(f'sealed: {count(results, "passed")} of {len(results)} passed')
    assert status == 0, output
    assert count(results, 'passed') == len(results) > 30, output


def judge_fault(language, role, conversation, rule, name, text, faulty):
    with tempfile.TemporaryDirectory() as folder:
        command = language.with_fault(name, text, faulty, pathlib.Path(folder))
        status, results, output = run_tool(role, '--only', conversation, '--patience', '1',
                                           command=command)
    failed = [one for one in results if one['outcome'] == 'failed']
    is_found = any(broken.startswith(rule) for one in failed for broken in one['rules'])
    print(f'{conversation}: {"finds" if is_found else "MISSES"} the breach of {rule}')
    assert status == 1 and is_found, output


def main(name, *arguments):
    # CMake leaves out what it did not find.
    language = len(arguments) > 1 and {'java': Java, 'typescript': TypeScript}[name](*arguments)
    if not language or not language.is_there():
        print(f'[  SKIPPED ] {name} is not built')
        return
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        work = [pool.submit(judge, role, language) for role in ('server', 'client')]
        work.append(pool.submit(judge_sealed, language))
        work += [pool.submit(judge_fault, language, *fault) for fault in language.faults]
        failed = [one.exception() for one in work if one.exception()]
    for one in failed:
        print(f'{type(one).__name__}: {one}')
    sys.exit(1 if failed else 0)


if __name__ == '__main__':
    main(*sys.argv[1:])
