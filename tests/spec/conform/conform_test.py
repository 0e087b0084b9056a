#!/usr/bin/env python3
"""spec/conform against RTPM's client and server: all that a socket can play passes, and faults that
were put in are found.   conform_test.py FOLDER-OF-PROGRAMS TEST..."""

import base64
import contextlib
import importlib.util
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

SOURCE = pathlib.Path(__file__).resolve().parents[3]
TOOL = SOURCE / 'spec' / 'conform' / 'rtpm-conform'
PROGRAMS = pathlib.Path('.')

# Why a conversation may be left out. What the tool does not know yet is no such reason: a new step
# of the vectors goes into spec/conform/steps.py and play.py, and into the subjects here.
REASONS = re.compile(r'takes \d+ s: --wait-max \d+ plays it|a call has a budget of [\d.]+ ms,')
BLACK_BOX_REASONS = re.compile(REASONS.pattern + r'|needs a COMMAND')


class ConformTest(unittest.TestCase):
    def run_tool(self, role, *options, command=()):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / 'results.json'
            ran = subprocess.run(
                [sys.executable, TOOL, role, '--json', path, *options,
                 *(('--', *command) if command else ())],
                capture_output=True, text=True, timeout=100)
            self.assertNotEqual(ran.returncode, 2, ran.stderr + ran.stdout)
            self.assertEqual(ran.stderr, '')
            return ran, json.loads(path.read_text(encoding='utf-8'))['results']

    def subject(self, *faults):
        return [PROGRAMS / 'conform_subject', *faults]

    def expect_all(self, role, reasons, *options, command=()):
        """Everything passes, but for what may be left out; gives which conversations passed."""
        ran, results = self.run_tool(role, *options, command=command)
        self.assertEqual(ran.returncode, 0, ran.stdout)
        conversations = [one for one in results if one['kind'] == 'conversations']
        for one in conversations:
            if one['outcome'] != 'passed':
                self.assertRegex(one['reason'], reasons, one['name'])
        self.assertGreater(sum(one['outcome'] == 'passed' for one in results
                               if one['kind'] == 'single frames'), 250)
        return {one['name'] for one in conversations if one['outcome'] == 'passed'}

    def expect_fault(self, role, only, rule, *faults, patience_s=1):
        """The fault makes the conversation fail, by that rule; without it, it passes."""
        ran, results = self.run_tool(role, '--only', only, '--patience', str(patience_s),
                                     command=self.subject(*faults))
        self.assertEqual(ran.returncode, 1, ran.stdout)
        failed = [one for one in results if one['outcome'] == 'failed']
        self.assertTrue(any(rule in one['rules'] for one in failed), ran.stdout)
        self.assertIn(rule, ran.stdout)
        ran, _ = self.run_tool(role, '--only', only, command=self.subject())
        self.assertEqual(ran.returncode, 0, ran.stdout)


class ServerTest(ConformTest):
    def test_rtpm_passes(self):
        passed = self.expect_all('server', REASONS, command=self.subject())
        self.assertLess({'bind-and-call-tcp', 'lost-call', 'server-restarts', 'stream'}, passed)


class ClientTest(ConformTest):
    def test_rtpm_passes(self):
        passed = self.expect_all('client', REASONS, command=self.subject())
        self.assertLess({'bind-and-call-tcp', 'lost-call', 'lost-hello', 'stream'}, passed)


class ExampleTest(ConformTest):
    def test_the_example_of_level_0_passes(self):
        example = [sys.executable, SOURCE / 'spec' / 'conform' / 'example_client.py']
        ran, results = self.run_tool('client', '--level', '0', command=example)
        self.assertEqual(ran.returncode, 0, ran.stdout)
        conversations = [one for one in results if one['kind'] == 'conversations']
        self.assertEqual({one['outcome'] for one in conversations}, {'passed'}, ran.stdout)


@contextlib.contextmanager
def reference_server(*options):
    """RTPM's installed server of lab.Arm; gives its address."""
    server = subprocess.Popen(
        [PROGRAMS / 'rtpm-reference-server', '--port', '0', '--realtime', 'off', *options],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        yield re.fullmatch(r'rtpm://(\S+)/lab/arm0', server.stdout.readline().strip()).group(1)
    finally:
        server.terminate()
        _, errors = server.communicate(timeout=10)
        if server.returncode != 0:
            raise AssertionError(f'rtpm-reference-server: {server.returncode}: {errors}')


class BlackBoxTest(ConformTest):
    def test_rtpm_as_it_is_passes(self):
        with reference_server() as address:
            passed = self.expect_all('server', BLACK_BOX_REASONS, '--address', address,
                                     '--wait-max', '6')
            self.assertLess({'bind-and-call-tcp', 'bind-and-call-udp', 'lost-call', 'late-copies',
                             'large-request', 'lost-connection-tcp'}, passed)


class SealedServerTest(ConformTest):
    """Level S, of our real server."""

    def setUp(self):
        if importlib.util.find_spec('cryptography') is None:
            self.skipTest('[  SKIPPED ] needs the Debian package python3-cryptography')
        sys.path.insert(0, str(SOURCE / 'spec' / 'vectors' / 'generator'))
        import noise
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        own = noise.new_key()
        write_line(self.folder / 'own', f'rtpm25519 {base64.b64encode(own).decode()} conform')
        public = base64.b64encode(noise.public_of(own)).decode()
        second = noise.new_key()
        write_line(self.folder / 'second', f'rtpm25519 {base64.b64encode(second).decode()} second')
        lines = (f'rtpm25519 {key} name={name} role=administer on=**' for key, name in (
            (public, 'conform'), (base64.b64encode(noise.public_of(second)).decode(), 'second')))
        write_line(self.folder / 'authorized', '\n'.join(lines))
        self.address = self.enterContext(reference_server(
            '--authorized', self.folder / 'authorized', '--key', self.folder / 'server'))
        private = base64.b64decode((self.folder / 'server').read_text().split()[1])
        self.key = noise.public_of(private)

    def run_sealed(self, key, *options):
        return self.run_tool('sealed', '--address', self.address,
                             '--server-key', base64.b64encode(key).decode(),
                             '--own-key', self.folder / 'own', *options)

    def test_rtpm_passes(self):
        ran, results = self.run_sealed(self.key, '--second-key', self.folder / 'second')
        self.assertEqual(ran.returncode, 0, ran.stdout)
        self.assertEqual({one['outcome'] for one in results}, {'passed'}, ran.stdout)
        self.assertGreater(len(results), 30)

    def test_a_server_with_another_key_fails(self):
        ran, _ = self.run_sealed(b'Z' * 32, '--only', 'both-suites')
        self.assertEqual(ran.returncode, 1, ran.stdout)
        self.assertIn('its COOKIE shows another key', ran.stdout)


class SealedFaultTest(ConformTest):
    """Faults of another server of level S."""

    def setUp(self):
        if importlib.util.find_spec('cryptography') is None:
            self.skipTest('[  SKIPPED ] needs the Debian package python3-cryptography')
        sys.path.insert(0, str(SOURCE / 'spec' / 'vectors' / 'generator'))
        import noise
        self.folder = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory()))
        self.key = noise.new_key()
        self.publics = []
        for name in ('own', 'second'):
            private = noise.new_key()
            write_line(self.folder / name, f'rtpm25519 {base64.b64encode(private).decode()} {name}')
            self.publics.append(base64.b64encode(noise.public_of(private)).decode())
        self.public = base64.b64encode(noise.public_of(self.key)).decode()

    def run_against(self, only, *faults):
        server = subprocess.Popen(
            [sys.executable, pathlib.Path(__file__).with_name('sealed_server.py'),
             base64.b64encode(self.key).decode(), *self.publics, *faults],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        try:
            return self.run_tool('sealed', '--address', server.stdout.readline().strip(),
                                 '--medium', 'udp', '--server-key', self.public,
                                 '--own-key', self.folder / 'own',
                                 '--second-key', self.folder / 'second',
                                 *(f'--only={one}' for one in only))
        finally:
            server.stdin.close()
            server.stdout.close()
            server.wait(10)

    def test_faults_are_found(self):
        faults = {'--keeps-half-open': ('half-open-sessions-end', 'sec-6-1'),
                  '--tells-all-keys': ('a-session-is-told-of-to-no-other-key', 'sec-6-4'),
                  '--admits-all': ('unknown-keys-are-not-admitted', 'sec-3.2-2')}
        ran, _ = self.run_against([check for check, _ in faults.values()])
        self.assertEqual(ran.returncode, 0, ran.stdout)
        for fault, (check, rule) in faults.items():
            with self.subTest(fault=fault):
                ran, results = self.run_against([check], fault)
                self.assertEqual(ran.returncode, 1, ran.stdout)
                failed = [one for one in results if one['outcome'] == 'failed']
                self.assertEqual([one['rules'] for one in failed], [[rule]], ran.stdout)


def write_line(path, line):
    path.write_text(line + '\n', encoding='ascii')
    path.chmod(0o600)


class FaultTest(ConformTest):
    def test_a_server_that_runs_copies_fails(self):
        self.expect_fault('server', 'lost-call', 'hp-5.2-1', '--runs-copies')

    def test_a_server_that_writes_at_a_wrong_offset_fails(self):
        for medium in ('udp', 'tcp'):
            self.expect_fault('server', f'bind-and-call-{medium}', 'hp-5.1-2', '--swaps-numbers')

    def test_a_client_that_states_no_budget_fails(self):
        for medium in ('udp', 'tcp'):
            self.expect_fault('client', f'bind-and-call-{medium}', 'hp-5.4-1', '--states-no-budget')

    def test_a_client_that_does_not_return_the_cookie_fails(self):
        self.expect_fault('client', 'bind-and-call-udp', 'hp-4.2-3', '--shifts-cookie')

    def test_a_client_that_stays_on_a_broken_stream_fails(self):
        self.expect_fault('client', 'broken-stream-at-the-client', 'hp-8-2', '--hangs-on')

    def test_a_client_that_repeats_too_rarely_fails(self):
        self.expect_fault('client', 'stream-whose-call-is-lost', 'hp-5.3-3',
                          '--repeats-rarely', patience_s=3)

    def test_a_server_that_states_no_run_time_fails(self):
        self.expect_fault('server', 'slow-method', 'hp-5.7-1', '--states-no-run-time')

    def test_a_client_that_numbers_its_handshakes_from_1_fails(self):
        self.expect_fault('client', 'stream-', 'hp-4-2', '--numbers-from-one', patience_s=5)

    def test_a_client_that_answers_every_cookie_fails(self):
        self.expect_fault('client', 'flood-of-cookies', 'hp-4.2-4', '--answers-every-cookie')

    def test_a_client_that_tells_of_no_gap_fails(self):
        self.expect_fault('client', 'gaps-of-a-stream', 'hp-5.10-4', '--tells-no-gap')

    def test_frames_that_can_not_be_given_are_told_of(self):
        ran, _ = self.run_tool('client', '--only', 'strays',
                               command=self.subject('--hides-address'))
        self.assertEqual(ran.returncode, 0, ran.stdout)
        self.assertIn('note: step 0 was not sent', ran.stdout)

    def test_a_program_that_ends_is_told_of(self):
        ran = subprocess.run([sys.executable, TOOL, 'server', '--only', 'ping', '--', 'false'],
                             capture_output=True, text=True, timeout=30)
        self.assertEqual(ran.returncode, 2)
        self.assertIn('ended: exit status 1', ran.stderr)


class HeaderFaultTest(ConformTest):
    def test_a_side_that_takes_bad_headers_fails(self):
        for role in ('client', 'server'):
            for medium in ('udp', 'tcp'):
                with self.subTest(role=role, medium=medium):
                    ran, results = self.run_tool(role, '--only', 'headers-bad', '--medium', medium,
                                                 '--patience', '0.2',
                                                 command=self.subject('--clears-flags'))
                    self.assertEqual(ran.returncode, 1, ran.stdout)
                    failed = {one['name'] for one in results if one['outcome'] == 'failed'}
                    self.assertIn(f'headers-bad {medium}: reserved flag 4', failed)
                    self.assertNotIn(f'headers-bad {medium}: priority 32768', failed)


if __name__ == '__main__':
    PROGRAMS = pathlib.Path(sys.argv.pop(1)).resolve()
    unittest.main()
