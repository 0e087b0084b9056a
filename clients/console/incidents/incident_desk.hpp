#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "channels/channel_table.hpp"
#include "incidents/causes.hpp"
#include "live/callbacks.hpp"
#include "rtpm/incidents/book.hpp"
#include "rtpm/incidents/file.hpp"
#include "services/call_router.hpp"
#include "work/periodic_thread.hpp"

namespace rtpm::console {

/// The incidents: finds them in the console's state, keeps them in a file, lists and acknowledges
/// them for browsers.
/// @ownership refers to all its arguments
/// @threads  the web server's thread, except start() and stop()
class IncidentDesk {
 public:
  struct Config {
    std::string file{};                  ///< Empty: they end with the console.
    std::filesystem::path recordings{};  ///< Its disk is watched; empty: there is none.
  };
  /// @param name_of  the name of the operator at a connection; empty: has given none
  IncidentDesk(Config config, CallRouter& router, ChannelTable& channels, Post post,
               std::function<std::string(std::uint64_t)> name_of);

  /// Adds services and channel, reads the file, and starts the thread that writes it.
  /// @errors   no thread could be started; a file that can't be kept is told in state_json()
  [[nodiscard]] expected<void, SetupError> start();
  /// Takes the console's state, a few times per second.
  void observe(const nlohmann::ordered_json& state, MonotonicTime now);
  /// The `incidents` member of `console/state`.
  [[nodiscard]] nlohmann::ordered_json state_json() const;
  /// Sends the list to the subscribers of `console/incidents`.
  void publish(MonotonicTime now);
  /// Writes what is left, once no other thread runs.
  void stop();

 private:
  void list(const PendingCall& call, const nlohmann::json& request);
  void acknowledge(const PendingCall& call, const nlohmann::json& request);
  /// Writes the file, reads what others have added, and looks at the disks.
  void keep();
  void look_at_disks();
  [[nodiscard]] std::string list_json(const std::vector<const incidents::Incident*>& list) const;

  Config config_;
  CallRouter& router_;
  ChannelTable& channels_;
  Post post_;
  std::function<std::string(std::uint64_t)> name_of_;
  incidents::IncidentBook book_{};
  CauseFinder finder_{};
  std::vector<DiskSpace> disks_{};
  std::size_t torn_count_ = 0;
  std::string problem_{};  ///< Why the file is not kept.
  PeriodicThread thread_{};
  std::optional<incidents::IncidentFile> file_{};  ///< The thread's.
  std::mutex mutex_{};
  std::map<std::uint64_t, incidents::Incident> to_write_{};  ///< Guarded by `mutex_`.
};

}  // namespace rtpm::console
