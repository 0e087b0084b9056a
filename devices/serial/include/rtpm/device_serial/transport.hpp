#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"

namespace rtpm::device_serial {

/// Result of Transport::send() and receive().
struct Transferred {
  std::size_t size = 0;    ///< Bytes.
  bool is_closed = false;  ///< The port is gone.
};

/// A stream of bytes to and from one board, and the clock for waiting on it.
/// @threads  one at a time; wake() any
class Transport {
 public:
  Transport() = default;
  Transport(const Transport&) = delete;
  Transport& operator=(const Transport&) = delete;
  /// Closes the port.
  virtual ~Transport() = default;

  /// Sends as many of `bytes` as the port takes without waiting.
  /// @realtime alloc-free, waits for nothing
  [[nodiscard]] virtual Transferred send(ConstBytes bytes) = 0;
  /// Waits for bytes, at most `patience` or until wake().
  /// @realtime alloc-free
  [[nodiscard]] virtual Transferred receive(MutableBytes buffer, Duration patience) = 0;
  /// Ends the receive() under way, or the next one, without bytes.
  /// @realtime alloc-free, waits for nothing
  virtual void wake() noexcept = 0;
  /// The present time; never decreases.
  [[nodiscard]] virtual MonotonicTime now() const = 0;
};

/// The choice of a board, and the speed of its line.
struct PortSettings {
  std::string port{};    ///< "/dev/ttyACM0", or a link; if empty, `serial` selects.
  std::string serial{};  ///< The USB interface's; if empty, the only board is taken.
  std::int64_t speed_baud = 115'200;
};

/// Opens the port of a board.
/// @errors   in words with the remedy
using OpenTransport =
    std::function<expected<std::unique_ptr<Transport>, SetupError>(const PortSettings&)>;

}  // namespace rtpm::device_serial
