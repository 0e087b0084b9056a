"""What a report measures: runs of rtpm-bench, one after the other, the most telling first.

Peers block while they wait, so RTPM does beside them; those that are not built are left out.
"""

from typing import NamedTuple


class Part(NamedTuple):
    """One run of rtpm-bench. Its results are marked with `name`, its figures made in `seconds` or so.

    `joins_rows`: its results are rows of the report's own tables. Else they are marked with the
    part's name: what belongs to peers, or to the paper's measurements.
    """

    name: str
    arguments: str
    seconds: int
    joins_rows: bool = True


# As the paper's section 5: 1000 calls as quickly as they go, and 1000 events 1 ms apart.
PAPER = (
    Part("paper-calls", "call --samples 1000 --rounds 1 --latencies", 1, False),
    Part("paper-two-nodes", "two-node --transport udp,tcp --samples 1000 --rounds 1 --latencies",
         1, False),
    Part("paper-events", "events --samples 1000 --rounds 1 --consumers 1 --latencies", 12, False),
)

# Ten samples are to lie beyond each p99.9 that is told, which takes 10 000 calls: where these come
# once a millisecond, ten seconds for each contender.
FULL = (
    *PAPER,
    # What takes little time.
    Part("call", "call --wait adaptive,spin", 12),
    Part("call-block", "call --wait block --samples 20000", 9),
    Part("payload", "call --payload 0,1Ki,64Ki,1Mi", 39),
    Part("call-sealed", "call --sealed --transport udp,tcp --samples 20000", 4),
    Part("isolation-sealed", "isolation --sealed --transport udp --rate 10000 --samples 60000", 16),
    Part("memory", "memory", 1),
    Part("idle", "idle --wait adaptive,periodic", 19),
    Part("startup", "startup", 2),
    Part("throughput", "throughput", 10),
    Part("two-node", "two-node --transport udp,tcp", 1),
    Part("scale", "scale", 14),
    # What the pace of the calls makes long.
    Part("isolation", "isolation --low-callers 4 --samples 15000", 182),
    Part("paced", "paced", 62),
    Part("paced-waits", "paced --wait block,spin,periodic --samples 2000", 38),
    Part("events", "events --samples 1000", 100),
    Part("device", "device --wait adaptive,periodic --samples 1600", 20),
    Part("call-peers", "call --peers all --wait adaptive,block --samples 10000", 73, False),
    Part("isolation-peers", "isolation --peers all --wait block --transport udp,shm --low-callers 4",
         234, False),
    Part("events-peers", "events --peers all --wait block --transport udp,shm --consumers 1,16,64 "
         "--samples 1200", 70, False),
    Part("events-peers-own-hub", "events --own-hub --peers all --wait block --transport udp "
         "--consumers 1 --samples 1200", 7, False),
    Part("events-peers-own-multicast", "events --own-hub --multicast --peers all --wait block "
         "--transport udp --consumers 16 --samples 1200", 9, False),
    Part("events-peers-multicast", "events --multicast --peers cyclonedds,fastdds,lcm "
         "--wait block --transport udp --consumers 16,64 --samples 1200", 14, False),
    Part("paced-peers", "paced --peers all --wait block --transport udp,shm", 195, False),
    # What is missed least.
    Part("isolation-curve", "isolation --low-callers 0,1,16 --samples 1000", 36),
    Part("paced-4k", "paced --rate 4000 --wait adaptive,periodic --samples 6000", 20),
)

QUICK = (
    *PAPER,
    Part("call", "call --wait adaptive,spin --samples 50000", 7),
    Part("call-block", "call --wait block --samples 10000", 4),
    Part("memory", "memory", 1),
    Part("startup", "startup", 2),
    Part("throughput", "throughput --samples 100000", 3),
    Part("two-node", "two-node --transport udp,tcp", 1),
    Part("scale", "scale --samples 5000 --clients 1,100", 2),
    Part("isolation", "isolation --low-callers 4 --samples 1500", 22),
    Part("events", "events --transport udp,shm --consumers 1,16,64 --samples 1000", 26),
    Part("paced", "paced --wait adaptive,periodic,spin --samples 1600", 30),
    Part("idle", "idle", 10),
    # What a machine that has to build rtpm-bench first has no time for.
    Part("payload", "call --payload 0,1Ki,64Ki,1Mi --samples 800", 17),
    Part("call-peers", "call --peers all --wait block --samples 3000", 18, False),
    Part("events-peers", "events --peers all --wait block --transport shm --consumers 1,16 "
         "--samples 800", 12, False),
    Part("device", "device --samples 2000", 13),
)
