"""The datagrams of discovery, hp-10.1."""

from single_frames import wide

SIZE = 256


def datagram(kind=1, domain=7, count=None, number=0x0123456789abcdef, services=(), **others):
    """services: (port, kind, zero, process id) each."""
    fields = dict(magic=b'RTPD', version=1, size=SIZE, tail=b'') | others
    body = b''.join(port.to_bytes(2, 'little') + bytes([of, zero]) + process.to_bytes(4, 'little')
                    for port, of, zero, process in services)
    head = (fields['magic'] + bytes([fields['version'], kind, domain,
                                     len(services) if count is None else count]) +
            number.to_bytes(8, 'little'))
    filled = (head + body).ljust(SIZE - len(fields['tail']), b'\0') + fields['tail']
    return filled.ljust(fields['size'], b'\0')[:fields['size']]


def good(name, kind, domain, services=()):
    return dict(name=name, rules=['hp-10.1-1'], kind='answer' if kind == 2 else 'query',
                domain=domain, number=wide(0x0123456789abcdef, 8),
                services=[dict(port=port, is_registry=of == 1, process_id=process)
                          for port, of, _, process in services],
                hex=datagram(kind, domain, services=services).hex())


def bad(name, *arguments, **fields):
    return dict(name=name, rules=['hp-10.1-2'], hex=datagram(*arguments, **fields).hex())


def discovery():
    registry, server = (7420, 1, 0, 4711), (40877, 2, 0, 0)
    return dict(
        subject='Datagrams of discovery.',
        good=[
            good('a query', 1, 7),
            good('a query in domain 0', 1, 0),
            good('an answer of nobody', 2, 7),
            good('an answer of a registry', 2, 7, [registry]),
            good('an answer of a server in domain 255', 2, 255, [server]),
            good('as many services as fit', 2, 7, [registry] + [server] * 29),
        ],
        bad=[
            bad('no bytes', size=0),
            bad('a byte less', size=SIZE - 1),
            bad('a byte more', size=SIZE + 1),
            bad('another magic', magic=b'RTPE'),
            bad('version 0', version=0),
            bad('version 2', version=2),
            bad('kind 0', 0),
            bad('kind 3', 3),
            bad('a query with a service', 1, services=[server]),
            bad('a query that counts a service', 1, count=1),
            bad('more services than fit', 2, count=31),
            bad('a service that is not there', 2, count=1),
            bad('port 0', 2, services=[(0, 2, 0, 1)]),
            bad('a service of kind 0', 2, services=[(7420, 0, 0, 1)]),
            bad('a service of kind 3', 2, services=[(7420, 3, 0, 1)]),
            bad('a reserved byte', 2, services=[(7420, 1, 1, 1)]),
            bad('a service that is not counted', 2, count=0, services=[registry]),
            bad('the last byte of a query', 1, tail=b'\1'),
        ])
