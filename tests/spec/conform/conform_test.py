#!/usr/bin/env python3
"""spec/conform against RTPM's client and server: all that a socket can play passes, and faults that
were put in are found.   conform_test.py FOLDER-OF-PROGRAMS TEST..."""

import base64
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


class BlackBoxTest(ConformTest):
    def test_rtpm_as_it_is_passes(self):
        server = subprocess.Popen([PROGRAMS / 'counting_server'], stdin=subprocess.PIPE,
                                  stdout=subprocess.PIPE, text=True)
        try:
            address = server.stdout.readline().strip()
            passed = self.expect_all('server', BLACK_BOX_REASONS, '--address', address,
                                     '--wait-max', '6')
            self.assertLess({'bind-and-call-tcp', 'bind-and-call-udp', 'lost-call', 'late-copies',
                             'large-request', 'lost-connection-tcp'}, passed)
        finally:
            server.stdin.close()
            server.stdout.close()
            self.assertEqual(server.wait(10), 0)


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
        write_line(self.folder / 'authorized',
                   f'rtpm25519 {public} name=conform role=administer on=**')
        self.server = subprocess.Popen([PROGRAMS / 'counting_server', self.folder / 'authorized',
                                        self.folder / 'server'], stdin=subprocess.PIPE,
                                       stdout=subprocess.PIPE, text=True)
        self.address = self.server.stdout.readline().strip()
        private = base64.b64decode((self.folder / 'server').read_text().split()[1])
        self.key = noise.public_of(private)

    def tearDown(self):
        self.server.stdin.close()
        self.server.stdout.close()
        self.assertEqual(self.server.wait(10), 0)

    def run_sealed(self, key, *options):
        return self.run_tool('sealed', '--address', self.address,
                             '--server-key', base64.b64encode(key).decode(),
                             '--own-key', self.folder / 'own', *options)

    def test_rtpm_passes(self):
        ran, results = self.run_sealed(self.key)
        self.assertEqual(ran.returncode, 0, ran.stdout)
        self.assertEqual({one['outcome'] for one in results}, {'passed'}, ran.stdout)
        self.assertGreater(len(results), 30)

    def test_a_server_with_another_key_fails(self):
        ran, _ = self.run_sealed(b'Z' * 32, '--only', 'both-suites')
        self.assertEqual(ran.returncode, 1, ran.stdout)
        self.assertIn('its COOKIE shows another key', ran.stdout)


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
