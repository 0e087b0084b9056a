#!/usr/bin/env python3
"""Tests of the tool's own parts. tests/spec/conform/conform_test.py tests how it judges programs."""

import importlib.machinery
import importlib.util
import io
import json
import pathlib
import sys
import types
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

import black_box  # noqa: E402
import layout  # noqa: E402
import peer  # noqa: E402
import play  # noqa: E402
import report  # noqa: E402
import singles  # noqa: E402
import steps  # noqa: E402
import subject  # noqa: E402
from compare import Bindings, Comparer, is_copy  # noqa: E402

VECTORS = layout.SPEC / 'vectors'
OPTIONS = types.SimpleNamespace(command=['x'], wait_max=25, listen=('127.0.0.1', 0), address=None,
                                role='server', patience=5)


def load_tool():
    """The program itself, whose name is none of a module."""
    path = str(pathlib.Path(__file__).with_name('rtpm-conform'))
    loader = importlib.machinery.SourceFileLoader('rtpm_conform', path)
    spec = importlib.util.spec_from_loader('rtpm_conform', loader)
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    return module


def read(name):
    return json.loads((VECTORS / name).read_text(encoding='utf-8'))


def conversations():
    for path in sorted((VECTORS / 'conversations').glob('*.json')):
        yield path.stem, read(f'conversations/{path.name}')


class LayoutTest(unittest.TestCase):
    def test_frames_are_encoded_as_the_vectors_have_them(self):
        for vector in read('headers-good.json')['vectors']:
            frame = bytes.fromhex(vector['hex'])
            header = layout.header_of(frame)
            kind = layout.kind_of(frame)
            fields = {name: header[name] for name in header if name not in ('magic', 'kind')}
            self.assertEqual(kind, vector['header']['kind'])
            self.assertEqual(layout.encode(kind, frame[64:], **fields), frame, vector['name'])

    def test_fields_of_a_frame_cover_it(self):
        for name, conversation in conversations():
            for step in conversation['steps']:
                if 'frame' not in step:
                    continue
                frame = layout.Pattern(step['hex'], conversation['free']).fill({})
                is_whole = len(frame) >= 64 and layout.number(frame[28:32]) == len(frame) - 64
                if not is_whole or step['frame'].startswith('network'):
                    continue
                at = 0
                for field, offset, size in layout.fields_of(frame):
                    if at < len(frame):
                        self.assertEqual(offset, at, f'{name}: {field}')
                    at = offset + size
                self.assertGreaterEqual(at, len(frame), name)

    def test_a_pattern_is_filled_with_what_is_known(self):
        free = {'call': dict(size=4, chosen_by='client', example='01000000')}
        pattern = layout.Pattern('4850<call>ff', free)
        self.assertEqual(pattern.fill({'call': b'\1\2\3\4'}), b'HP\1\2\3\4\xff')
        self.assertEqual(pattern.fill({}), b'HP\0\0\0\0\xff')
        self.assertEqual([pattern.name_at(i) for i in (0, 2)], [None, 'call'])


class BindingsTest(unittest.TestCase):
    FREE = {name: dict(size=4, chosen_by=side, example='01000000') for name, side in (
        ('call', 'client'), ('call2', 'client'), ('session', 'server'), ('session2', 'server'))}

    def test_choices_of_the_other_side_are_the_examples(self):
        bindings = Bindings(self.FREE, 'server')
        self.assertEqual(sorted(bindings.known), ['call', 'call2'])

    def test_choices_differ_and_calls_grow(self):
        bindings = Bindings(self.FREE, 'client')
        bindings.known['call'] = b'\xff\xff\xff\xff'
        self.assertIsNone(bindings.objection('call2', b'\0\0\0\0'), 'after the largest comes 0')
        bindings.known['handshake'] = b'\5\0\0\0'
        self.assertIn('not later', bindings.objection('handshake2', b'\4\0\0\0'))
        self.assertIn('not later', bindings.objection('call2', b'\xfe\xff\xff\xff'))
        self.assertIn('the same as', bindings.objection('call2', b'\xff\xff\xff\xff'))
        self.assertIn('before', bindings.objection('call', b'\0\0\0\0'))


class ComparerTest(unittest.TestCase):
    # Free, or decided by the clock, or without effect.
    FREE = {'sender_time_ns', 'clock_domain', 'features', 'channel', 'client_epoch', 'methods',
            'server_epoch', 'window', 'fingerprint', 'version_min', 'version_max', 'budget_us',
            'byte_limit'}

    def changed(self, role):
        """Each field of each frame that a program in `role` sends, with another value."""
        for name, conversation in conversations():
            if role not in conversation['roles']:
                continue
            for step in conversation['steps']:
                if step.get('frame') != f'{role} to {steps.OTHER[role]}':
                    continue
                comparer = Comparer(conversation, role)
                pattern = comparer.pattern(step['hex'])
                example = {n: bytes.fromhex(c['example']) for n, c in conversation['free'].items()}
                yield name, comparer, step, pattern, bytearray(pattern.fill(example))

    def test_frames_of_the_vectors_are_taken_and_others_not(self):
        for role in ('client', 'server'):
            checked = 0
            for name, comparer, step, pattern, frame in self.changed(role):
                self.assertEqual(comparer.differences(step['hex'], bytes(frame), 0), [], name)
                for field, offset, size in layout.fields_of(frame):
                    if field in self.FREE or not size or (
                            field == 'priority' and layout.kind_of(frame) == 'CLOSE') or (
                            field in ('flags', 'item') and frame[3] in (1, 8, 11)) or (
                            field == 'message_size_max'):
                        continue
                    if layout.is_bind(layout.header_of(frame)) and offset >= 64 and \
                            field != 'reserved':
                        continue
                    known = pattern.name_at(offset)
                    if known and known not in comparer.bindings.known:
                        continue
                    other = bytearray(frame)
                    other[offset] ^= 0x40
                    found = comparer.differences(step['hex'], bytes(other), 0)
                    if frame[3] == 6 and field in ('payload_size', 'message_size') and \
                            layout.is_bind(layout.header_of(frame)):
                        continue
                    self.assertTrue(found, f'{role}, {name}: {field} of {step["note"]}')
                    checked += 1
            self.assertGreater(checked, 1000, role)

    def test_a_difference_says_which_rule_it_breaks(self):
        conversation = read('conversations/lost-call.json')
        comparer = Comparer(conversation, 'server')
        step = next(s for s in conversation['steps'] if s.get('note') == 'REPLY, ok')
        frame = bytearray(comparer.fill(step['hex']))
        comparer.bindings.known['session'] = bytes(frame[8:16])
        frame[24] += 1
        found = comparer.differences(step['hex'], bytes(frame), 0)
        self.assertEqual([(one.field, one.offset, one.rule) for one in found],
                         [('method', 24, 'hp-5.1-2')])

    def test_a_budget_may_shrink_and_not_grow(self):
        conversation = read('conversations/lost-call.json')
        calls = [s for s in conversation['steps'] if s.get('note', '').startswith('CALL')]
        for budget_us, is_good in ((1_000_000, True), (900_000, True), (1_000_001, False),
                                   (0, False), (400_000, False)):
            comparer = Comparer(conversation, 'client')
            frame = bytearray(comparer.fill(calls[0]['hex']))
            frame[40:44] = budget_us.to_bytes(4, 'little')
            found = comparer.differences(calls[0]['hex'], bytes(frame), 0)
            self.assertEqual(not found, is_good, budget_us)

    def test_a_reply_took_no_longer_than_it_was_waited_for(self):
        conversation = read('conversations/bind-and-call-udp.json')
        step = [s for s in conversation['steps'] if s.get('note') == 'REPLY, ok'][1]
        comparer = Comparer(conversation, 'server')
        frame = comparer.fill(step['hex'])
        comparer.asked_at[layout.number(frame[16:20])] = 10.0
        self.assertEqual(comparer.differences(step['hex'], frame, 10.001), [])
        found = comparer.differences(step['hex'], frame, 10.00004)
        self.assertEqual([one.field for one in found], ['budget_us'])

    def test_a_client_takes_no_granted_bytes_back(self):
        conversation = read('conversations/large-items.json')
        step = next(s for s in conversation['steps'] if s.get('note', '').startswith('CREDIT'))
        wanted = 43_008 + 2 * 1344
        for limit, before, is_good in ((wanted, None, True), (wanted + 100_000, None, True),
                                       (43_008, None, True), (43_007, None, False),
                                       (wanted - 1, wanted, False)):
            comparer = Comparer(conversation, 'client')
            frame = bytearray(comparer.fill(step['hex']))
            if before:
                comparer.byte_limits[layout.number(frame[16:20])] = before
            frame[68:72] = limit.to_bytes(4, 'little')
            found = comparer.differences(step['hex'], bytes(frame), 0)
            self.assertEqual(not found, is_good, limit)

    def test_copies_are_known(self):
        frame = layout.encode('CALL', b'\1', call_id=5, budget_us=100, sender_time_ns=7)
        copy = layout.encode('CALL', b'\1', call_id=5, budget_us=90, sender_time_ns=9, flags=1)
        self.assertTrue(is_copy(copy, frame, 'datagram'))
        self.assertFalse(is_copy(copy, frame, 'stream'), 'hp-5.3-4')
        self.assertFalse(is_copy(frame, frame, 'datagram'), 'a copy says so')
        other = layout.encode('CALL', b'\2', call_id=5, flags=1)
        self.assertFalse(is_copy(other, frame, 'datagram'))


class SubjectTest(unittest.TestCase):
    def test_lines_are_words_and_values(self):
        self.assertEqual(subject.parse_line('sees run 7 method=2 payload='),
                         (['sees', 'run', '7'], {'method': '2', 'payload': ''}))
        self.assertEqual(subject.write_line('does', 'open', priority=3), 'does open priority=3')

    def test_lines_come_in_pieces(self):
        reader = subject.LineReader()
        self.assertEqual(reader.feed(b'rea'), [])
        self.assertEqual(reader.feed(b'dy\n\n a=b \nc'), ['ready', 'a=b'])

    def test_frames_are_split_wherever_they_are_cut(self):
        frames = [layout.encode('CALL', b'\1' * size, call_id=size) for size in (0, 1, 70)]
        stream = b''.join(frames)
        for piece in (1, 63, 64, 65, len(stream)):
            splitter = subject.FrameSplitter()
            found = []
            for begin in range(0, len(stream), piece):
                found += splitter.feed(stream[begin:begin + piece])
            self.assertEqual(found, frames, piece)
        self.assertEqual(subject.FrameSplitter().feed(b'x' * 70), [b'x' * 70])


class PlayTest(unittest.TestCase):
    def test_every_step_of_every_conversation_is_known(self):
        for name, conversation in conversations():
            for role in conversation['roles']:
                kinds = [steps.judge(step, role) for step in conversation['steps']]
                self.assertIn('input', kinds, name)
                try:
                    steps.check_playable(conversation, role, OPTIONS)
                except subject.CannotPlay as cannot:
                    self.assertNotIn('does not know', str(cannot), name)

    def test_an_unknown_step_is_reported(self):
        for step in ({'client_does': 'dance'}, {'server_does': 'dance'}, {'dance': 1},
                     {'network_does': 'dance'}):
            conversation = read('conversations/ping.json')
            conversation['steps'].insert(6, dict(at_ns=1_001_000_000) | step)
            with self.assertRaisesRegex(subject.CannotPlay, 'does not know', msg=step):
                for role in ('client', 'server'):
                    steps.check_playable(conversation, role, OPTIONS)

    def player(self, name, role):
        return play.Player(read(f'conversations/{name}.json'), role, OPTIONS, name)

    def test_a_client_without_texts_asks_for_none(self):
        player = self.player('binding-without-a-fingerprint', 'client')
        at = next(i for i, step in enumerate(player.steps) if 'describe' in step.get('note', ''))
        line = peer.Line(['sees', 'not_bound'], {}, 'sees not_bound', 0)
        with self.assertRaises(play.GoOn) as other:
            player.take_line(line, [(at, player.steps[at])])
        self.assertEqual(player.steps[other.exception.at]['client_sees'], 'not_bound')
        self.assertEqual(list(player.peer.events), [line])

    def test_a_client_may_bind_before_it_opens_another_session(self):
        player = self.player('binding-of-a-server-declared-object', 'client')
        hellos = [i for i, step in enumerate(player.steps)
                  if step.get('note', '').startswith('HELLO')]
        at = hellos[2]
        with self.assertRaises(play.GoOn) as other:
            player.take_line(peer.Line(['sees', 'bound'], {}, 'sees bound', 0),
                             [(at, player.steps[at])])
        self.assertEqual(other.exception.at, at)
        notes = [step.get('client_sees') or step.get('client_does') or step['note'].split(',')[0]
                 for step in player.steps[at:]]
        self.assertEqual(notes, ['bound', 'call_object', 'HELLO', 'COOKIE', 'HELLO', 'WELCOME',
                                 'CALL', 'REPLY', 'result'])

    def test_a_receipt_may_come_before_its_order(self):
        player = self.player('receipt-that-says-why', 'server')
        run = next(i for i, step in enumerate(player.steps) if step.get('server_sees') == 'run')
        reply = next(step for step in player.steps if step.get('note', '').startswith('REPLY'))
        event = peer.Frame(player.compare.fill(reply['hex']), 'client', 0)
        player.take_frame(event, [(run, player.steps[run])])
        self.assertEqual(player.early, [event])

    def test_a_wait_in_vain_shows_the_nearest_frame(self):
        player = self.player('lost-call', 'client')
        calls = [i for i, step in enumerate(player.steps) if step.get('note', '').startswith('CALL')]
        first = player.compare.fill(player.steps[calls[0]]['hex'])
        player.compare.bindings.known['call'] = first[16:20]
        player.compare.budgets['CALL', layout.number(first[16:20]), 0] = 1_000_000
        for data in (layout.encode('CLOSE'), first):
            player.passed_over.append(peer.Frame(data, 'client', 0))
        failure = player.missing([(calls[1], player.steps[calls[1]])])
        self.assertEqual([one.field for one in failure.differences], ['flags', 'budget_us'])
        self.assertEqual(failure.frames[-1], ('the nearest that came, a CALL', first))

    def test_first_handshake_numbers_are_judged(self):
        tool = load_tool()

        def judged(*numbers):
            players = [types.SimpleNamespace(first_handshake=one) for one in numbers]
            return [(one.outcome, one.rules) for one in tool.judge_first_numbers(players)]

        self.assertEqual(judged(1, 1, 1), [], 'too few')
        self.assertEqual(judged(5, None, 1 << 30, 1 << 20, 1 << 29), [('passed', ['hp-4-2'])])
        for numbers in ((1, 1, 1, 1), (1, 2, 3, 4), (1 << 30, 1 << 30, 7, 7)):
            self.assertEqual(judged(*numbers), [('failed', ['hp-4-2'])], numbers)

    def test_a_method_that_ran_took_time(self):
        conversation = read('conversations/slow-method.json')
        step = next(s for s in conversation['steps'] if s.get('note') == 'REPLY, ok')
        comparer = Comparer(conversation, 'server')
        frame = bytearray(comparer.fill(step['hex']))
        comparer.ran_us[layout.number(frame[16:20])] = 5000
        for took_us, is_good in ((5000, True), (0, False), (4999, False)):
            frame[40:44] = took_us.to_bytes(4, 'little')
            found = comparer.differences(step['hex'], bytes(frame), 0)
            self.assertEqual([one.rule for one in found], [] if is_good else ['hp-5.7-1'])

    def test_levels_are_those_of_the_specification(self):
        levels = {name: steps.level_of(conversation) for name, conversation in conversations()}
        self.assertEqual(levels['bind-and-call-tcp'], 0)
        self.assertEqual(levels['lost-call'], 1)
        self.assertEqual(levels['stream-tcp'], 2)
        self.assertEqual(levels['oneways'], 2)

    def test_what_a_clock_can_not_do_is_not_played(self):
        with self.assertRaisesRegex(subject.CannotPlay, '1 ms'):
            conversation = read('conversations/deadlines-on-two-clocks.json')
            steps.check_playable(conversation, 'server', OPTIONS)
        with self.assertRaisesRegex(subject.CannotPlay, '--wait-max 59'):
            steps.check_playable(read('conversations/silent-session.json'), 'server', OPTIONS)

    def test_the_session_runs_its_own_calls(self):
        own = read('conversations/bind-and-call-udp.json')['steps']
        found = steps.steps_of_session(own)
        self.assertEqual([own[i].get('server_sees') or own[i]['server_does']
                          for i in sorted(found)], ['run', 'complete'])

    def test_every_file_of_vectors_is_played_or_reported(self):
        files = {path.name for path in VECTORS.glob('*.json')} - {'constants.json'}
        known = {name for name, _, _, _ in singles.FILES} | set(singles.NOT_ON_THE_WIRE)
        self.assertEqual(files - known, set())


class BlackBoxTest(unittest.TestCase):
    def test_runs_are_counted(self):
        counter = black_box.RunCounter()
        self.assertIsNone(counter.objection('a', bytes([5]) + bytes(7)))
        self.assertFalse(counter.objection('a', bytes([5]) + bytes(7)))
        self.assertIsNone(counter.objection('b', bytes([6]) + bytes(7)))
        self.assertIn('2 runs', counter.objection('c', bytes([8]) + bytes(7)))
        self.assertIn('repeats', counter.objection('a', bytes([6]) + bytes(7)))
        self.assertIn('8 bytes', counter.objection('d', bytes(4)))

    def test_conversations_that_need_orders_are_not_played(self):
        playable = []
        for name, conversation in conversations():
            try:
                black_box.check_playable(conversation)
                playable.append(name)
            except subject.CannotPlay:
                pass
        for name in ('bind-and-call-udp', 'lost-call', 'late-copies', 'lost-connection-tcp'):
            self.assertIn(name, playable)
        for name in ('slow-method', 'statuses', 'stream', 'server-stops', 'refused-calls'):
            self.assertNotIn(name, playable)


class ReportTest(unittest.TestCase):
    def test_it_shows_what_failed_and_what_was_not_played(self):
        failure = peer.Failure('its REPLY is not as expected', ['hp-5.1-2'],
                               frames=[('received', bytes(200))])
        failure.step = 3
        results = [report.Result('conversations', 'ping', 1, 'passed', [], '', None, []),
                   report.Result('conversations', 'stream', 2, 'not played', [], 'too slow', None,
                                 []),
                   report.Result('conversations', 'lost-call', 1, 'failed', ['hp-5.1-2'],
                                 str(failure), failure, [])]
        text = io.StringIO()
        is_good = report.write_report(results, 'server', 'mine', 2,
                                      lambda line: print(line, file=text))
        self.assertFalse(is_good)
        for part in ('FAILED lost-call, step 3', 'rules: hp-5.1-2', '72 bytes more',
                     'stream: too slow', '1 of 3 passed, 1 failed, 1 not played'):
            self.assertIn(part, text.getvalue())


if __name__ == '__main__':
    unittest.main()
