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

/// Writes a file of the cycles around each fault of the devices, from a thread of its own.
/// @ownership refers to the recorders, which must outlive it
/// @threads  set-up from one
class FlightFiles {
 public:
  /// Files per device; later files replace the oldest.
  static constexpr std::uint64_t kFileCountMax = 16;

  explicit FlightFiles(std::string folder) : folder_(std::move(folder)) {}
  ~FlightFiles();
  FlightFiles(const FlightFiles&) = delete;
  FlightFiles& operator=(const FlightFiles&) = delete;

  /// Before start().
  void add(std::string device, const gvd::FlightRecorder& recorder) {
    devices_.push_back({std::move(device), &recorder, 0});
  }
  /// Makes the folder and starts the thread; without a folder does nothing.
  /// @errors   the folder can't be made
  [[nodiscard]] expected<void, SetupError> start();

 private:
  struct Device {
    std::string name{};
    const gvd::FlightRecorder* recorder = nullptr;
    std::uint64_t written_number = 0;
  };
  void loop();
  void write_new(Device& device);

  std::string folder_;
  std::vector<Device> devices_{};
  rt::Log log_{"rtpm-deviced"};
  std::atomic<bool> is_stopping_{false};
  rt::Thread thread_{};
};

}  // namespace rtpm::deviced
