"""Vectors of hp-12.2: the texts of a client's and a server's interface, and whether they will do."""

BASE = """service lab.Arm
method 1 get idempotent
request table lab.Request
reply table lab.Reply
method 2 set
request struct lab.ForceMessage
reply empty rtpm.Empty
enum lab.Mode uint8 {
  Free = 0
  Hold = 1
}
struct lab.Force size 16 align 8 {
  0 x: double in "N"
  8 y: double
}
table lab.ForceMessage {
  0 value: object lab.Force required
}
table lab.Leaf {
  0 depth: int32 = 3
}
table lab.Reply {
  0 name: string required
  1 mode: uint8 lab.Mode = 1
  2 leaf: object lab.Leaf optional
}
table lab.Request {
  0 text: string optional
  1 count: int32 = 7
  2 choice_type: union_type lab.Choice = 0
  3 choice: union lab.Choice optional
  4 rate: double optional = 0 in "Hz" frame "base"
}
table rtpm.Empty {
}
union lab.Choice union_type {
  NONE = 0: none
  Leaf = 1: object lab.Leaf
}
"""


def change(*pairs):
    text = BASE
    for before, after in pairs:
        assert text.count(before) == 1, before
        text = text.replace(before, after)
    return text


REQUEST_END = '  4 rate: double optional = 0 in "Hz" frame "base"\n'
REPLY_END = '  2 leaf: object lab.Leaf optional\n'
METHOD_3 = ('request table lab.Request\nreply table lab.Reply\n',
            'request table lab.Request\nreply table lab.Reply\n'
            'method 3 stop\nrequest empty rtpm.Empty\nreply empty rtpm.Empty\n')

# Of each change: whether an old client is understood by a new server, and a new one by an old one.
CHANGES = [
    ('the same', (), True, True),
    ('a method more', (METHOD_3,), True, False),
    ('another name of a method', (('method 1 get', 'method 1 ask'),), False, False),
    ('another number of a method', (('method 2 set', 'method 3 set'),), False, False),
    ('no longer idempotent', (('get idempotent', 'get'),), False, True),
    ('idempotent', (('method 2 set', 'method 2 set idempotent'),), True, False),
    ('oneway', (('method 2 set', 'method 2 set oneway sent'),), False, False),
    ('a stream', (('get idempotent', 'get idempotent stream'),), False, False),
    ('another request', (('request table lab.Request', 'request table lab.Leaf'),), False, False),
    ('no longer a bare struct', (('request struct lab.ForceMessage', 'request table lab.ForceMessage'),
                                 ), False, False),
    ('a field more in a request', ((REQUEST_END, REQUEST_END + '  5 more: int32 = 0\n'),), True, True),
    ('a required field more in a request',
     ((REQUEST_END, REQUEST_END + '  5 more: string required\n'),), False, True),
    ('a required field more in a reply',
     ((REPLY_END, REPLY_END + '  3 more: string required\n'),), True, False),
    ('a required field more in a reply, deprecated',
     ((REPLY_END, REPLY_END + '  3 more: string required deprecated\n'),), True, True),
    ('a field more before the others', (('  0 name: string required\n  1 mode',
                                         '  0 new: int32 = 0\n  1 name: string required\n  2 mode'),
                                        ('  2 leaf', '  3 leaf')), False, False),
    ('another name of a field', (('0 text: string', '0 note: string'),), False, False),
    ('another type of a field', (('1 count: int32', '1 count: int64'),), False, False),
    ('another default', (('= 7', '= 8'),), False, False),
    ('a default instead of null', (('double optional = 0', 'double = 0'),), False, False),
    ('another default of a deprecated field', (('int32 = 7', 'int32 deprecated = 8'),), True, True),
    ('a field deprecated', (('int32 = 7', 'int32 deprecated = 7'),), True, True),
    ('a required field of a reply deprecated',
     (('name: string required', 'name: string required deprecated'),), False, True),
    ('no longer required in a reply', (('name: string required', 'name: string optional'),), False, True),
    ('required in a request', (('text: string optional', 'text: string required'),), False, True),
    ('another unit', (('in "Hz"', 'in "kHz"'),), False, False),
    ('no unit', ((' in "Hz"', ''),), True, True),
    ('another frame', (('frame "base"', 'frame "world"'),), False, False),
    ('a unit of a struct where there was none', (('8 y: double', '8 y: double in "N"'),), True, True),
    ('another unit of a struct', (('0 x: double in "N"', '0 x: double in "mN"'),), False, False),
    ('another struct', (('size 16', 'size 24'), ('  8 y: double\n', '  8 y: double\n  16 z: double\n')),
     False, False),
    ('another name in a struct', (('8 y: double', '8 z: double'),), False, False),
    ('a key', (('text: string optional', 'text: string optional key'),), False, False),
    ('an attribute that nobody knows', (('text: string optional', 'text: string optional packed:2'),),
     False, False),
    ('a value more', (('  Hold = 1\n', '  Hold = 1\n  Follow = 2\n'),), True, True),
    ('another number of a value', (('  Hold = 1\n', '  Hold = 2\n'),), False, False),
    ('another name of a value', (('  Hold = 1\n', '  Stay = 1\n'),), False, False),
    ('another type below an enumeration', (('enum lab.Mode uint8', 'enum lab.Mode uint16'),), False, False),
    ('a member of a union more',
     (('  Leaf = 1: object lab.Leaf\n', '  Leaf = 1: object lab.Leaf\n  Two = 2: object lab.Force\n'),),
     True, True),
    ('another type of a member', (('  Leaf = 1: object lab.Leaf', '  Leaf = 1: object lab.Request'),),
     False, False),
    ('a type behind a field that differs', (('depth: int32 = 3', 'depth: int32 = 4'),), False, False),
    ('types in another order', (('table rtpm.Empty {\n}\n', ''),
                                ('enum lab.Mode', 'table rtpm.Empty {\n}\nenum lab.Mode')), True, True),
]

NO_TEXTS = [
    ('nothing', ''), ('another service', BASE.replace('service lab.Arm', 'service lab.Leg')),
    ('no service', BASE[BASE.index('\n') + 1:]), ('a type without its end', BASE[:-2]),
    ('a type twice', BASE + 'table rtpm.Empty {\n}\n'),
    ('a type that is missing', change(('table lab.Leaf {\n  0 depth: int32 = 3\n}\n', ''))),
    ('a field without a type', change(('  0 depth: int32 = 3\n', '  0 depth\n'))),
    ('a value without a number', change(('  Hold = 1\n', '  Hold\n'))),
    ('a method without a request', change(('request struct lab.ForceMessage\n', ''))),
]


def versions():
    pairs = []

    def add(name, client, server, is_understood, rule='hp-12.2-2'):
        pairs.append(dict(name=name, rules=[rule], client=client, server=server,
                          is_understood=is_understood))

    for name, pairs_of_words, old_client, new_client in CHANGES:
        new = change(*pairs_of_words)
        rule = 'hp-12.2-1' if 'nobody knows' in name or 'order' in name else 'hp-12.2-2'
        add(f'{name}: an old client, a new server', BASE, new, old_client, rule)
        add(f'{name}: a new client, an old server', new, BASE, new_client, rule)
    for name, text in NO_TEXTS:
        add(f'no text: {name}', BASE, text, False, 'hp-6.3-2')
    return dict(subject='Texts of hp-12.2 of two versions of an interface, and whether the client '
                        'understands the server.', pairs=pairs)
