#pragma once

#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/rpc/refusal.hpp"
#include "rtpm/rpc/servant.hpp"
#include "rtpm/rt/priority.hpp"
#include "rtpm/test/os.hpp"

/// An interface and its servant, written by hand so that the tests of calls need no compiler.
namespace rtpm::test::echo {

inline constexpr rpc::MethodDescriptor kEcho{1, "echo", 101, true, {}};
inline constexpr rpc::MethodDescriptor kEchoOnce{2, "echo_once", 102, false, {}};
inline constexpr rpc::MethodDescriptor kWhere{3, "where", 103, true, {}};
inline constexpr rpc::MethodDescriptor kFail{4, "fail", 104, true, {}};
inline constexpr rpc::MethodDescriptor kRefuse{5, "refuse", 105, true, {}};
inline constexpr rpc::MethodDescriptor kHold{6, "hold", 106, false, {}};
inline constexpr rpc::MethodDescriptor kGrow{7, "grow", 107, true, {}};
inline constexpr rpc::MethodDescriptor kAllocate{8, "allocate", 108, true, {}};
inline constexpr rpc::MethodDescriptor kImpatient{9, "impatient", 109, true,
                                                  std::chrono::milliseconds{30}};

inline constexpr std::array kMethods{kEcho, kEchoOnce, kWhere,    kFail,     kRefuse,
                                     kHold, kGrow,     kAllocate, kImpatient};
inline constexpr rpc::InterfaceDescriptor kInterface{"test.Echo", 4711, "by hand", kMethods};

/// The reply of `where` about its run: the servant's context, and the system's view of its thread.
struct Place {
  std::int32_t priority;
  std::int32_t current_priority;  ///< -1 if there is none.
  std::int32_t policy;
  std::int32_t level;
  std::int32_t thread;
  std::uint64_t session;
  std::uint64_t trace_id;
  std::int64_t received_ns;
  std::int64_t deadline_ns;
  std::array<char, 16> thread_name;
};

/// Lets calls of `hold` enter, and keeps them until they are released.
class Gate {
 public:
  void pass() noexcept {
    inside_count_.fetch_add(1);
    const int ticket = held_count_.fetch_add(1);
    // Bounded, so that a test that forgets to open does not hang.
    static_cast<void>(await([&] { return let_go_count_.load() > ticket; }));
    inside_count_.fetch_sub(1);
  }
  /// Releases the next call, or the one that is inside.
  void let_one_go() noexcept { let_go_count_.fetch_add(1); }
  void open() noexcept { let_go_count_.store(1 << 30); }
  [[nodiscard]] int inside_count() const noexcept { return inside_count_.load(); }

 private:
  std::atomic<int> inside_count_{0};
  std::atomic<int> held_count_{0};
  std::atomic<int> let_go_count_{0};
};

class Servant final : public rpc::Servant {
 public:
  [[nodiscard]] const rpc::InterfaceDescriptor& interface() const noexcept override {
    return kInterface;
  }

  rpc::DispatchResult dispatch(std::uint16_t method_id, ConstBytes request, MutableBytes reply,
                               const rpc::CallContext& context) override {
    run_count_.fetch_add(1);
    switch (method_id) {
      case kHold.id:
        gate_.pass();
        return give(request, reply);
      case kEcho.id:
      case kEchoOnce.id:
      case kImpatient.id:
        return give(request, reply);
      case kWhere.id: {
        const Place place = place_of(context);
        return give(std::as_bytes(std::span(&place, 1)), reply);
      }
      case kFail.id:
        // Throws std::out_of_range, like a servant with a mistake.
        return {wire::Status::kOk, static_cast<std::uint32_t>(std::string().at(request.size()))};
      case kRefuse.id:
        // The rest of the request is the reason.
        return rpc::refuse(rpc::to_status(static_cast<rpc::Refusal>(request.front())),
                           {reinterpret_cast<const char*>(request.data()) + 1, request.size() - 1},
                           reply);
      case kGrow.id: {
        const auto size = load_le<std::uint32_t>(request.data());
        if (size > reply.size()) return {wire::Status::kTooLarge, 0};
        std::ranges::fill(reply.first(size), std::byte{0x67});
        return {wire::Status::kOk, size};
      }
      case kAllocate.id: {
        // Volatile, so that no compiler removes the pair.
        char* volatile block = new char[100];
        delete[] block;
        return {};
      }
      default:
        run_count_.fetch_sub(1);
        return {wire::Status::kNoSuchMethod, 0};
    }
  }

  /// The number of methods that have begun.
  [[nodiscard]] int run_count() const noexcept { return run_count_.load(); }
  [[nodiscard]] Gate& gate() noexcept { return gate_; }

 private:
  static rpc::DispatchResult give(ConstBytes bytes, MutableBytes reply) {
    if (bytes.size() > reply.size()) return {wire::Status::kTooLarge, 0};
    std::ranges::copy(bytes, reply.begin());
    return {wire::Status::kOk, static_cast<std::uint32_t>(bytes.size())};
  }
  static Place place_of(const rpc::CallContext& context) {
    const Scheduling scheduling = scheduling_of_this_thread();
    const auto current = rt::current_priority();
    Place place{};
    place.priority = context.priority.value();
    place.current_priority = current ? current->value() : -1;
    place.policy = scheduling.policy;
    place.level = scheduling.level;
    place.thread = number_of_this_thread();
    place.session = context.session;
    place.trace_id = context.trace_id;
    place.received_ns = to_ns(context.received);
    place.deadline_ns = to_ns(context.deadline);
    name_of_this_thread().copy(place.thread_name.data(), place.thread_name.size() - 1);
    return place;
  }

  std::atomic<int> run_count_{0};
  Gate gate_;
};

}  // namespace rtpm::test::echo
