#pragma once

#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>

#include "history.hpp"
#include "network.hpp"
#include "rtpm/wire/server_sessions.hpp"
#include "sealing.hpp"

namespace rtpm::sim {

inline constexpr std::uint32_t kServerPort = 4711;
/// Larger than a window of fragments.
inline constexpr std::uint32_t kMessageSizeMax = 64 * 1024;

/// How a simulated server works.
struct ServerProfile {
  std::uint32_t session_count_max = 8;
  /// If true, receives no frame while a servant runs, like a lane. Otherwise all replies are
  /// deferred, and frames are received while calls run.
  bool is_lane = true;
  Duration service_max{};                  ///< The longest that a servant runs.
  std::uint64_t failing_per_mille = 20;    ///< Calls that the servant runs and fails.
  std::size_t queue_max = 64;              ///< Datagrams in the socket's buffer.
  std::size_t large_count = 3;             ///< Buffers for large messages; 0 if it takes none.
  std::size_t stream_count = 4;            ///< Streams at a time.
  std::uint32_t item_count_max = 100;      ///< Items per stream.
  std::uint64_t large_item_per_mille = 0;  ///< Items that take fragments.
  Sealing* sealing = nullptr;              ///< Null if its sessions are not sealed.
  /// How far the clock of the client at a port is ahead; nullopt if it reads the server's clock.
  std::function<std::optional<Duration>(std::uint32_t port)> clock_offset;
};

/// One ServerSessions behind a socket, with a servant that answers each call with its own token; it
/// can be killed and restarted, or stopped in order.
class SimServer {
 public:
  SimServer(Scheduler& scheduler, Random& random, Network& network, History& history,
            const ServerProfile& profile);

  void start();
  void kill();
  /// Reports that some client has lost its grant.
  void on_revoked();
  /// Closes its clients' sessions, then is gone.
  void stop();
  [[nodiscard]] wire::FrameCounters counters() const;
  /// The number of resources held for calls that may still have a waiting caller; 0 when all is
  /// quiet.
  [[nodiscard]] std::uint32_t held_count() const;

 private:
  struct Datagram {
    Bytes frame;
    wire::PeerAddress from;
  };
  /// A call that runs.
  struct Job {
    wire::Request request{};
    History::Token token = 0;
    std::uint32_t run_number = 0;
    std::uint32_t reply_size = 0;
    wire::Status status = wire::Status::kOk;
    std::uint32_t items_left = 0;
    Bytes item{};  ///< The item being written; empty if none is.
    std::uint32_t item_number = 0;
    bool is_midway = false;  ///< Part of it was sent.
    bool is_cancelled = false;
  };
  void on_datagram(const Bytes& frame, const wire::PeerAddress& from);
  void take_up(const Datagram& datagram);
  void take_verdict(const wire::Verdict& verdict, const wire::PeerAddress& from);
  [[nodiscard]] std::optional<Duration> tolerance_of(const wire::Request& request,
                                                     const wire::PeerAddress& from);
  void plan_job(sealed::HandshakeJob& job);
  void transmit(std::uint32_t port, ConstBytes frame);
  void serve_next();
  void run(const wire::Request& request, const wire::PeerAddress& from);
  void finish(std::uint32_t tag);
  void give_items(std::uint32_t tag);
  [[nodiscard]] bool send_item(Job& job);
  void learn_of_cancelled();
  void plan_time();
  void send(const wire::PeerAddress& to, ConstBytes frame);

  Scheduler& scheduler_;
  Random& random_;
  Network& network_;
  History& history_;
  ServerProfile profile_;
  std::vector<std::byte> large_;
  std::vector<std::byte> streams_;
  std::unique_ptr<wire::ServerSessions> sessions_;
  std::unique_ptr<sealed::SealedServer> sealed_;
  /// The duration of the fastest call of a sealed session, by the real time of both clocks.
  struct Fastest {
    Duration age{};
    MonotonicTime at{};
  };
  std::map<std::uint64_t, Fastest> fastest_;
  std::uint64_t life_ = 0;  ///< Counts starts; work begun before a restart is discarded.
  bool is_busy_ = false;
  std::deque<Datagram> queue_;
  std::map<std::uint32_t, Job> jobs_;  ///< Running calls by tag.
  std::uint32_t last_tag_ = 0;
  MonotonicTime planned_ = kNever;  ///< When the sessions next get the time.
  wire::FrameCounters former_lives_{};
};

}  // namespace rtpm::sim
