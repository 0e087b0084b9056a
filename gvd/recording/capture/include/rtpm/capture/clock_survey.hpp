#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/recording/mcap.hpp"
#include "rtpm/recording/recorder.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/wire/clock_sync.hpp"

namespace rtpm::capture {

/// The clock of a server, as this program sees it.
struct ServerClock {
  std::string server;                      ///< "rtpm://127.0.0.1:7421".
  std::vector<std::string> names{};        ///< Names of its objects.
  std::optional<wire::PeerClock> clock{};  ///< nullopt: no estimate, see `problem`.
  Duration trip = Duration::max();         ///< The shortest way there and back.
  std::string problem{};                   ///< Why the newest ping failed; empty if it did not.
};

/// Compares the clocks of servers with this host's, by pings.
/// @ownership refers to its node, which must outlive it
/// @threads  one
/// @realtime none
class ClockSurvey {
 public:
  /// @param deadline  bounds each ping
  explicit ClockSurvey(rpc::Node& node, Duration deadline = std::chrono::milliseconds{100});
  ClockSurvey(ClockSurvey&&) noexcept;
  ~ClockSurvey();

  /// Adds the server of an object; of a known server only the name is new.
  void add(std::string_view name, const std::string& url);
  /// Adds the servers of all devices that the name service `registry` knows.
  /// @errors those of names::Directory::list()
  [[nodiscard]] expected<void, SetupError> add_devices(const std::string& registry);
  /// Pings each server `count` times; one that does not answer, once.
  void measure(std::uint32_t count = 8);
  /// In the order of add().
  [[nodiscard]] std::span<const ServerClock> clocks() const noexcept;

 private:
  struct Peer;
  rpc::Node& node_;
  Duration deadline_;
  std::vector<ServerClock> clocks_{};
  std::vector<std::unique_ptr<Peer>> peers_{};  ///< By index like clocks_.
};

/// The metadata "rtpm.clocks" of a recording: offset, uncertainty and drift of each name's clock
/// against the recorder's, and the recorder's between monotonic time and log time.
/// @param when  "begin" or "end" of the recording
[[nodiscard]] recording::Metadata clock_metadata(const ClockSurvey& survey,
                                                 const recording::Recorder& recorder,
                                                 std::string_view when);

}  // namespace rtpm::capture
