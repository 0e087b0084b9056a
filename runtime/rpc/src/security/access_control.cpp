#include "security/access_control.hpp"

#include <algorithm>
#include <mutex>
#include <utility>

#include "rtpm/access/authorized.hpp"

namespace rtpm::rpc {

void AccessControl::say_faults(const access::Authorized& read) {
  for (const access::LineFault& fault : read.faults)
    log_.write(access::to_text(fault, file_) + "; this line allows nothing");
  if (read.fault_count > read.faults.size()) {
    log_.write(file_ + ": " + std::to_string(read.fault_count - read.faults.size()) +
               " more faulty lines");
  }
}

expected<std::unique_ptr<AccessControl>, SetupError> AccessControl::open(std::string file) {
  std::unique_ptr<AccessControl> control(new AccessControl(std::move(file)));
  control->stamp_ = access::stamp_of(control->file_);
  auto text = access::read_trusted_file(control->file_);
  if (!text) return unexpected{text.error()};
  access::Authorized read = access::parse_authorized(*text);
  control->say_faults(read);
  if (read.grants.empty()) {
    return setup_error("no line of '" + control->file_ + "' grants anything",
                       read.faults.empty() ? "it is empty or not there"
                                           : access::to_text(read.faults.front(), control->file_),
                       "add one with `rtpm key authorize`");
  }
  control->grants_ = std::make_unique<access::Grants>(std::move(read.grants));
  return control;
}

bool AccessControl::reload_if_changed() {
  const access::FileStamp stamp = access::stamp_of(file_);
  if (stamp == stamp_) return false;
  stamp_ = stamp;
  auto text = access::read_trusted_file(file_);
  if (!text) {
    log_.write(text.error().text() + "; the former grants stay in force");
    return false;
  }
  access::Authorized read = access::parse_authorized(*text);
  say_faults(read);
  std::unique_ptr<const access::Grants> grants =
      std::make_unique<access::Grants>(std::move(read.grants));
  std::vector<Narrowed> narrowed = narrowed_with(*grants);
  {
    const std::lock_guard lock(mutex_);
    std::swap(grants_, grants);
    std::swap(narrowed_, narrowed);
    generation_.fetch_add(1, std::memory_order_release);
  }
  return true;
}

// The narrowed rights of the last generations, and of the next one.
std::vector<AccessControl::Narrowed> AccessControl::narrowed_with(
    const access::Grants& after) const {
  const std::uint32_t next = generation() + 1;
  std::vector<Narrowed> narrowed = narrowed_;
  std::erase_if(narrowed,
                [&](const Narrowed& each) { return next - each.generation > kGenerationCount; });
  for (const access::Subject& subject : grants_->narrowed_by(after))
    narrowed.push_back({subject, next});
  // Users that had all rights until now and that the new grants name.
  for (const std::uint32_t user : {access::this_user(), std::uint32_t{0}}) {
    const access::Subject owner = origin_of_user(user).subject;
    if (!grants_->knows(owner, {}) && after.knows(owner, {})) narrowed.push_back({owner, next});
  }
  return narrowed;
}

bool AccessControl::keeps(const CallOrigin& origin, std::uint32_t since) const noexcept {
  const std::lock_guard lock(mutex_);
  if (generation() - since > kGenerationCount) return false;
  const auto is_lost = [&](const Narrowed& each) {
    return each.generation > since && each.subject == origin.subject;
  };
  return is_known(origin) && std::ranges::none_of(narrowed_, is_lost);
}

bool AccessControl::is_owner(const CallOrigin& origin) const noexcept {
  const access::Subject& subject = origin.subject;
  return subject.kind == access::Subject::Kind::kLocalUser &&
         (subject.user == access::this_user() || subject.user == 0) &&
         !grants_->knows(subject, origin.address);
}

bool AccessControl::is_known(const CallOrigin& origin) const noexcept {
  return is_owner(origin) || grants_->knows(origin.subject, origin.address);
}

bool AccessControl::admits(std::uint32_t user) const noexcept {
  return user != access::kUnknownUser && knows(origin_of_user(user));
}

bool AccessControl::knows(const CallOrigin& origin) const noexcept {
  const std::lock_guard lock(mutex_);
  return is_known(origin);
}

access::Permission AccessControl::permission(const CallOrigin& origin,
                                             std::string_view path) const noexcept {
  const std::lock_guard lock(mutex_);
  if (is_owner(origin)) return {Role::kAdminister, Priority::kHighest};
  return grants_->permission(origin.subject, origin.address, path);
}

std::string_view AccessControl::name_of(const CallOrigin& origin,
                                        std::span<char> to) const noexcept {
  const std::lock_guard lock(mutex_);
  const std::string_view name = grants_->name_of(origin.subject);
  return {to.data(), name.copy(to.data(), to.size())};
}

Priority AccessControl::ceiling(const CallOrigin& origin) const noexcept {
  const std::lock_guard lock(mutex_);
  if (is_owner(origin)) return Priority::kHighest;
  return grants_->ceiling(origin.subject, origin.address);
}

}  // namespace rtpm::rpc
