#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "lane/pending.hpp"
#include "local/local.hpp"
#include "rtpm/base/ring.hpp"
#include "rtpm/rpc/counters.hpp"
#include "rtpm/rpc/lane_table.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/cpu_keeper.hpp"
#include "rtpm/rt/lazy_memory.hpp"
#include "rtpm/rt/periodic.hpp"
#include "rtpm/rt/spin_estimator.hpp"
#include "rtpm/transport/connection.hpp"
#include "rtpm/transport/datagram_batch.hpp"
#include "rtpm/transport/port_wait_set.hpp"
#include "rtpm/transport/udp.hpp"
#include "rtpm/wire/server_sessions.hpp"
#include "server/object_table.hpp"
#include "thread_pool/thread_pool.hpp"

namespace rtpm::rpc {

/// What a lane is built from.
struct LaneSetup {
  LaneConfig config{};
  Band band{};
  wire::ServerSessionsConfig sessions{};  ///< For streams; the others differ in medium and size.
  const ObjectTable* objects = nullptr;
  std::uint32_t large_message_count_max = 0;
  std::uint32_t deferred_call_count_max = 0;
  std::uint32_t stream_count_max = 0;
  std::uint32_t stream_byte_max = 0;
  std::uint32_t local_oneway_count_max = 0;
  PriorityTransform inbound_priority = nullptr;
  /// The next lower lane, if this one may borrow its threads, and those of the ones below.
  class Lane* lower = nullptr;
  bool borrows = false;                     ///< Or lends.
  std::uint32_t lendable_thread_count = 0;  ///< Of all lanes below.
  /// Of the thread that frees ended connections and starts threads.
  transport::WaitSet* acceptor_bell = nullptr;
  LaneSlot* slot = nullptr;  ///< Where others see what it does.
};

/// The runtime of one lane: its sockets, its sessions and the loop that its thread runs, or its
/// threads in turn. The thread that receives a request runs the servant and sends the reply.
/// Threads: run() on the lane's thread; adopt(), take_back() and maintain_threads() from the
/// acceptor; lend() from other lanes; stop() and counters() from any; close() when no other thread
/// uses it but for counters(); everything that is private on the one thread, or by one at a time
/// with the pool's lock.
class Lane {
 public:
  /// `wait_set`: with room for wait_source_count() sources.
  Lane(const LaneSetup& setup, transport::UdpPort port,
       std::unique_ptr<transport::PortWaitSet> wait_set);

  /// How many sources a lane of so many sessions waits for.
  [[nodiscard]] static constexpr std::size_t wait_source_count(
      std::uint32_t session_count_max) noexcept {
    return 1 + 4 * std::size_t{session_count_max};  // A connection has a socket and an event.
  }

  /// Whether the system gave the memory for large messages, streams and kept calls. Without it the
  /// lane is not to be started.
  [[nodiscard]] bool has_memory() const noexcept { return has_memory_; }
  /// Starts its threads. `keeper`: keeps the lane's CPU awake while they rest; none: it may sleep.
  /// It must outlive join().   Set-up only.   Errors: as rt::Thread::start().
  [[nodiscard]] expected<void, rt::RealtimeError> start(rt::RealtimeMode realtime,
                                                        rt::CpuKeeper* keeper);
  /// Serves until stop(), if the lane has but one thread.   RT: alloc-free.
  void run() noexcept;
  void stop() noexcept;
  /// After stop(): waits until its threads have ended.
  void join() noexcept;
  /// Starts the dynamic thread that is wanted, and joins those that have ended.   Set-up only.
  void maintain_threads() noexcept;
  /// After its threads have ended: closes the sockets, so that callers see at once that nobody
  /// serves them.
  void close() noexcept;

  /// Gives the lane an accepted connection; false if too many wait already.
  [[nodiscard]] bool adopt(std::unique_ptr<transport::Connection>& stream) noexcept;
  /// A connection that ended, to be freed where freeing is allowed; or null.
  [[nodiscard]] std::unique_ptr<transport::Connection> take_back() noexcept;

  /// Where calls of the same program come in.
  [[nodiscard]] const std::shared_ptr<LocalGate>& gate() const noexcept { return gate_; }
  /// On a thread that runs a method for this lane: runs another one inside of it.   RT: alloc-free.
  [[nodiscard]] DispatchResult run_nested(const LocalChannel& channel) noexcept;

  [[nodiscard]] const Band& band() const noexcept { return band_; }
  [[nodiscard]] const LaneConfig& config() const noexcept { return config_; }
  [[nodiscard]] ServerCounters counters() const noexcept {
    return slot_.sample.read().value_or(LaneSample{}).counters;
  }

 private:
  struct Connection {
    std::unique_ptr<transport::Connection> stream;
    std::uint32_t generation = 0;  ///< Of the connections that stood here, one after the other.
    wire::PeerAddress peer{};
    MonotonicTime heard{};  ///< When its last frame came, or it itself.
    bool is_memory = false;
    bool has_leftovers = false;  ///< It stands in leftovers_.
  };
  /// The peer's `port`: the index in the low bits, so that the connection is found at once, and the
  /// generation above. There are at most twice as many as sessions, of which there are 65 535.
  static constexpr std::uint32_t kIndexBits = 17;
  static constexpr std::uint32_t kIndexMask = (1U << kIndexBits) - 1;
  /// Index into connections_, or kUdp, or kLocal: the calls of the same program.
  using Source = std::uint64_t;
  static constexpr Source kUdp = ~std::uint64_t{0} - 1;
  static constexpr Source kLocal = ~std::uint64_t{0} - 2;
  static constexpr transport::SourceKind kPort{1};
  static constexpr transport::SourceKind kConnection{2};
  static constexpr transport::SourceKind kConnectionEvent{3};

  void step(MonotonicTime& spin_end) noexcept;
  void after_work() noexcept;
  void keep_cpu_awake(MonotonicTime until) noexcept;
  void nap(MonotonicTime until) noexcept;
  [[nodiscard]] bool turn() noexcept;
  [[nodiscard]] bool look_around(MonotonicTime until) noexcept;
  [[nodiscard]] bool sleep_to_next_turn() noexcept;
  void rest_if_spent(MonotonicTime now) noexcept;
  void nap_if_overdue(MonotonicTime received) noexcept;
  [[nodiscard]] Duration spin_time(MonotonicTime now) noexcept;
  [[nodiscard]] MonotonicTime next_time() const noexcept;
  [[nodiscard]] bool is_look_due(bool has_served) noexcept;
  void linger() const noexcept;
  [[nodiscard]] bool is_memory_look_due() const noexcept;
  void serve_ready(transport::SourceTag tag, bool& has_served) noexcept;
  [[nodiscard]] transport::SourceTag tag_of(Source source,
                                            transport::SourceKind kind) const noexcept;
  [[nodiscard]] bool watch(Source source) noexcept;
  void unwatch(Source source) noexcept;
  [[nodiscard]] std::size_t connection_count() const noexcept {
    return memory_sources_.size() + stream_sources_.size();
  }
  [[nodiscard]] bool announce_sleep() noexcept;
  void end_sleep() noexcept;
  /// A look at it is no syscall.
  [[nodiscard]] bool is_memory(Source source) const noexcept {
    return source == kLocal || (source != kUdp && connections_[source].is_memory);
  }
  [[nodiscard]] bool serve_memory(std::size_t look_count) noexcept;
  [[nodiscard]] bool serve_one(Source source) noexcept;
  [[nodiscard]] bool has_leftovers() const noexcept {
    return !leftovers_.empty() || !batch_.is_empty();
  }
  [[nodiscard]] bool serve_leftovers() noexcept;
  [[nodiscard]] bool serve_datagrams() noexcept;
  void serve_datagram(ConstBytes frame, const wire::PeerAddress& peer, bool has_more) noexcept;
  [[nodiscard]] bool is_quick(const wire::Header& call) const noexcept {
    return call.service == quick_service_ && call.method == quick_method_;
  }
  void note_pace(const wire::Header& call) noexcept;
  void answer(const wire::PeerAddress& peer, ConstBytes frame, bool has_more) noexcept;
  void flush_answers() noexcept;
  [[nodiscard]] bool serve_stream(Source source) noexcept;
  [[nodiscard]] ConstBytes run_request(wire::ServerSessions& sessions,
                                       const wire::Request& request) noexcept;
  [[nodiscard]] ConstBytes run_without_room(wire::ServerSessions& sessions,
                                            const wire::Request& request) noexcept;
  [[nodiscard]] ConstBytes run_accepted(wire::ServerSessions& sessions,
                                        const wire::Request& request) noexcept;
  [[nodiscard]] DispatchResult dispatch(const wire::Request& request, MutableBytes reply,
                                        Deferral& deferral) noexcept;
  [[nodiscard]] expected<const Object*, wire::Status> target_of(
      const wire::Request& request) const noexcept;
  void send(wire::ServerSessions& sessions, const wire::PeerAddress& peer,
            ConstBytes frame) noexcept;
  void after_frame(std::uint32_t credit_tag) noexcept;
  [[nodiscard]] bool serve_pending() noexcept;
  void serve_pending_call(PendingCall& call) noexcept;
  [[nodiscard]] bool send_items(PendingCall& call) noexcept;
  [[nodiscard]] bool send_item_frame(PendingCall& call, std::uint32_t number,
                                     Connection* connection) noexcept;
  [[nodiscard]] Connection* connection_of(const wire::PeerAddress& peer) noexcept;
  void retry_blocked(MonotonicTime now) noexcept;
  [[nodiscard]] bool send_backlog() noexcept;
  [[nodiscard]] bool look_at_others() noexcept;
  void tell_cancelled(CallEnding why) noexcept;
  [[nodiscard]] bool look_at_pending() noexcept;
  void look_at_time() noexcept;
  [[nodiscard]] bool has_freed_room() noexcept;
  void serve_waiting_replies() noexcept;
  [[nodiscard]] bool must_wait_for_room(PendingCall& call, MonotonicTime now) noexcept;
  void note_end(const wire::Request& request, wire::Status status, MonotonicTime now) noexcept;
  void say_goodbye() noexcept;
  [[nodiscard]] Priority priority_of(const Object& object,
                                     const wire::Header& header) const noexcept;
  [[nodiscard]] DispatchResult run_servant(const Object& object, const wire::Request& request,
                                           MutableBytes reply, Deferral& deferral,
                                           bool& has_thrown) noexcept;
  [[nodiscard]] rt::ThreadConfig thread_config(std::uint32_t index) const;
  [[nodiscard]] expected<rt::Thread, rt::RealtimeError> start_worker(Worker& worker,
                                                                     std::uint32_t index);
  void work(Worker& me) noexcept;
  void lead() noexcept;
  void find_help() noexcept;
  [[nodiscard]] BorrowedThread borrow() noexcept;
  [[nodiscard]] bool take_in(PendingCall& call, wire::ServerSessions& sessions,
                             const wire::Request& request, const Object& object) noexcept;
  [[nodiscard]] bool find_place(PendingCall& call, const Object& object) noexcept;
  [[nodiscard]] PendingCall* take_pending() noexcept;
  [[nodiscard]] wire::Status refuse() noexcept;
  void note_queued(const wire::Request& request) noexcept;
  [[nodiscard]] DispatchResult run_now(const Object& object, const wire::Request& request,
                                       MutableBytes reply, Deferral& deferral) noexcept;
  [[nodiscard]] bool serve_local() noexcept;
  void serve_local_call(LocalChannel& channel) noexcept;
  void serve_pending_local(PendingCall& call) noexcept;
  [[nodiscard]] Lane* next_borrower() noexcept;
  void help(Lane& borrower, PendingCall* call) noexcept;
  void run_borrowed(PendingCall* call, ThreadPool& lender) noexcept;
  void run_queued(PendingCall& call, ThreadPool* lender = nullptr) noexcept;
  [[nodiscard]] ConstBytes queue_request(wire::ServerSessions& sessions,
                                         const wire::Request& request,
                                         const Object& object) noexcept;
  void end_pool() noexcept;
  void adopt_waiting() noexcept;
  [[nodiscard]] bool make_place_for(const wire::PeerAddress& host, bool is_memory,
                                    MonotonicTime now) noexcept;
  void turn_away(std::unique_ptr<transport::Connection>& stream, MonotonicTime now) noexcept;
  void retire(Source source) noexcept;
  void give_back(std::unique_ptr<transport::Connection>& stream) noexcept;
  void publish() noexcept;
  void show_config() noexcept;
  void end_cycle(MonotonicTime end) noexcept;

  LaneConfig config_;
  Band band_;
  const ObjectTable& objects_;
  PriorityTransform inbound_priority_;
  std::uint32_t number_;  ///< Among the server's lanes, by ascending band.
  Lane* lower_;
  Lane* upper_ = nullptr;
  transport::WaitSet* acceptor_bell_;
  rt::RealtimeMode realtime_ = rt::RealtimeMode::kPrefer;
  rt::CpuKeeper* keeper_ = nullptr;
  rt::Thread thread_;  ///< The one, where there is no thread pool.
  std::optional<ThreadPool> pool_;
  std::optional<transport::UdpPort> port_;  ///< None once closed.
  std::unique_ptr<transport::PortWaitSet> wait_set_;
  bool has_memory_ = false;
  rt::LazyMemory datagram_bulk_;
  rt::LazyMemory stream_bulk_;
  rt::LazyMemory memory_bulk_;
  rt::LazyMemory datagram_streams_;
  rt::LazyMemory stream_streams_;
  rt::LazyMemory memory_streams_;
  wire::ServerSessions datagram_sessions_;
  wire::ServerSessions stream_sessions_;
  wire::ServerSessions memory_sessions_;  ///< Of connections through shared memory.
  std::shared_ptr<Doorbell> bell_;
  std::shared_ptr<PendingPool> pending_;
  std::shared_ptr<LocalGate> gate_;
  std::vector<Connection> connections_;
  /// Connections with whole frames in their buffers, which wake no poll. Sized once.
  std::vector<Source> leftovers_;
  std::vector<Source> memory_sources_;  ///< Connections through shared memory. Sized once.
  std::size_t next_memory_look_ = 0;    ///< Behind whom of them the next look begins.
  std::vector<Source> stream_sources_;  ///< The others. Sized once.
  Source hot_ = kUdp;                   ///< Where the last frame came from: looked at first.
  std::uint32_t turn_count_ = 0;        ///< Without work, since the last look at the others.
  std::uint32_t turns_per_look_ = 0;
  std::uint32_t glance_count_ = 0;    ///< Turns of a lane that spins, for looks at the clock.
  std::uint32_t streak_ = 0;          ///< Frames taken from hot_ without a look at the others.
  std::uint32_t pending_streak_ = 0;  ///< The same for turns that served unfinished calls.
  /// Streams with items for which a turn had no time left, the one that waits longest first. Sized
  /// once.
  std::vector<PendingCall*> backlog_;
  std::size_t item_bytes_left_ = 0;    ///< That this turn may send of items.
  MonotonicTime retry_time_ = kNever;  ///< When streams that are blocked are tried again.
  MonotonicTime last_look_{};
  MonotonicTime last_memory_look_{};  ///< At connections through memory that are not hot.
  MonotonicTime received_{};          ///< When the last frame was taken,
  MonotonicTime completed_{};         ///< and when a call's answer was written last.
  /// Answers to datagrams that came together, to their peer.
  transport::DatagramBatch answers_ = transport::DatagramBatch::with_room();
  wire::PeerAddress answers_peer_{};
  std::uint32_t quick_service_ = wire::kSessionService;  ///< Whose last call took next to no time,
  std::uint16_t quick_method_ = 0;                       ///< and its method.
  bool is_periodic_ = false;
  bool has_rhythm_ = false;  ///< At the last look ahead.
  rt::ArrivalPredictor predictor_;
  rt::SpinEstimator spin_estimator_;
  bool is_unpublished_ = false;
  std::uint32_t waiting_reply_count_ = 0;     ///< Large ones for which there is no room yet.
  MonotonicTime waiting_reply_due_ = kNever;  ///< No room gets free before, unless by a frame.
  std::uint64_t silent_stream_count_ = 0;     ///< Of those that the sessions count as expired.
  ServerCounters counters_{};                 ///< But for the late calls that the sessions count.
  LaneSample sample_{};                       ///< But for its counters, which publish() adds.
  alignas(64) std::array<std::byte, transport::Datagrams::kSizeMax> datagrams_{};
  transport::Datagrams batch_{};  ///< What is left in datagrams_ to be served.
  alignas(64) std::array<transport::SourceTag, 64> ready_{};

  using Handover = SpscRing<std::unique_ptr<transport::Connection>, 128>;
  Handover arriving_;
  Handover leaving_;
  std::atomic<bool> has_arrivals_{false};
  std::atomic<bool> is_stopping_{false};
  LaneSlot& slot_;
};

}  // namespace rtpm::rpc
