"""The tables of offsets and sizes on the pages, as data: the pages are the source."""

import pathlib
import re

import frames

SPEC = pathlib.Path(__file__).resolve().parent.parent.parent

# Which layout a table is: page, section, which table of that section, and its name.
LAYOUTS = [
    ('hprotocol.md', 'hp-2', 0, 'header'),
    ('hprotocol.md', 'hp-4.1', 0, 'HELLO'),
    ('hprotocol.md', 'hp-4.3', 0, 'WELCOME'),
    ('hprotocol.md', 'hp-5.6', 0, 'ACK'),
    ('hprotocol.md', 'hp-5.10', 0, 'CREDIT'),
    ('hprotocol.md', 'hp-6.1', 0, 'bind reply'),
    ('hprotocol.md', 'hp-10.1', 0, 'discovery datagram'),
    ('hprotocol.md', 'hp-16.1', 0, 'shared memory request'),
    ('hprotocol.md', 'hp-16.1', 1, 'shared memory answer'),
    ('hprotocol.md', 'hp-16.2', 0, 'shared memory control words'),
    ('security.md', 'sec-3.1', 0, 'sealed COOKIE'),
    ('security.md', 'sec-3.2', 0, 'sealed HELLO'),
    ('security.md', 'sec-3.3', 0, 'sealed WELCOME'),
    ('events.md', 'ev-2', 0, 'event'),
    ('events.md', 'ev-5.5', 0, 'news of a link'),
    ('events.md', 'ev-7.1', 0, 'multicast datagram'),
]


class Page:
    """What a page has in each of its sections: tables of offsets, and rules."""

    def __init__(self, name):
        self.tables = {}
        self.rules = {}
        anchor, table, rule = '', None, None
        for line in (SPEC / name).read_text(encoding='utf-8').splitlines():
            heading = re.search(r'\{#([a-z0-9.-]+)\}', line)
            if heading:
                anchor = heading[1]
            if not line.startswith('|'):
                table = None
            elif table is not None:
                table.append(cells_of(line))
            elif cells_of(line)[0].startswith('Offset') and cells_of(line)[1] == 'Size':
                table = [cells_of(line)]
                self.tables.setdefault(anchor, []).append(table)
            begin = re.match(r'- `\[([a-z0-9.-]+)\]` (.*)', line)
            if begin:
                rule = begin[1]
                self.rules[rule] = begin[2]
            elif rule and line.startswith('  '):
                self.rules[rule] += ' ' + line.strip()
            else:
                rule = None

    def rules_about(self, section, field):
        """The anchors of the section's rules that name `field`, and of all others where the name is
        no ordinary word."""
        word = re.compile(rf'\b{re.escape(field)}\b')
        return [anchor for anchor, text in self.rules.items()
                if word.search(text) and ('_' in field or anchor.startswith(section + '-'))]


def cells_of(line):
    return [cell.strip() for cell in line.strip().strip('|').split('|')]


def type_of(name, size, meaning):
    if name in ('reserved', 'magic') or size not in (1, 2, 4, 8) or 'bit i' in meaning:
        return 'bytes'
    return f'{"i" if meaning.endswith("signed") else "u"}{8 * size}'


def field_of(page, section, row, drop):
    offset, size, name, meaning = row[:4] if len(row) > 3 else (row[0], row[1], row[2], '')
    if section == 'hp-16.2':  # One cell names a word and says what it is, the next who writes it.
        name, what = re.split('[:,] ', name, maxsplit=1)
        meaning = f'{what}. Written by: {meaning}'
    is_fixed = size.isdigit()
    field = dict(field=name, offset=int(offset) if offset else None,
                 size=int(size) if is_fixed else None)
    if not is_fixed:
        field['size_is'] = size or 'what is left'
    field['type'] = type_of(name, field['size'], meaning)
    field['meaning'] = meaning
    if drop and row[4]:
        field['drop'] = row[4]
    field['rules'] = page.rules_about(section, name)
    return field


def check(name, fields):
    """The fields of a layout lie one behind the other. Control words lie apart."""
    at = 0
    for field in fields:
        assert field['offset'] in (at, None) or name == 'shared memory control words', \
            f'{name}: {field["field"]} is at {field["offset"]}, the field before it ends at {at}'
        if field['size'] is None:
            return
        at = (at if field['offset'] is None else field['offset']) + field['size']


def check_frames(documents):
    """The generator's own layouts, which the vectors are made with, are those of the page."""
    own = {'header': frames.HEADER, 'HELLO': frames.HELLO, 'WELCOME': frames.WELCOME,
           'ACK': frames.ACK, 'CREDIT': frames.CREDIT, 'bind reply': frames.BIND_REPLY}
    for document in documents:
        if document['name'] not in own:
            continue
        page = [(field['field'], field['size']) for field in document['fields'] if field['size']]
        here = [(name.removesuffix('_end'), size) for name, size, _ in own[document['name']]]
        assert page == here, f'{document["name"]}: the page has {page}, frames.py {here}'


def layouts():
    pages = {name: Page(name) for name in dict.fromkeys(page for page, _, _, _ in LAYOUTS)}
    found = sum(len(tables) for page in pages.values() for tables in page.tables.values())
    assert found == len(LAYOUTS), \
        f'the pages have {found} tables of offsets, layouts.py names {len(LAYOUTS)} of them'
    documents = []
    for page_name, section, index, name in LAYOUTS:
        page = pages[page_name]
        head, _, *rows = page.tables[section][index]
        drop = len(head) > 4 and head[4].startswith('Invalid')
        fields = [field_of(page, section, row, drop) for row in rows]
        check(name, fields)
        size = None
        if fields[-1]['size'] is not None:
            size = fields[-1]['offset'] + fields[-1]['size']
        documents.append(dict(name=name, page=f'{page_name}#{section}', size=size, fields=fields))
    check_frames(documents)
    return dict(subject='The layouts of hprotocol.md, security.md and events.md, read from their '
                        'tables. Numbers '
                        'are little-endian.',
                layouts=documents)
