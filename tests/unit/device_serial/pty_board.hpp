#pragma once

#include <atomic>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include "serial_model.hpp"

namespace rtpm::test {

/// A model of a board at the far end of a pseudo terminal, in real time.
class PtyBoard {
 public:
  /// @param resets  whether opening the port resets the board
  explicit PtyBoard(SerialFault fault = SerialFault::kNone, std::uint64_t faulty_from = 0,
                    bool resets = false);
  PtyBoard(const PtyBoard&) = delete;
  PtyBoard& operator=(const PtyBoard&) = delete;
  /// Unplugs the board.
  ~PtyBoard();

  /// The port's name for the driver.
  [[nodiscard]] const std::string& port() const { return port_; }
  /// Calls `use` with the model, between two iterations of its loop.
  void with(const std::function<void(SerialModel&)>& use);
  void unplug();
  /// Waits until the motor is off, at most 2 s.
  [[nodiscard]] bool comes_to_rest();

 private:
  void run();
  void turn();

  SerialModel model_;
  bool resets_;
  bool is_open_ = true;
  int fd_ = -1;
  std::string port_{};
  std::string link_{};
  std::mutex mutex_{};
  std::atomic<bool> is_stopping_{false};
  std::thread thread_{};
};

}  // namespace rtpm::test
