#include "security/exposure.hpp"

#include <algorithm>
#include <utility>

#include "rtpm/access/files.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::rpc {

bool is_for_other_hosts(const transport::HostsToServe& hosts) noexcept {
  return hosts.is_any ||
         std::ranges::any_of(hosts.addresses, [](const transport::InterfaceAddress& each) {
           return !each.address.is_loopback();
         });
}

expected<std::string, SetupError> grants_file_of(const ServerSecurity& security,
                                                 const transport::HostsToServe& hosts) {
  if (security.is_insecure) return std::string();
  if (!security.authorized_file.empty() || !is_for_other_hosts(hosts))
    return security.authorized_file;
  auto file = access::key_file_path({}, access::kAuthorizedFile);
  if (file && access::stamp_of(*file).is_of_file()) return std::move(*file);
  return setup_error(
      "it serves no other host until a grant names one",
      file ? printable(*file, kShownWhole) + " is not there" : file.error().reason(),
      "rtpm key authorize 'rtpm25519 KEY NAME' --role command --on '**', with the line that "
      "`rtpm key new` prints at the caller, where `rtpm key learn HOST` then makes this server "
      "known; or --insecure (ServerSecurity::is_insecure), to serve whoever reaches it");
}

OpenWarning::OpenWarning(std::string subject, const std::string& where)
    : text_("warning: " + std::move(subject) + " serves everybody who reaches " + where +
            ", as it was started insecure. Remedy: `rtpm key authorize` callers, and start it "
            "without --insecure") {}

MonotonicTime OpenWarning::tick(MonotonicTime now) {
  if (now >= next_) {
    rt::print_error("rtpm", text_);
    next_ = now + kInterval;
  }
  return next_;
}

}  // namespace rtpm::rpc
