#pragma once

#include <algorithm>
#include <cstdint>

#include "mailbox.hpp"

#include "rtpm/base/time.hpp"
#include "rtpm/driver/command.hpp"
#include "rtpm/gvd/command_lease.hpp"

namespace rtpm::gvd {

/// The outputs that the lease's holder commands. A command of outputs leaves force and motion
/// unchanged, and a force or motion setpoint whose outputs are all zero leaves the outputs
/// unchanged, so two threads can command independently.
/// @ownership a value, not copied
/// @threads  put() from any, the rest from the device's
/// @realtime like Mailbox
class HeldOutputs {
 public:
  using Values = decltype(driver::Setpoint::outputs);
  struct Command {
    std::uint64_t lease = Lease::kNobody;
    Values values{};
    MonotonicTime deadline{};
  };

  /// Stores a command that sets only outputs. The next cycle takes it, like Mailbox::put().
  template <class Allowed>
  [[nodiscard]] MailOutcome put(MailStamp stamp, const Command& command,
                                Allowed is_allowed) noexcept {
    return mailbox_.put(stamp, command, is_allowed);
  }

  /// Takes the newest command of outputs.
  void take() noexcept {
    if (const auto newest = mailbox_.take()) held_ = *newest;
  }
  /// Records a command of force or motion. If its outputs are all zero, the held outputs do not
  /// change, and last as long as the command.
  void follow(MonotonicTime now, std::uint64_t lease, const driver::Setpoint& setpoint,
              MonotonicTime deadline) noexcept {
    if (setpoint.mode == driver::CommandMode::kOff) {
      drop();
    } else if (setpoint.outputs != Values{}) {
      held_ = {lease, setpoint.outputs, deadline};
    } else if (is_live(now, lease)) {
      held_.deadline = std::max(held_.deadline, deadline);
    }
  }
  void drop() noexcept { held_ = {}; }

  [[nodiscard]] bool is_live(MonotonicTime now, std::uint64_t holder) const noexcept {
    return holder != Lease::kNobody && held_.lease == holder && now < held_.deadline;
  }
  [[nodiscard]] const Values& values() const noexcept { return held_.values; }
  [[nodiscard]] MonotonicTime deadline() const noexcept { return held_.deadline; }

 private:
  Mailbox<Command> mailbox_{};
  Command held_{};
};

}  // namespace rtpm::gvd
