#pragma once

#include <functional>

#include "rtpm/base/time.hpp"

// Replaces the library's rt::now() and rt::sleep_until() in the program that links it. The time is
// virtual: it advances when the clock is read or a thread sleeps, and runs the events of at().
namespace rtpm::rpc::test {

/// @threads  set() and at() before the lane's thread starts or on it, everything else on it
class VirtualTime {
 public:
  /// Starts anew at 1000 s without events; each reading of the clock takes `look`.
  static void start(Duration look);
  /// Calls `event` when the time reaches `when`, within the reading or the sleep that passes it.
  static void at(MonotonicTime when, std::function<void()> event);
  /// Sleeps until `until`, or until `is_woken()` holds after an event.
  static void sleep(MonotonicTime until, const std::function<bool()>& is_woken);
};

}  // namespace rtpm::rpc::test
