#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/access/files.hpp"
#include "rtpm/access/grants.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/transport/shared_memory.hpp"
#include "security/call_origin.hpp"

namespace rtpm::rpc {

/// A server's grants, reloaded when their file changes. The server's own user, and root, may do
/// everything on this host, unless a line names that user.
/// @threads  any; reload_if_changed() one at a time
/// @realtime alloc-free except open() and reload_if_changed(); takes a lock with priority
///           inheritance
class AccessControl final : public transport::UserPolicy,
                            public std::enable_shared_from_this<AccessControl> {
 public:
  /// @realtime set-up only
  /// @errors   the file can't be trusted, or no line of it is understood
  [[nodiscard]] static expected<std::unique_ptr<AccessControl>, SetupError> open(std::string file);

  /// Whether the server shares memory with that user. Never with 65534, which stands for users that
  /// the kernel can't name.
  [[nodiscard]] bool admits(std::uint32_t user) const noexcept override;
  /// Whether any grant applies to the caller.
  [[nodiscard]] bool knows(const CallOrigin& origin) const noexcept;
  /// Whether a session last judged in generation `since` may continue: some grant applies to it,
  /// and none was narrowed since.
  [[nodiscard]] bool keeps(const CallOrigin& origin, std::uint32_t since) const noexcept;
  /// The caller's rights on the object, name or type at `path`.
  [[nodiscard]] access::Permission permission(const CallOrigin& origin,
                                              std::string_view path) const noexcept;
  /// The highest priority that any grant gives the caller.
  [[nodiscard]] Priority ceiling(const CallOrigin& origin) const noexcept;
  /// The caller's name in the grants, truncated to the size of `to`; empty if they give none.
  [[nodiscard]] std::string_view name_of(const CallOrigin& origin,
                                         std::span<char> to) const noexcept;
  /// Changes with each change of the grants: earlier answers are then invalid.
  [[nodiscard]] std::uint32_t generation() const noexcept {
    return generation_.load(std::memory_order_acquire);
  }
  /// Reloads the file if it has changed; true if grants have changed. A file that can't be read
  /// leaves the grants in force and is reported on standard error, as are faulty lines.
  /// @realtime set-up only
  bool reload_if_changed();

  [[nodiscard]] const std::string& file() const noexcept { return file_; }

 private:
  /// A subject that lost a right in a reload.
  struct Narrowed {
    access::Subject subject{};
    std::uint32_t generation = 0;  ///< The generation that the reload started.
  };
  /// How many generations are remembered: a lane that is further behind ends all its sessions.
  static constexpr std::uint32_t kGenerationCount = 8;

  [[nodiscard]] std::vector<Narrowed> narrowed_with(const access::Grants& after) const;
  explicit AccessControl(std::string file) : file_(std::move(file)) {}
  void say_faults(const access::Authorized& read);
  [[nodiscard]] bool is_owner(const CallOrigin& origin) const noexcept;
  /// Like knows(), for a caller that holds the lock.
  [[nodiscard]] bool is_known(const CallOrigin& origin) const noexcept;

  std::string file_;
  rt::Log log_{"rtpm"};
  access::FileStamp stamp_{};
  mutable rt::PiMutex mutex_;  ///< Guards grants_ and narrowed_.
  std::unique_ptr<const access::Grants> grants_ = std::make_unique<access::Grants>();
  std::vector<Narrowed> narrowed_{};
  std::atomic<std::uint32_t> generation_{1};
};

}  // namespace rtpm::rpc
