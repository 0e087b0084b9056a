#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "laboratory/process.hpp"
#include "laboratory/process_tree.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::laboratory {

/// A laboratory that runs on this host, as its record says.
struct RunningLaboratory {
  std::string name{};
  std::string file{};
  ProcessIdentity supervisor{};
  Duration stop_patience{};             ///< How long its orderly end takes at most.
  std::vector<std::string> programs{};  ///< Those that run now.
};

/// Where the laboratories of this user are recorded: $XDG_RUNTIME_DIR/rtpm, else /tmp/rtpm-UID.
/// Each has a file that its processes lock as long as they run. A file without a lock is stale.
/// @ownership none
/// @threads  any
class StateFolder {
 public:
  /// Makes the folder where there is none.
  /// @errors   the system's; it belongs to another user, or others may write there
  [[nodiscard]] static expected<StateFolder, SetupError> open();

  [[nodiscard]] const std::string& path() const noexcept { return path_; }
  /// Sorted by name. Removes stale records.
  [[nodiscard]] std::vector<RunningLaboratory> list() const;
  /// Nothing: no laboratory of that name runs.
  [[nodiscard]] std::optional<RunningLaboratory> find(const std::string& name) const;
  [[nodiscard]] std::string record_path(const std::string& name) const;
  [[nodiscard]] std::string log_path(const std::string& name) const;

 private:
  explicit StateFolder(std::string path) : path_(std::move(path)) {}
  std::string path_;
};

/// The record of a laboratory that this process brings up, and its lock. Processes made by fork()
/// share the lock, which ends with the last of them.
/// @threads  one
class Record {
 public:
  /// @errors   a laboratory of that name runs
  [[nodiscard]] static expected<Record, SetupError> create(const StateFolder& folder,
                                                           const std::string& name);
  /// Tells other processes of this one.
  void write(const RunningLaboratory& laboratory) const;
  /// Removes the file; the lock stays.
  void remove() const;

 private:
  Record(std::string path, Handle file) : path_(std::move(path)), file_(std::move(file)) {}
  std::string path_;
  Handle file_;
};

}  // namespace rtpm::laboratory
