#pragma once

#include <gtest/gtest.h>

#include <deque>
#include <mutex>
#include <utility>

#include "rtpm/rt/memory.hpp"
#include "rtpm/test/echo_server.hpp"

namespace rtpm::rpc::test {

/// Defers each reply until the test takes and completes it.
class DeferringServant final : public Servant {
 public:
  const InterfaceDescriptor& interface() const noexcept override { return echo::kInterface; }
  DispatchResult dispatch(std::uint16_t, ConstBytes, MutableBytes,
                          const CallContext& context) override {
    DeferredReply reply = context.deferral->defer();
    if (!reply) return {wire::Status::kOverload, 0};
    const std::lock_guard lock(mutex_);
    const rt::AllowAllocationScope is_allowed;
    replies_.push_back(std::move(reply));
    return {};
  }
  [[nodiscard]] DeferredReply reply() {
    DeferredReply first;
    EXPECT_TRUE(await([&] {
      const std::lock_guard lock(mutex_);
      if (replies_.empty()) return false;
      first = std::move(replies_.front());
      replies_.pop_front();
      return true;
    }));
    return first;
  }

 private:
  std::mutex mutex_;
  std::deque<DeferredReply> replies_;
};

}  // namespace rtpm::rpc::test
