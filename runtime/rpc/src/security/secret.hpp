#pragma once

#include <cstdint>
#include <new>
#include <utility>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/rt/secret_memory.hpp"

namespace rtpm::rpc {

/// An object in memory for secrets, which a forked child does not have. The object stays in place
/// when its Secret is moved.
template <class T>
class Secret {
 public:
  /// @realtime set-up only
  /// @errors   no memory for secrets
  template <class... Arguments>
  [[nodiscard]] static expected<Secret, SetupError> make(Arguments&&... arguments) {
    rt::SecretMemory memory(sizeof(Held));
    if (memory.bytes().empty()) {
      return setup_error("there is no memory for keys", "the system refuses it",
                         "raise the limit of the process (ulimit -v)");
    }
    ::new (static_cast<void*>(memory.bytes().data()))
        Held{T(std::forward<Arguments>(arguments)...)};
    return Secret(std::move(memory));
  }
  Secret(Secret&&) noexcept = default;
  Secret& operator=(Secret&&) = delete;
  ~Secret() {
    // A child has no object there to destroy.
    if (!memory_.bytes().empty() && is_here()) held().~Held();
  }

  [[nodiscard]] T& operator*() const noexcept { return held().object; }
  [[nodiscard]] T* operator->() const noexcept { return &held().object; }
  /// Whether the object is in this process; false in a forked child, which must not use it.
  [[nodiscard]] bool is_here() const noexcept { return held().is_here != 0; }

 private:
  struct Held {
    T object;
    std::uint64_t is_here = 1;
  };
  explicit Secret(rt::SecretMemory memory) noexcept : memory_(std::move(memory)) {}
  [[nodiscard]] Held& held() const noexcept {
    return *std::launder(reinterpret_cast<Held*>(memory_.bytes().data()));
  }

  rt::SecretMemory memory_;
};

}  // namespace rtpm::rpc
