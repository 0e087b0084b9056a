#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "node.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/gvd/client.hpp"

namespace rtpm::python {

/// A device client whose lease is kept while Python runs.
/// @ownership keeps its node; shared by Python and by threads of set-up
/// @threads   read() and set(): any, concurrently; the others one at a time, by mutex()
class RemoteDevice {
 public:
  /// @errors those of gvd::DeviceClient::open()
  [[nodiscard]] static expected<std::shared_ptr<RemoteDevice>, SetupError> open(
      SharedNode node, const std::string& target, Duration hold, Duration patience, Duration stall);
  RemoteDevice(SharedNode node, gvd::DeviceClient client, std::string target, Duration stall);
  RemoteDevice(const RemoteDevice&) = delete;
  RemoteDevice& operator=(const RemoteDevice&) = delete;
  /// Releases the lease.
  ~RemoteDevice();

  [[nodiscard]] gvd::DeviceClient& client() noexcept { return client_; }
  [[nodiscard]] const std::string& target() const noexcept { return target_; }
  /// Held during each method of the client but read() and set().
  [[nodiscard]] std::mutex& mutex() noexcept { return mutex_; }

  /// Records that Python is alive. A hung program must not keep a device.
  void see() noexcept;
  /// Whether Python was seen within the stall time.
  [[nodiscard]] bool is_seen() const noexcept;

  /// Renews the lease from now on, while Python is seen. Call it with the mutex held.
  void keep_lease();
  /// Ends that.
  void stop_keeping();

 private:
  SharedNode node_;
  gvd::DeviceClient client_;
  std::string target_;
  Duration stall_;
  std::mutex mutex_{};
  std::atomic<std::int64_t> seen_ns_{0};
  std::mutex keeper_mutex_{};
  std::condition_variable keeper_changed_{};
  bool is_ending_ = false;
  std::thread keeper_{};
};
using SharedDevice = std::shared_ptr<RemoteDevice>;

}  // namespace rtpm::python
