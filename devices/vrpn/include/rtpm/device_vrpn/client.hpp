#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/driver/geometry.hpp"
#include "rtpm/vrpn/message.hpp"

namespace rtpm::device_vrpn {

/// Which sensor of which server.
struct Settings {
  std::string host = "127.0.0.1";
  std::uint16_t port = vrpn::kPort;
  std::string tracker = "Tracker0";
  std::int32_t sensor = 0;
};

/// Reads "host=10.0.0.3 port=3883 tracker=Tracker0 sensor=1"; each word may be absent.
/// @errors an unknown word, or a number out of range
[[nodiscard]] expected<Settings, SetupError> read_settings(std::string_view words);

/// The newest report of the sensor.
/// @ownership plain value, trivially copyable
struct Reading {
  driver::Pose pose{};
  MonotonicTime time{};  ///< When it arrived; 0 if none did.
  std::uint64_t count = 0;
  std::uint64_t corrupt_count = 0;  ///< Reports with impossible numbers.
};

/// A client of a VRPN server, for one sensor.
/// @threads one at a time
/// @realtime none
class Client {
 public:
  explicit Client(Settings settings) : settings_(std::move(settings)) {}
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;
  ~Client() { close(); }

  /// Connects, and exchanges cookies.
  /// @errors no server, or one of another protocol
  [[nodiscard]] expected<void, SetupError> open(Duration patience);
  /// Reads what arrives; waits for at most `patience`.
  /// @return false if the connection is lost
  [[nodiscard]] bool step(Duration patience);
  void close() noexcept;
  [[nodiscard]] bool is_open() const noexcept { return socket_ >= 0; }
  [[nodiscard]] const Reading& reading() const noexcept { return reading_; }

 private:
  void take(const vrpn::Message& message);

  Settings settings_;
  int socket_ = -1;
  bool is_greeted_ = false;
  std::vector<std::byte> cookie_{};
  vrpn::Parser parser_{};
  std::map<std::int32_t, std::string> senders_{};
  std::map<std::int32_t, std::string> types_{};
  Reading reading_{};
};

}  // namespace rtpm::device_vrpn
