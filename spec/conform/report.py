"""The report: what passed, failed and was not played, by level."""

import collections
import json

Result = collections.namedtuple('Result', 'kind name level outcome rules reason failure notes')
LEVEL_NAMES = {0: 'calls over TCP', 1: 'calls over UDP',
               2: 'large messages, oneways, cancelling, streams', 3: 'shared memory'}


def write_failure(result, write):
    failure = result.failure
    at = '' if failure is None or failure.step is None else f', step {failure.step}'
    write(f'FAILED {result.name}{at}: {result.reason}')
    write(f'  rules: {" ".join(result.rules)}')
    if failure is None:
        return
    if failure.differences:
        write(f'  {"field":<18}{"offset":>6}  {"expected":<26}  received')
    for one in failure.differences:
        why = f'   ({one.rule}{": " + one.why if one.why else ""})'
        write(f'  {one.field:<18}{one.offset:>6}  {one.expected:<26}  {one.received}{why}')
    for title, data in failure.frames:
        write(f'  {title}:')
        for begin in range(0, min(len(data), 128), 16):
            write(f'    {begin:4}  {data[begin:begin + 16].hex(" ")}')
        if len(data) > 128:
            write(f'    … {len(data) - 128} bytes more')


def write_report(results, role, title, level_max, write):
    """Writes everything; True if nothing failed."""
    for result in results:
        if result.outcome == 'failed':
            write_failure(result, write)
            write('')
    not_played = [result for result in results if result.outcome == 'not played']
    if not_played:
        write('Not played:')
    by_reason = collections.defaultdict(list)
    for result in not_played:
        by_reason[result.reason].append(result.name)
    for reason, names in by_reason.items():
        write(f'  {tell_names(names)}: {reason}')
    for note, names in noted_by(results).items():
        write(f'  note: {note} ({tell_names(names)})')
    write('')
    write(f'{title}: {role}')
    write(f'  {"level":<50}{"":>14}{"passed":>8}{"failed":>8}{"not played":>12}')
    for level in range(level_max + 1):
        write_level(results, level, write)
    failed = [result for result in results if result.outcome == 'failed']
    passed = [result for result in results if result.outcome == 'passed']
    write(f'{len(passed)} of {len(results)} passed, {len(failed)} failed, {len(not_played)} not '
          'played')
    return not failed


def tell_names(names):
    return ', '.join(names[:6]) + (f' and {len(names) - 6} more' if len(names) > 6 else '')


def noted_by(results):
    """What was noted, and in which conversations or files."""
    notes = collections.defaultdict(list)
    for result in results:
        name = result.name.split(':')[0]
        for note in dict.fromkeys(result.notes):
            if name not in notes[note]:
                notes[note].append(name)
    return notes


def write_level(results, level, write):
    title = f'{level} {LEVEL_NAMES[level]}'
    for kind in ('conversations', 'single frames'):
        counts = collections.Counter(result.outcome for result in results
                                     if result.level == level and result.kind == kind)
        if level == 3 and kind == 'conversations':
            write(f'  {title:<50}{"":>14}  nothing: a socket can\'t play them')
        elif level < 3:
            write(f'  {title:<50}{kind:>14}{counts["passed"]:>8}{counts["failed"]:>8}'
                  f'{counts["not played"]:>12}')
            title = ''


def write_json(results, role, path):
    documents = []
    for result in results:
        document = dict(kind=result.kind, name=result.name, level=result.level,
                        outcome=result.outcome, rules=result.rules, reason=result.reason,
                        notes=result.notes)
        if result.failure is not None:
            document['step'] = result.failure.step
            document['differences'] = [one._asdict() for one in result.failure.differences]
            document['frames'] = {name: data.hex() for name, data in result.failure.frames}
        documents.append(document)
    with open(path, 'w', encoding='utf-8') as file:
        json.dump(dict(role=role, results=documents), file, indent=1, ensure_ascii=False)
        file.write('\n')
