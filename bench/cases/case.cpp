#include "cases/case.hpp"

#include <array>

namespace rtpm::bench {

std::span<const Case> cases() {
  static constexpr std::array<Case, 13> kCases{{
      {"call", "48-byte calls one after the other, beside raw sockets with the same wait",
       run_call},
      {"paced", "48-byte calls at a fixed rate, timed from when each was due", run_paced},
      {"isolation",
       "a 1 kHz caller of high priority while low-priority callers saturate the server",
       run_isolation},
      {"large", "a 1 kHz caller of high priority while 1 MiB messages go to and fro below it",
       run_large},
      {"events", "32-byte events at 1 kHz through a hub to 1…256 consumers, beside a raw relay",
       run_events},
      {"ladder", "an event's way: call, callback, embedded hub, hub process, linked hubs",
       run_ladder},
      {"throughput", "48-byte calls, many on their way at a time, beside a raw UDP socket",
       run_throughput},
      {"two-node", "48-byte calls between two network namespaces, with packet loss if wanted",
       run_two_node},
      {"device", "a 1 kHz force loop through a simulated device, beside two raw echoes",
       run_device},
      {"scale", "48-byte calls while 1…1000 clients are bound, and the server's memory", run_scale},
      {"startup", "from a server's program start to the first answered call", run_startup},
      {"memory", "what a server has in memory with 0, 1 and 100 bound clients", run_memory},
      {"idle", "what CPU time an idle server takes", run_idle},
  }};
  return kCases;
}

}  // namespace rtpm::bench
