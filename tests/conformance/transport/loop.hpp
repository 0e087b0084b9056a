#pragma once

#include <gtest/gtest.h>
#include <poll.h>

#include <chrono>
#include <functional>
#include <string>
#include <vector>

#include "rtpm/rpc/completions.hpp"
#include "suite.hpp"

namespace rtpm::rpc::test {

/// An event loop that knows nothing but a descriptor.
class Loop {
 public:
  void run_until(const std::function<bool()>& is_over) {
    while (!is_over()) {
      ASSERT_TRUE(
          is_readable(static_cast<int>(rtpm::test::kPatience / std::chrono::milliseconds{1})));
      static_cast<void>(completions.poll());
    }
  }
  void run() {
    run_until([this] { return completions.open_count() == 0; });
  }
  [[nodiscard]] bool is_readable(int timeout_ms) {
    pollfd entry{*completions.descriptor(), POLLIN, 0};
    return poll(&entry, 1, timeout_ms) == 1;
  }
  /// A callback that keeps the reply's text, or the error's.
  auto keep() {
    return [this](const expected<ReplyLease, CallError>& reply) {
      ends.push_back(reply ? text_of(*reply) : std::string(to_string(reply.error())));
    };
  }

  Completions completions;
  std::vector<std::string> ends;
};

[[nodiscard]] inline std::string text_of(CallError error) {
  return std::string(to_string(error));
}

}  // namespace rtpm::rpc::test
