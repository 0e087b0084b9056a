#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rpc/counters.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/interface.hpp"
#include "rtpm/rpc/security.hpp"
#include "rtpm/rpc/servant.hpp"
#include "rtpm/rpc/tap.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/rt/wait.hpp"
#include "rtpm/crypto/primitives.hpp"

namespace rtpm::rpc {

/// How an object is served.
///
/// A lane receives at its own priority; the method runs as the model says:
///
///     lanes     model       bands   legal                                  receives   runs
///     several   none        any     no: the lane would decide              -          -
///     several   declared    any     if a band has the declared priority    its lane   declared
///     several   propagated  any     if a band has the call's priority      its lane   the call's
///     one       none        no      yes                                    lane       lane
///     one       none        yes     no: nothing is said of priorities      -          -
///     one       declared    any     if a band has the declared priority    lane       declared
///     one       propagated  any     if a band has the call's priority      lane       the call's
///
/// Server::add() refuses an illegal combination; a call outside of all bands fails with kWrongBand.
/// Bands in one lane need a lane that keeps requests (LaneConfig::buffered_request_max), as other
/// lanes serve calls in the order in which they come.
/// @source   RT-CORBA's policies; here a priority need only lie within a lane's band, not be equal
///           to its own
struct ObjectOptions {
  PriorityModel model = PriorityModel::kClientPropagated;
  Priority priority = 0;  ///< Declared, or the default for callers without one.
  /// The priorities that calls may have: at most 16 bands that do not overlap. Empty for all.
  std::vector<Band> bands{};
  /// The methods check the callers' grants themselves (CallContext::identity), such as for names or
  /// event types: every caller for which there is any grant has the role observe on the object.
  bool checks_callers = false;
};

/// One lane: its own sockets and its own threads that serve the priorities from `low` up to where
/// the next lane begins.
///
/// With one thread, the default, calls run one after the other, and further calls wait in the
/// sockets. A lane of several threads, or with buffered requests, has one more thread that receives
/// while the others run calls: it orders requests by priority, and refuses those that find no slot
/// with overload.
struct LaneConfig {
  std::string name{};     ///< The thread's name, at most 15 bytes; by default "lane-<low>".
  Priority low = 0;       ///< The lowest priority it serves. One lane must begin at 0.
  Priority priority = 0;  ///< At which it waits and receives; raised to `low`.
  rt::WaitConfig wait{};  ///< How it waits for traffic.
  /// The CPUs to which it is confined; by default the starter's. With one, and where the kernel
  /// throttles real-time threads, a thread "rtpm-awake-<cpu>" at nice 19 keeps that CPU awake while
  /// a busy lane pauses to avoid throttling (rt/budget.hpp): otherwise calls of more urgent lanes
  /// would wait for the CPU to wake.
  std::vector<int> cpus{};
  /// kTimeShared: behind every real-time thread, and outside the kernel's throttling. For lanes
  /// whose calls may keep a CPU busy and are not urgent: they can't hold the lanes above them up,
  /// which may run on the same CPU at kFifo.
  rt::Schedule schedule = rt::Schedule::kFifo;
  /// How many calls run at a time, 1…64.
  std::uint32_t static_threads = 1;
  /// How many more may run while all of these are busy, 0…64: threads that are started when they
  /// are needed, which takes a time-shared thread some 100 µs, and end after `dynamic_idle`.
  std::uint32_t dynamic_threads = 0;
  Duration dynamic_idle = std::chrono::seconds{10};
  /// How many calls may wait while all threads run others, 0…4096, and how many bytes their
  /// requests may have together.
  std::uint32_t buffered_request_max = 0;
  std::uint32_t buffered_byte_max = 1024 * 1024;
};

/// How a server is set up.
struct ServerConfig {
  std::string name = "server";  ///< Shown in errors and counters.
  /// The addresses to serve: an IPv4 or IPv6 address, a host name, the name of a network interface,
  /// "localhost", a list of those, separated by ',', of at most 16 addresses; or "any", which is
  /// every address of this host. The network is an explicit choice.
  std::string host = "127.0.0.1";
  std::uint16_t port = 0;  ///< The port of UDP and TCP; 0 lets the system choose.
  /// The addresses or host names that url() gives in place of the served ones, separated by ',':
  /// for a server in a container or behind NAT. If empty, it gives the served ones, but loopback
  /// addresses only if there are no others.
  std::string advertise{};
  std::vector<LaneConfig> lanes{};  ///< Empty for one lane with all priorities.
  /// Lets a lane whose threads all run calls borrow a resting thread of a lower lane, for one call
  /// at that call's priority.
  bool borrows = false;
  PriorityTransform inbound_priority = nullptr;  ///< Null if methods run at their calls' priority.
  rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
  Priority ceiling = Priority::kHighest;  ///< The highest priority that sessions are granted.
  /// Sessions, and connections, per lane and transport. One host, or process in shared memory, has
  /// at most three quarters of them. A further one replaces the longest idle, if for 30 s.
  std::uint32_t session_count_max = 256;
  std::uint32_t message_size_max = 16 * 1024 * 1024;  ///< Bytes of a request, reply or item.
  /// How many messages larger than a frame (UDP: 1344 bytes, TCP: 64 KiB, shared memory: 16 KiB) a
  /// lane may hold at a time, per transport; 0…1024. One host holds at most three quarters of them.
  /// More requests are refused with overload, before they run; replies wait, as deferred ones. A
  /// lane takes at most (count + 1) × message_size_max bytes for them per transport, of which it
  /// touches what messages of that size have used: 33 × 16 MiB of address space by default.
  std::uint32_t large_message_count_max = 32;
  /// How many calls of a lane may be unfinished at a time, because their methods answer later or
  /// with streams; 0…4096. Each takes memory only once it is used.
  std::uint32_t deferred_call_count_max = 32;
  /// How many of them may be streams, per transport; more are refused with overload; 0…1024.
  std::uint32_t stream_count_max = 16;
  /// The most bytes of items, written and not sent, that a stream holds while its caller takes no
  /// more: beyond, write() gives kFull. A single larger item is held alone, so that items may be as
  /// large as messages; 4 KiB…16 MiB. A stream takes as much memory as it held at most: a lane's
  /// streams together deferred_call_count_max times this, or their largest items, if those are
  /// larger.
  std::uint32_t stream_byte_max = 1024 * 1024;
  /// How many oneways of callers in the same program, of at most 1344 bytes each, may wait or run
  /// in a lane at a time, as over a wire they wait in the socket's buffer; 0…4096. More are refused
  /// with overload. Each lane takes the memory for them, 1.5 KiB each, once a caller in the same
  /// program binds an object of the server. Larger ones, and with 0 all of them, each take a call
  /// channel of their caller until they ran.
  std::uint32_t local_oneway_count_max = 512;
  /// Serves callers of the same user on this host through shared memory, too.
  bool shared_memory = true;
  /// The folder of the socket for shared memory, which containers can share. If empty, the socket
  /// has an abstract name, which leaves no file and reaches as far as the network namespace.
  std::string shared_memory_folder{};
  ServerSecurity security{};
};

/// An address at which a server serves.
struct ServedAddress {
  std::string host{};        ///< "10.0.0.7", "[fd00::7]".
  std::string interface {};  ///< "eth0"; empty if not known.
};

/// Serves objects to callers over UDP, TCP and shared memory, each lane on a thread of its own.
/// @threads  create, add, start and stop from one thread; counters() and url() from any
class Server {
 public:
  /// Opens the sockets; nothing is served before start().
  /// @realtime set-up only
  /// @errors   an address in use or not this host's, a name without an address, lanes that overlap
  ///           or leave out 0, a limit outside the protocol's; other hosts reach it, and neither
  ///           grants nor `is_insecure` say which callers it serves; keys or grants that can't be
  ///           trusted
  [[nodiscard]] static expected<std::unique_ptr<Server>, SetupError> create(ServerConfig config);

  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;
  /// Stops.
  virtual ~Server() = default;

  /// Serves `servant` under `path` ("lab/arm0"), without leading slash, 1…200 bytes.
  /// @ownership `servant` must outlive stop(). Set-up only: before start()
  /// @errors   a path in use or malformed, too many objects, a declared priority above the ceiling,
  ///           options that contradict one another or the lanes
  [[nodiscard]] virtual expected<void, SetupError> add(std::string_view path, Servant& servant,
                                                       ObjectOptions options) = 0;
  /// Serves `servant` with the priority model and the priority of its schema.
  [[nodiscard]] expected<void, SetupError> add(std::string_view path, Servant& servant) {
    const InterfaceDescriptor& interface = servant.interface();
    return add(path, servant, {interface.priority_model, interface.priority, {}});
  }

  /// Starts the lanes. From then on they allocate nothing.
  /// @realtime set-up only
  /// @errors   with RealtimeMode::kRequire, a right that the process lacks
  [[nodiscard]] virtual expected<void, SetupError> start() = 0;

  /// Ends the lanes; calls that run are finished and answered first, those that are deferred, and
  /// streams, end with stopping (CallError::kStopped). Then every caller is told that the server
  /// goes, and the sockets are closed. May be called twice.
  virtual void stop() noexcept = 0;

  [[nodiscard]] virtual std::uint16_t port() const noexcept = 0;
  /// Where callers find the object: "rtpm://127.0.0.1:4711/lab/arm0", with each host of a server
  /// that has several: "rtpm://10.0.0.7,[fd00::7]:4711/lab/arm0".
  [[nodiscard]] virtual std::string url(std::string_view path) const = 0;
  /// The served addresses; for "any" as they were when the server was created.
  [[nodiscard]] virtual std::vector<ServedAddress> served_addresses() const = 0;
  /// The key by which callers know the server, see access::known_servers. Nothing if it asks
  /// nobody and seals nothing.
  [[nodiscard]] virtual std::optional<crypto::PublicKey> public_key() const noexcept = 0;
  /// The callers that it serves.
  [[nodiscard]] virtual ServedCallers served_callers() const = 0;
  /// The counts of all that was served and dropped so far, over all lanes.
  /// @realtime alloc-free
  [[nodiscard]] virtual ServerCounters counters() const noexcept = 0;
  /// Records the server's calls while it is on, see tap.hpp.
  [[nodiscard]] virtual std::shared_ptr<CallTap> tap() noexcept = 0;

 protected:
  Server() = default;
};

}  // namespace rtpm::rpc
