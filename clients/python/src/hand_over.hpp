#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "rtpm/base/priority.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rpc/caller.hpp"
#include "rtpm/rpc/servant.hpp"
#include "rtpm/schema/model.hpp"

namespace rtpm::python {

/// A call that a lane received, for a worker of Python.
/// @ownership move-only; ends the call as failed when destroyed without an answer
struct Call {
  std::size_t object = 0;  ///< Which of the server's objects.
  std::size_t method = 0;  ///< The index in its service.
  std::vector<std::byte> request{};
  MonotonicTime deadline = kNever;
  Priority priority{};
  std::uint64_t trace_id = 0;
  std::uint64_t session = 0;
  rpc::CallerHost caller{};
  std::string caller_name{};  ///< In the grants; empty without one.
  rpc::DeferredReply reply{};
  rpc::ItemWriter items{};  ///< In place of the reply, for a stream.
};

/// The calls that wait for a worker, the most urgent first. The lanes' limit of deferred calls
/// bounds their number.
/// @threads  any
class HandOver {
 public:
  void put(Call call) {
    const std::lock_guard lock(mutex_);
    waiting_.emplace(-int{call.priority.value()}, std::move(call));
    changed_.notify_one();
  }
  /// Waits for a call, at most for `patience`.
  [[nodiscard]] std::optional<Call> take(Duration patience) {
    std::unique_lock lock(mutex_);
    if (!changed_.wait_for(lock, patience, [this] { return !waiting_.empty(); })) return {};
    Call call = std::move(waiting_.begin()->second);
    waiting_.erase(waiting_.begin());
    return call;
  }

 private:
  std::mutex mutex_{};
  std::condition_variable changed_{};
  std::multimap<int, Call> waiting_{};  ///< Calls of one priority in order of arrival.
};

/// An object whose methods Python runs: the lane only hands the calls over.
class HandedOver final : public rpc::Servant {
 public:
  HandedOver(std::shared_ptr<HandOver> workers, std::size_t object,
             const rpc::InterfaceDescriptor& interface, const schema::Service& service)
      : workers_(std::move(workers)), object_(object), interface_(interface), service_(service) {}

  [[nodiscard]] const rpc::InterfaceDescriptor& interface() const noexcept override {
    return interface_;
  }
  rpc::DispatchResult dispatch(std::uint16_t method_id, ConstBytes request, MutableBytes reply,
                               const rpc::CallContext& context) override;

 private:
  std::shared_ptr<HandOver> workers_;
  std::size_t object_;
  const rpc::InterfaceDescriptor& interface_;
  const schema::Service& service_;
};

}  // namespace rtpm::python
