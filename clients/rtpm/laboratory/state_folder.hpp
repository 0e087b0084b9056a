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

/// A laboratory that runs on this host, from its record.
struct RunningLaboratory {
  std::string name{};
  std::string file{};
  ProcessIdentity supervisor{};
  Duration stop_patience{};             ///< The longest time of its orderly end.
  std::vector<std::string> programs{};  ///< The running programs.
};

/// The folder with the records of this user's laboratories: $XDG_RUNTIME_DIR/rtpm, or
/// /tmp/rtpm-UID. A laboratory's processes lock its file while they run. A file without a lock is
/// stale.
/// @ownership none
/// @threads  any
class StateFolder {
 public:
  /// Makes the folder if it does not exist.
  /// @errors   the system's error; the folder belongs to another user, or other users may write to
  ///           it
  [[nodiscard]] static expected<StateFolder, SetupError> open();

  [[nodiscard]] const std::string& path() const noexcept { return path_; }
  /// The running laboratories by name. Removes stale records.
  [[nodiscard]] std::vector<RunningLaboratory> list() const;
  /// The laboratory of that name; nullopt if none runs.
  [[nodiscard]] std::optional<RunningLaboratory> find(const std::string& name) const;
  [[nodiscard]] std::string record_path(const std::string& name) const;
  [[nodiscard]] std::string log_path(const std::string& name) const;

 private:
  explicit StateFolder(std::string path) : path_(std::move(path)) {}
  std::string path_;
};

/// The record of a laboratory that this process brings up, and its lock. Child processes share the
/// lock; it ends with the last of them.
/// @threads  one
class Record {
 public:
  /// @errors   a laboratory of that name runs
  [[nodiscard]] static expected<Record, SetupError> create(const StateFolder& folder,
                                                           const std::string& name);
  /// Publishes the laboratory's facts to other processes.
  void write(const RunningLaboratory& laboratory) const;
  /// Removes the file; keeps the lock.
  void remove() const;

 private:
  Record(std::string path, Handle file) : path_(std::move(path)), file_(std::move(file)) {}
  std::string path_;
  Handle file_;
};

}  // namespace rtpm::laboratory
