#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/rt/thread.hpp"
#include "rtpm/safety/flight_recorder.hpp"

namespace rtpm::deviced {

/// Writes a file with the cycles around each device fault, from its own thread.
/// @ownership refers to the recorders, which must outlive it
/// @threads  set-up: one thread
class FlightFiles {
 public:
  /// Maximum number of files per device; new files replace the oldest, also those of earlier starts.
  static constexpr std::uint64_t kFileCountMax = 16;

  explicit FlightFiles(std::string folder) : folder_(std::move(folder)) {}
  ~FlightFiles();
  FlightFiles(const FlightFiles&) = delete;
  FlightFiles& operator=(const FlightFiles&) = delete;

  /// Call this before start().
  void add(std::string device, const gvd::FlightRecorder& recorder) {
    devices_.push_back({.name = std::move(device), .recorder = &recorder});
  }
  /// Creates the folder and starts the thread; does nothing if no folder is configured.
  /// @errors   the folder can't be created
  [[nodiscard]] expected<void, SetupError> start();

 private:
  struct Device {
    std::string name{};
    const gvd::FlightRecorder* recorder = nullptr;
    std::uint64_t written_number = 0;
    std::uint64_t last_file = 0;  ///< The number of the newest file, below kFileCountMax.
  };
  void loop();
  void write_new(Device& device);
  [[nodiscard]] std::string path_of(const Device& device, std::uint64_t file) const;
  void find_last_file(Device& device) const;

  std::string folder_;
  std::vector<Device> devices_{};
  rt::Log log_{"rtpm-deviced"};
  std::atomic<bool> is_stopping_{false};
  rt::Thread thread_{};
};

}  // namespace rtpm::deviced
