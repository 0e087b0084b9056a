#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/rpc/binding.hpp"
#include "rtpm/rpc/error.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/rt/semaphore.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::rpc {

/// Resolves the names of a node's bindings again when their servers are gone, one name at a time,
/// on a time-shared thread "rtpm-rebind". The bindings of a name share a look-up. The first happens
/// at once, further ones after kFirstInterval, doubled up to kLongestInterval, until the name leads
/// to a server that accepts the binding.
/// @threads  wake(): any; the rest: threads that are not real-time
class Rebinder {
 public:
  /// The shortest interval between two look-ups of a name.
  static constexpr Duration kFirstInterval = std::chrono::seconds{1};
  /// The longest interval in an outage.
  static constexpr Duration kLongestInterval = std::chrono::seconds{4};
  /// An outage that starts this long after the last look-up counts as a new one.
  static constexpr Duration kCalm = std::chrono::seconds{10};
  /// The shortest interval for a name that is known to have moved.
  static constexpr Duration kPromptInterval = std::chrono::milliseconds{50};
  /// How long a look-up may take, without the bind that follows.
  static constexpr Duration kResolveDeadline = std::chrono::seconds{1};

  Rebinder() = default;
  Rebinder(const Rebinder&) = delete;
  Rebinder& operator=(const Rebinder&) = delete;
  ~Rebinder();

  /// Follows the binding's name from now on. The first call starts the thread.
  [[nodiscard]] expected<void, SetupError> add(Binding::Impl& binding);
  /// Waits until the thread no longer uses the binding.
  void remove(Binding::Impl& binding) noexcept;
  /// Requests a look-up for a binding.
  /// @realtime alloc-free, at most one syscall
  void wake() noexcept { bell_.post(); }
  /// Implements Node::look_again().
  void look_again(std::string_view name) noexcept;
  /// Replaces the resolver (null for none) and waits until the previous one is no longer in use.
  void use(Resolver* resolver) noexcept;
  [[nodiscard]] Resolver* resolver() const noexcept {
    return resolver_.load(std::memory_order_acquire);
  }

 private:
  struct Name {
    std::vector<Binding::Impl*> bindings{};
    MonotonicTime last{};  ///< When the name was last looked up.
    Duration interval = kFirstInterval;
    /// The name has moved since the last look-up; skips the interval.
    bool leads_elsewhere = false;
    [[nodiscard]] bool is_wanted() const noexcept;
  };
  using Names = std::map<std::string, Name>;
  using Lock = std::unique_lock<rt::PiMutex>;

  void run();
  [[nodiscard]] MonotonicTime serve(Lock& lock);
  void look_up(Lock& lock, const std::string& name);
  void bind(Lock& lock, const std::string& name, const expected<std::string, SetupError>& url);

  std::atomic<Resolver*> resolver_{nullptr};
  rt::Semaphore bell_;
  rt::PiMutex mutex_;
  /// The thread holds it, without mutex_, while it resolves or binds, see current_ and is_asking_.
  /// Only the thread may take it while holding mutex_.
  rt::PiMutex working_;
  Names names_;
  bool is_stopping_ = false;
  Binding::Impl* current_ = nullptr;  ///< The binding that the thread binds now.
  bool is_asking_ = false;            ///< The thread is inside the resolver.
  rt::Thread thread_;
};

}  // namespace rtpm::rpc
