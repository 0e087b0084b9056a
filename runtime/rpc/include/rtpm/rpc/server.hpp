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
#include "rtpm/crypto/primitives.hpp"
#include "rtpm/rpc/counters.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rpc/interface.hpp"
#include "rtpm/rpc/security.hpp"
#include "rtpm/rpc/servant.hpp"
#include "rtpm/rpc/tap.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/rt/wait.hpp"

namespace rtpm::rpc {

/// How an object is served.
///
/// A lane receives at its own priority; the method runs as the priority model says:
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
/// Server::add() refuses an illegal combination; a call outside all bands fails with kWrongBand.
/// If the server has one lane, bands require that it has buffered requests
/// (LaneConfig::buffered_request_max) or several threads, or that the server borrows; another
/// single lane serves calls in order of arrival.
/// @source   RT-CORBA's policies; here a priority must only lie within a lane's band, not equal its
///           priority
struct ObjectOptions {
  PriorityModel model = PriorityModel::kClientPropagated;
  Priority priority = 0;  ///< The declared priority, or the default for callers without one.
  /// The priorities that calls may have: at most 16 disjoint bands. Empty for all.
  std::vector<Band> bands{};
  /// The methods check the callers' grants themselves (CallContext::identity), such as for names or
  /// event types. Every caller with any grant gets the role observe on the object.
  bool checks_callers = false;
};

/// One lane: its own sockets and threads, which serve the priorities from `low` up to the next
/// lane's `low`.
///
/// With one thread, the default, calls run one at a time, and further calls wait in the sockets. A
/// lane with several threads, or with buffered requests, has an extra thread that receives while
/// the others run calls: it orders requests by priority, and refuses with overload when all slots
/// are taken.
struct LaneConfig {
  std::string name{};     ///< The thread's name, at most 15 bytes; by default "lane-<low>".
  Priority low = 0;       ///< The lowest priority that it serves. One lane must start at 0.
  Priority priority = 0;  ///< The priority at which it waits and receives; raised to `low`.
  rt::WaitConfig wait{};  ///< How it waits for traffic.
  /// The CPUs that the lane is confined to; by default those of the starting thread. With one CPU,
  /// and where the kernel throttles real-time threads, a thread "rtpm-awake-<cpu>" at nice 19 keeps
  /// that CPU awake while a busy lane pauses to avoid throttling (rt/budget.hpp). Otherwise calls
  /// of more urgent lanes would wait for the CPU to wake.
  std::vector<int> cpus{};
  /// kTimeShared: below every real-time thread, and exempt from the kernel's throttling. For lanes
  /// whose calls are not urgent but may keep a CPU busy: they can't delay kFifo lanes on the same
  /// CPU.
  rt::Schedule schedule = rt::Schedule::kFifo;
  /// How many calls may run concurrently, 1…64.
  std::uint32_t static_threads = 1;
  /// How many more may run while all static threads are busy, 0…64. These threads start on demand,
  /// which takes a time-shared thread about 100 µs, and end after `dynamic_idle`.
  std::uint32_t dynamic_threads = 0;
  Duration dynamic_idle = std::chrono::seconds{10};
  /// How many calls may wait while all threads are busy, 0…4096, and how many bytes their requests
  /// may have together.
  std::uint32_t buffered_request_max = 0;
  std::uint32_t buffered_byte_max = 1024 * 1024;
};

/// The configuration of a server.
struct ServerConfig {
  std::string name = "server";  ///< Shown in errors and counters.
  /// The addresses to serve: up to 16 IPv4 or IPv6 addresses, host names, network interfaces or
  /// "localhost", separated by ','; or "any" for every address of this host. Serving the network is
  /// an explicit choice.
  std::string host = "127.0.0.1";
  std::uint16_t port = 0;  ///< The port for UDP and TCP; 0 lets the system choose.
  /// The addresses or host names that url() gives in place of the served ones, separated by ',':
  /// for a server in a container or behind NAT. If empty, url() gives the served addresses, but
  /// loopback only if there are no others.
  std::string advertise{};
  std::vector<LaneConfig> lanes{};  ///< Empty for one lane that serves all priorities.
  /// Lets a lane whose threads are all busy borrow an idle thread of a lower lane, for one call, at
  /// that call's priority.
  bool borrows = false;
  PriorityTransform inbound_priority = nullptr;  ///< Null if methods run at the call's priority.
  rt::RealtimeMode realtime = rt::RealtimeMode::kPrefer;
  Priority ceiling = Priority::kHighest;  ///< The highest priority that sessions are granted.
  /// The maximum number of sessions, and of connections, per lane and transport. One host, or one
  /// process in shared memory, gets at most three quarters of them. A further one replaces the
  /// longest-idle one if it has been idle for 30 s.
  std::uint32_t session_count_max = 256;
  /// The largest request, reply or item in bytes.
  std::uint32_t message_size_max = 16 * 1024 * 1024;
  /// How many messages larger than a frame (UDP: 1344 bytes, TCP: 64 KiB, shared memory: 16 KiB) a
  /// lane may hold at a time, per transport; 0…1024. One host holds at most three quarters of them.
  /// Further requests are refused with overload before they run; further replies wait, as deferred
  /// ones. A lane reserves at most (count + 1) × message_size_max bytes for them per transport (by
  /// default 33 × 16 MiB of address space), but only touches what messages have used.
  std::uint32_t large_message_count_max = 32;
  /// How many calls of a lane may be unfinished at a time because their methods answer later or
  /// with streams; 0…4096. Each takes memory only once used.
  std::uint32_t deferred_call_count_max = 32;
  /// How many of these may be streams, per transport; 0…1024. More are refused with overload.
  std::uint32_t stream_count_max = 16;
  /// The most bytes of written but unsent items that a stream holds, 4 KiB…16 MiB; beyond it,
  /// write() returns kFull. A single larger item is accepted if nothing else is held, so that items
  /// may be as large as messages. A stream keeps the memory of its peak; all streams of a lane take
  /// at most deferred_call_count_max times this limit, or their largest items, if those are larger.
  std::uint32_t stream_byte_max = 1024 * 1024;
  /// How many oneways from callers in the same program, of at most 1344 bytes each, may wait or run
  /// in a lane at a time; 0…4096. It corresponds to the socket's buffer of other transports. More
  /// are refused with overload. Each lane allocates 1.5 KiB per oneway once a caller in the same
  /// program binds an object of the server. Larger oneways, or all of them if this is 0, each
  /// occupy a call channel of their caller until they have run.
  std::uint32_t local_oneway_count_max = 512;
  /// Also serves callers of the same user on this host through shared memory.
  bool shared_memory = true;
  /// The folder of the shared-memory socket, which containers can share. If empty, the socket has
  /// an abstract name: it leaves no file and is visible within the network namespace only.
  std::string shared_memory_folder{};
  ServerSecurity security{};
};

/// An address at which a server serves.
struct ServedAddress {
  std::string host{};        ///< "10.0.0.7", "[fd00::7]".
  std::string interface {};  ///< "eth0"; empty if unknown.
};

/// Serves objects to callers over UDP, TCP and shared memory, each lane on its own thread.
/// @threads  create, add, start and stop from one thread; counters() and url() from any
class Server {
 public:
  /// Opens the sockets; serves nothing before start().
  /// @realtime set-up only
  /// @errors   an address that is in use or not of this host; a name without an address; lanes that
  ///           overlap or leave out 0; a value outside the protocol's limits; other hosts reach it,
  ///           but neither grants nor `is_insecure` are set; keys or grants that can't be trusted
  [[nodiscard]] static expected<std::unique_ptr<Server>, SetupError> create(ServerConfig config);

  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;
  /// Stops the server.
  virtual ~Server() = default;

  /// Serves `servant` under `path` ("lab/arm0"), without leading slash, 1…200 bytes.
  /// @ownership `servant` must outlive stop(). Set-up only: before start()
  /// @errors   a path that is in use or malformed, too many objects, a declared priority above the
  ///           ceiling, options that contradict one another or the lanes
  [[nodiscard]] virtual expected<void, SetupError> add(std::string_view path, Servant& servant,
                                                       ObjectOptions options) = 0;
  /// Serves `servant` with the priority model and priority of its schema.
  [[nodiscard]] expected<void, SetupError> add(std::string_view path, Servant& servant) {
    const InterfaceDescriptor& interface = servant.interface();
    return add(path, servant, {interface.priority_model, interface.priority, {}});
  }

  /// Starts the lanes. They allocate nothing from then on.
  /// @realtime set-up only
  /// @errors   with RealtimeMode::kRequire, the process lacks a right
  [[nodiscard]] virtual expected<void, SetupError> start() = 0;

  /// Stops the lanes. Running calls are finished and answered first; in a lane with several
  /// threads, callers of those that still run after 1 s get CallError::kStopped. Deferred calls and
  /// streams end with CallError::kStopped. Then it notifies every caller and closes the sockets.
  /// May be called twice.
  virtual void stop() noexcept = 0;

  [[nodiscard]] virtual std::uint16_t port() const noexcept = 0;
  /// The object's URL: "rtpm://127.0.0.1:4711/lab/arm0"; for a server with several hosts,
  /// "rtpm://10.0.0.7,[fd00::7]:4711/lab/arm0".
  [[nodiscard]] virtual std::string url(std::string_view path) const = 0;
  /// The served addresses; for "any" as they were when the server was created.
  [[nodiscard]] virtual std::vector<ServedAddress> served_addresses() const = 0;
  /// The key by which callers know the server, see access::known_servers; nullopt if it neither
  /// authenticates callers nor seals sessions.
  [[nodiscard]] virtual std::optional<crypto::PublicKey> public_key() const noexcept = 0;
  /// The callers that the server accepts.
  [[nodiscard]] virtual ServedCallers served_callers() const = 0;
  /// The counts of everything served and dropped so far, over all lanes.
  /// @realtime alloc-free
  [[nodiscard]] virtual ServerCounters counters() const noexcept = 0;
  /// Records the server's calls while switched on, see tap.hpp.
  [[nodiscard]] virtual std::shared_ptr<CallTap> tap() noexcept = 0;

 protected:
  Server() = default;
};

}  // namespace rtpm::rpc
