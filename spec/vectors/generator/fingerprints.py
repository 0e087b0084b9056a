"""Vectors of fingerprints: schemas, the text that section 12.1 makes of their services, and its hash."""

from single_frames import wide


def fnv1a_64(text):
    value = 0xcbf29ce484222325
    for byte in text.encode():
        value = ((value ^ byte) * 0x100000001b3) % 2**64
    return value


def folded(value):
    return (value ^ (value >> 32)) % 2**32


FORCE = 'struct lab.Force size 16 align 8 {\n  0 x: double in "N"\n  8 y: double\n}\n'
FORCE_MESSAGE = 'table lab.ForceMessage {\n  0 value: object lab.Force required\n}\n'
EMPTY = 'table rtpm.Empty {\n}\n'
FORCE_SCHEMA = ('include "rtpm.fbs";\nnamespace lab;\n'
                'struct Force { x:double (rtpm_unit: "N"); y:double; }\n'
                'table ForceMessage { value:Force (required); }\n')


def small():
    methods = {1: 'method 1 set\nrequest struct lab.ForceMessage\nreply empty rtpm.Empty\n' +
                  FORCE + FORCE_MESSAGE + EMPTY}
    schema = FORCE_SCHEMA + ('rpc_service Arm {\n'
                             '  set(ForceMessage):rtpm.Empty (rtpm_id: 1);\n}\n')
    return 'one method, with a bare struct', schema, 'lab.Arm', methods


def manners():
    def method(number, name):
        return (f'method {number} {name}\nrequest empty rtpm.Empty\n'
                f'reply {"struct lab.ForceMessage" if number == 1 else "empty rtpm.Empty"}\n' +
                (FORCE + FORCE_MESSAGE if number == 1 else '') + EMPTY)

    methods = {1: method(1, 'watch stream'), 2: method(2, 'stop idempotent'),
               9: method(9, 'hint oneway sent')}
    schema = FORCE_SCHEMA + (
        'rpc_service Arm {\n'
        '  hint(rtpm.Empty):rtpm.Empty (rtpm_id: 9, rtpm_oneway: "sent");\n'
        '  watch(rtpm.Empty):ForceMessage (rtpm_id: 1, rtpm_stream);\n'
        '  stop(rtpm.Empty):rtpm.Empty (rtpm_id: 2, rtpm_idempotent);\n}\n')
    return 'a stream, a oneway, an idempotent method; by their numbers', schema, 'lab.Arm', methods


def every_type():
    schema = FORCE_SCHEMA + """enum Mode : ubyte { Free = 0, Hold = 1 }
table Note { text:string; }
table Device { name:string (key); }
union Any { Note, Device }
table Inner { depth:int = 3; parent:Inner; }
table Request {
  mode:Mode = Hold;
  gain:float = 0.5;
  inner:Inner;
  any:Any;
  count:int = null;
  forces:[Force];
  names:[string] (required);
  big:double = 1e30;
  on:bool = true;
  old:ushort (deprecated);
}
rpc_service Arm {
  ask(Request):ForceMessage (rtpm_id: 2);
}
"""
    types = [FORCE, FORCE_MESSAGE, """enum lab.Mode uint8 {
  Free = 0
  Hold = 1
}
""", """table lab.Note {
  0 text: string optional
}
""", """table lab.Device {
  0 name: string required key
}
""", """union lab.Any union_type {
  NONE = 0: none
  Note = 1: object lab.Note
  Device = 2: object lab.Device
}
""", """table lab.Inner {
  0 depth: int32 = 3
  1 parent: object lab.Inner optional
}
""", """table lab.Request {
  0 mode: uint8 lab.Mode = 1
  1 gain: float = 0.5
  2 inner: object lab.Inner optional
  3 any_type: union_type lab.Any = 0
  4 any: union lab.Any optional
  5 count: int32 optional = 0
  6 forces: vector<object> lab.Force optional
  7 names: vector<string> required
  8 big: double = 1e+30
  9 on: bool = 1
  10 old: uint16 deprecated = 0
}
"""]
    text = ('method 2 ask\nrequest table lab.Request\nreply struct lab.ForceMessage\n' +
            ''.join(sorted(types)))
    return 'every kind of type and of field', schema, 'lab.Arm', {2: text}


def fingerprints():
    vectors = []
    for name, schema, service, methods in (small(), manners(), every_type()):
        text = f'service {service}\n' + ''.join(methods[number] for number in sorted(methods))
        vectors.append(dict(
            name=name, schema=schema, service=service, text=text,
            fingerprint=wide(fnv1a_64(text), 8),
            methods=[dict(id=number, text=methods[number],
                          fingerprint=folded(fnv1a_64(methods[number])))
                     for number in sorted(methods)]))
    return dict(subject='Schemas, the text that hp-12.1 makes of each service, and the fingerprints. '
                        'rtpm.fbs is that of schema/idl.', vectors=vectors)
