#pragma once

#include <functional>

#include "rtpm/base/time.hpp"

// Defines rt::now() and rt::sleep_until() for the program that it is linked into, in place of the
// library's: only the script and reading the clock advance the time.
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
