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


FULL = (
    Part("call", "call --wait adaptive,block,spin", 60),
    Part("isolation", "isolation --samples 5000", 160),
    Part("paced", "paced --wait adaptive,block,spin,periodic --samples 5000", 130),
    Part("events", "events", 110),
    Part("call-peers", "call --peers all --wait adaptive,block --samples 10000", 90, False),
    Part("events-peers", "events --peers all --wait block --transport udp,shm --consumers 1,16,64",
         90, False),
    Part("isolation-peers", "isolation --peers all --wait block --transport udp,shm --low-callers 4 "
         "--samples 5000", 250, False),
    Part("paced-peers", "paced --peers all --wait block --transport udp,shm --samples 5000", 110,
         False),
    Part("payload", "call --payload 0,1Ki,64Ki,1Mi", 50),
    Part("paced-4k", "paced --rate 4000 --wait adaptive,periodic --samples 10000", 35),
    Part("bulk", "bulk --samples 5000", 80),
    Part("throughput", "throughput", 15),
    Part("two-node", "two-node --transport udp,tcp", 10),
    Part("two-node-loss", "two-node --transport udp --drop 5 --calls 2000", 20),
    Part("device", "device --wait adaptive,periodic --samples 5000", 75),
    Part("ladder", "ladder", 45),
    Part("memory", "memory", 3),
    Part("idle", "idle --wait adaptive,block,periodic", 30),
    Part("scale", "scale", 25),
    Part("startup", "startup", 15),
)

QUICK = (
    Part("call", "call --wait adaptive,block,spin --samples 50000", 22),
    Part("isolation", "isolation --low-callers 4 --samples 2000", 32),
    Part("paced", "paced --wait adaptive,periodic,spin --samples 1000", 20),
    Part("events", "events --transport udp,shm --consumers 1,16,64 --samples 1000", 30),
    Part("call-peers", "call --peers all --wait block --samples 5000", 15, False),
    Part("events-peers", "events --peers all --wait block --transport shm --consumers 1,16 "
         "--samples 800 --rounds 2", 12, False),
    Part("payload", "call --payload 0,1Ki,64Ki,1Mi --samples 1000", 18),
    Part("bulk", "bulk --samples 1000", 20),
    Part("throughput", "throughput --samples 100000", 5),
    Part("two-node", "two-node --transport udp,tcp", 3),
    Part("device", "device --samples 2000", 14),
    Part("ladder", "ladder --samples 400 --rounds 2", 12),
    Part("memory", "memory", 3),
    Part("idle", "idle", 10),
    Part("scale", "scale --samples 5000 --clients 1,100", 3),
    Part("startup", "startup --samples 50", 3),
)

# As the paper's section 5: 1000 calls as quickly as they go, and 1000 events 1 ms apart.
PAPER = (
    Part("paper-calls", "call --samples 1000 --rounds 1 --latencies", 2, False),
    Part("paper-two-nodes", "two-node --transport udp,tcp --calls 1000 --rounds 1 --latencies", 3,
         False),
    Part("paper-events", "events --samples 1000 --rounds 1 --consumers 1 --latencies", 25, False),
)
