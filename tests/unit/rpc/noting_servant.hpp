#pragma once

#include <atomic>
#include <mutex>
#include <vector>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"
#include "rtpm/test/echo_server.hpp"

namespace rtpm::rpc::test {

/// Records the priority and the order in which its calls run; each takes `pace`.
class NotingServant final : public Servant {
 public:
  const InterfaceDescriptor& interface() const noexcept override { return echo::kInterface; }
  DispatchResult dispatch(std::uint16_t method_id, ConstBytes, MutableBytes,
                          const CallContext& context) override {
    if (method_id == echo::kHold.id) {
      gate.pass();
    } else {
      rt::sleep_until(rt::now() + pace.load());
      const std::lock_guard lock(mutex_);
      const rt::AllowAllocationScope is_allowed;
      order_.push_back(context.priority.value());
    }
    return {};
  }
  [[nodiscard]] std::vector<int> order() {
    const std::lock_guard lock(mutex_);
    return order_;
  }
  echo::Gate gate;
  std::atomic<Duration> pace{Duration{0}};

 private:
  std::mutex mutex_;
  std::vector<int> order_;
};

}  // namespace rtpm::rpc::test
