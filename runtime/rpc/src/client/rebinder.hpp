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

/// Looks up where the names of a node's bindings lead when their servers are gone, on a time-shared
/// thread "rtpm-rebind", one name after the other. The bindings of a name share one look: the first
/// comes at once, further ones after kFirstInterval, doubled up to kLongestInterval for as long as
/// the name leads to no server that takes the binding.
/// @threads  wake() any; the rest by threads that are not real-time
class Rebinder {
 public:
  /// The shortest interval between two looks for a name,
  static constexpr Duration kFirstInterval = std::chrono::seconds{1};
  /// and the longest one in an outage.
  static constexpr Duration kLongestInterval = std::chrono::seconds{4};
  /// An outage that begins so long after the last look is a new one.
  static constexpr Duration kCalm = std::chrono::seconds{10};
  /// The shortest interval for a name that is known to lead elsewhere.
  static constexpr Duration kPromptInterval = std::chrono::milliseconds{50};
  /// How long one look may take, without the bind that follows.
  static constexpr Duration kResolveDeadline = std::chrono::seconds{1};

  explicit Rebinder(Node::Impl& node) noexcept : node_(node) {}
  Rebinder(const Rebinder&) = delete;
  Rebinder& operator=(const Rebinder&) = delete;
  ~Rebinder();

  /// Follows the binding's name from now on; the first one starts the thread.
  [[nodiscard]] expected<void, SetupError> add(Binding::Impl& binding);
  /// Waits until the thread is done with the binding.
  void remove(Binding::Impl& binding) noexcept;
  /// A binding asks for its name.
  /// @realtime alloc-free, at most one syscall
  void wake() noexcept { bell_.post(); }
  /// Does the work of Node::look_again().
  void look_again(std::string_view name) noexcept;
  /// Takes another resolver, null for none, and waits until no one asks the former.
  void use(Resolver* resolver) noexcept;
  [[nodiscard]] Resolver* resolver() const noexcept {
    return resolver_.load(std::memory_order_acquire);
  }

 private:
  struct Name {
    std::vector<Binding::Impl*> bindings{};
    MonotonicTime last{};  ///< When it was looked up.
    Duration interval = kFirstInterval;
    bool leads_elsewhere = false;  ///< Since the last look; it waits for no interval.
    [[nodiscard]] bool is_wanted() const noexcept;
  };
  using Names = std::map<std::string, Name>;
  using Lock = std::unique_lock<rt::PiMutex>;

  void run();
  [[nodiscard]] MonotonicTime serve(Lock& lock);
  void look_up(Lock& lock, const std::string& name);
  void bind(Lock& lock, const std::string& name, const expected<std::string, SetupError>& url);

  Node::Impl& node_;
  std::atomic<Resolver*> resolver_{nullptr};
  rt::Semaphore bell_;
  rt::PiMutex mutex_;
  /// The thread holds it, without mutex_, while it asks the resolver or binds: as long as current_
  /// or is_asking_ says so. Taken while holding mutex_ by the thread only.
  rt::PiMutex working_;
  Names names_;
  bool is_stopping_ = false;
  Binding::Impl* current_ = nullptr;  ///< The binding that the thread binds now.
  bool is_asking_ = false;            ///< The thread is in the resolver.
  rt::Thread thread_;
};

}  // namespace rtpm::rpc
