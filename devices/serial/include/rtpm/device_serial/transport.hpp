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
  std::size_t size = 0;    ///< Number of bytes.
  bool is_closed = false;  ///< The port is gone.
};

/// A byte stream to and from one board, and the clock for waiting on it.
/// @threads  one at a time; wake(): any thread
class Transport {
 public:
  Transport() = default;
  Transport(const Transport&) = delete;
  Transport& operator=(const Transport&) = delete;
  /// Closes the port.
  virtual ~Transport() = default;

  /// Sends as many of `bytes` as the port accepts without waiting.
  /// @realtime alloc-free, does not wait
  [[nodiscard]] virtual Transferred send(ConstBytes bytes) = 0;
  /// Waits for bytes for at most `patience`, or until wake() is called.
  /// @realtime alloc-free
  [[nodiscard]] virtual Transferred receive(MutableBytes buffer, Duration patience) = 0;
  /// Makes the current receive(), or the next one, return without bytes.
  /// @realtime alloc-free, does not wait
  virtual void wake() noexcept = 0;
  /// The current time; never decreases.
  [[nodiscard]] virtual MonotonicTime now() const = 0;
};

/// Selects a board and the speed of its line.
struct PortSettings {
  /// For example "/dev/ttyACM0", or a link; if empty, `serial` selects the board.
  std::string port{};
  /// The serial number of the USB interface; if empty, the only board is used.
  std::string serial{};
  std::int64_t speed_baud = 115'200;
};

/// Opens the port of a board.
/// @errors   described in words with the remedy
using OpenTransport =
    std::function<expected<std::unique_ptr<Transport>, SetupError>(const PortSettings&)>;

}  // namespace rtpm::device_serial
