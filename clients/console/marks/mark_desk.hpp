#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "channels/channel_table.hpp"
#include "live/callbacks.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/events/trials.hpp"
#include "rtpm/rpc/node.hpp"
#include "services/call_router.hpp"
#include "work/worker_pool.hpp"

namespace rtpm::console {

/// The newest marks that a page gets when it subscribes.
inline constexpr std::size_t kMarkCountMax = 1000;

/// Markers and trials of experiments: pushes those of browsers to the hub as rtpm.Trial, and
/// publishes all that come from there in the channel console/marks.
/// @ownership refers to all its arguments
/// @threads  the web server's thread
class MarkDesk {
 public:
  MarkDesk(rpc::Node& node, std::string hub, CallRouter& router, ChannelTable& channels,
           WorkerPool& pool, Post post);

  /// Adds the channel and the service console/mark. A mark is answered when it has come back from
  /// the hub, so every recorder of the hub's events has it, too.
  void start();
  /// Takes an event rtpm.Trial.
  void take(const HubEvent& event);
  /// Sends the kept marks to a client that has just subscribed to them.
  void greet(std::uint64_t connection_id, const foxglove::Subscribe& request);
  /// Publishes what came, and fails calls that were not confirmed. Call it a few times per second.
  void flush();

 private:
  using Json = nlohmann::ordered_json;
  struct Mark {
    std::uint64_t time_ns = 0;
    events::SourceId source = 0;
    events::Trial trial{};
  };
  struct Pending {
    std::uint64_t id = 0;  ///< The request's; 0 if it has none.
    PendingCall call{};
    events::Trial trial{};
    std::uint64_t time_ns = 0;
    MonotonicTime deadline{};
  };

  void mark(const PendingCall& call, const nlohmann::json& request);
  void push(std::uint64_t number, const events::Trial& trial, MonotonicTime origin);
  /// Completes an end by its trial's beginning.
  void complete(events::Trial& trial, std::uint64_t time_ns) const;
  [[nodiscard]] bool is_repeated(const PendingCall& call, std::uint64_t id);
  void confirm(const events::Trial& trial);
  [[nodiscard]] static Json json_of(const Mark& mark);

  rpc::Node& node_;
  std::string hub_;
  CallRouter& router_;
  ChannelTable& channels_;
  WorkerPool& pool_;
  Post post_;
  std::deque<Mark> marks_{};
  std::vector<Mark> incoming_{};                             ///< Not yet published.
  std::uint64_t omitted_count_ = 0;                          ///< Marks beyond the limits.
  std::uint64_t told_count_ = 0;                             ///< How many of them were published.
  std::deque<std::pair<std::uint64_t, Pending>> pending_{};  ///< With a number of each.
  std::uint64_t last_number_ = 0;
  std::deque<std::uint64_t> confirmed_ids_{};
  std::mutex supplier_mutex_{};
  std::optional<events::TrialSupplier> supplier_{};  ///< Guarded by `supplier_mutex_`.
};

}  // namespace rtpm::console
