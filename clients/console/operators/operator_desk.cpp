#include "operators/operator_desk.hpp"

#include <algorithm>
#include <utility>

#include "rtpm/base/printable.hpp"
#include "rtpm/driver/sample.hpp"
#include "rtpm/gvd/holder.hpp"
#include "rtpm/rpc/binding.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/utc.hpp"
#include "services/json_fields.hpp"

namespace rtpm::console {
namespace {

using gvd::DeviceError;
using gvd::DeviceOutcome;

constexpr Duration kEffectPatience = std::chrono::milliseconds{500};
constexpr Duration kEffectInterval = std::chrono::milliseconds{5};
/// A device grants one take-over a second: another operator's click must not fail for that.
constexpr Duration kTakeOverPatience = std::chrono::milliseconds{1500};
constexpr Duration kTakeOverInterval = std::chrono::milliseconds{50};
/// How late the end of a connection without a close frame may be noticed.
constexpr Duration kNoticeMax = std::chrono::seconds{7};
using HolderMethod = expected<device::Outcome, rpc::CallError> (device::DeviceClient::*)(
    const device::Holder&, const rpc::CallOptions&) noexcept;
using OperatorStep = std::function<DeviceError(DeviceLink&)>;
constexpr DeviceError kDone{DeviceOutcome::kDone};

template <class Reply>
DeviceError error_of(const expected<Reply, rpc::CallError>& reply) noexcept {
  return reply ? DeviceError(static_cast<DeviceOutcome>(reply->code()))
               : DeviceError(reply.error());
}

bool is_done(const DeviceError& error) noexcept {
  return error.outcome() == DeviceOutcome::kDone;
}

/// Takes the lease from its holder.
DeviceError take_over(DeviceLink& link) {
  rpc::CallOptions options;
  options.priority = link.operator_priority();
  const MonotonicTime end = rt::now() + kTakeOverPatience;
  while (true) {
    const auto lease = link.stub().take_over({}, options);
    if (!lease) return lease.error();
    if (lease->outcome() == device::OutcomeCode::Done) link.set_lease(lease->id());
    if (lease->outcome() != device::OutcomeCode::TooSoon || rt::now() >= end)
      return static_cast<DeviceOutcome>(lease->outcome());
    rt::sleep_until(rt::now() + kTakeOverInterval);
  }
}

DeviceError give_back(DeviceLink& link) {
  const std::uint64_t lease = link.lease();
  link.set_lease(0);
  if (lease == 0) return kDone;
  return error_of(link.stub().release(device::Holder{lease}));
}

OperatorStep holder_step(HolderMethod method) {
  return [method](DeviceLink& link) {
    return error_of((link.stub().*method)(device::Holder{link.lease()}, {}));
  };
}

/// Waits until the device's sample shows the effect of a request, which takes place in the next
/// cycle.
bool await(DeviceLink& link, const std::function<bool(const device::Sample&)>& effect) {
  const MonotonicTime end = rt::now() + kEffectPatience;
  while (true) {
    const auto sample = link.stub().read();
    if (sample && effect(*sample)) return true;
    if (rt::now() >= end) return false;
    rt::sleep_until(rt::now() + kEffectInterval);
  }
}

/// A person's text in the form that others see: one line without blanks around it.
std::string tidy_person(std::string_view text) {
  constexpr std::size_t kSizeMax = 40;
  while (text.starts_with(' '))
    text.remove_prefix(1);
  while (text.ends_with(' '))
    text.remove_suffix(1);
  return printable(text, kSizeMax);
}

std::string name_or(const std::string& name, const char* otherwise) {
  return name.empty() ? otherwise : name;
}

}  // namespace

OperatorDesk::OperatorDesk(CallRouter& router, WorkerPool& pool, Post post, Devices devices)
    : router_(router), pool_(pool), post_(std::move(post)), devices_(std::move(devices)) {}

void OperatorDesk::start() {
  using driver::Fault;
  using driver::Faults;
  using driver::Lifecycle;
  const auto lifecycle_of = [](const device::Sample& sample) {
    return static_cast<Lifecycle>(sample.lifecycle());
  };
  add("take_over", {.step = &take_over});
  add("release", {.step = &give_back, .ends_operation = true});
  add("rearm",
      {holder_step(&device::DeviceClient::rearm), true, false, [](const device::Sample& sample) {
         return !Faults(sample.faults()).has(Fault::kEmergencyStop);
       }});
  add("recover",
      {holder_step(&device::DeviceClient::recover), true, false, [](const device::Sample& sample) {
         const Faults faults(sample.faults());
         return !faults.has(Fault::kCommandNotFinite) && !faults.has(Fault::kTooFast);
       }});
  add("activate",
      {holder_step(&device::DeviceClient::activate), true, false,
       [=](const device::Sample& sample) { return lifecycle_of(sample) == Lifecycle::kActive; }});
  add("deactivate",
      {holder_step(&device::DeviceClient::deactivate), true, false,
       [=](const device::Sample& sample) { return lifecycle_of(sample) != Lifecycle::kActive; }});
  const auto add_json = [this](const char* name, auto method) {
    router_.add_json(name, [this, method](const PendingCall& call, const nlohmann::json& request) {
      (this->*method)(call, request);
    });
  };
  add_json("console/operator", &OperatorDesk::set_person);
  add_json("console/lease_keep", &OperatorDesk::keep_lease);
  add_json("console/lease_request", &OperatorDesk::ask_for_lease);
  add_json("console/lease_answer", &OperatorDesk::answer_for_lease);
}

void OperatorDesk::add(const char* name, Command command) {
  router_.add_json(
      std::string("console/") + name,
      [this, command = std::move(command)](const PendingCall& call, const nlohmann::json& request) {
        run(call, request, command);
      });
}

std::string OperatorDesk::refusal(std::uint64_t connection_id, const std::string& device,
                                  bool is_forced) const {
  const auto found = operators_.find(device);
  if (found == operators_.end() || is_forced) return {};
  const Operator& other = found->second;
  if (other.connection_id == connection_id || (other.gone_since && !other.is_kept)) return {};
  if (!other.person.name.empty()) {
    return other.person.name + " operates " + device + "; ask for it, or take over first";
  }
  return "another browser (connection " + std::to_string(other.connection_id) + ") operates " +
         device + "; take over first";
}

void OperatorDesk::run(const PendingCall& call, const nlohmann::json& request,
                       const Command& command) {
  const std::string name = fields::text(request, "device");
  const auto link = devices_.link(name);
  if (!link) return router_.fail(call, "there is no device '" + name + "' that answers");
  const bool is_forced = fields::flag(request, "force");
  const bool was_free = !operators_.contains(name);
  if (const std::string why = refusal(call.connection_id, name, is_forced); !why.empty()) {
    return router_.fail(call, why);
  }
  // Reserves the device at once, so that a second browser can't intervene.
  Operator& present = operators_[name];
  if (present.connection_id != call.connection_id) {
    end_operation(name);
    operators_[name] = {.connection_id = call.connection_id,
                        .person = browsers_[call.connection_id].person,
                        .since_ns = rt::utc_ns(rt::now())};
  }
  const bool is_queued = pool_.run(name, [=, this] {
    const std::uint64_t before = link->lease();
    DeviceError error = kDone;
    if (command.needs_lease && link->lease() == 0) error = take_over(*link);
    if (is_done(error)) error = command.step(*link);
    // The lease has ended meanwhile.
    if (command.needs_lease && error.outcome() == DeviceOutcome::kNotHolder) {
      error = take_over(*link);
      if (is_done(error)) error = command.step(*link);
    }
    std::string why = is_done(error) ? std::string{} : std::string(to_string(error));
    if (why.empty() && command.effect && !await(*link, command.effect)) {
      why = "it took the request, but does not show its effect within 500 ms";
    }
    const bool is_new = link->lease() != 0 && link->lease() != before;
    post_([=, this] {
      if (command.ends_operation || (!why.empty() && was_free && link->lease() == 0)) {
        end_operation(name);
      }
      if (is_new) introduce(name);
      if (why.empty()) return router_.succeed(call, nlohmann::ordered_json{{"ok", true}});
      router_.fail(call, name + ": " + why);
    });
  });
  if (!is_queued) router_.fail(call, "too much waits to be done; try again");
}

void OperatorDesk::renew(MonotonicTime now) {
  std::vector<std::string> left_alone;
  for (const auto& [device, browser] : operators_) {
    const bool is_left = browser.gone_since && now - *browser.gone_since >= kGoneMax;
    if (is_left && !browser.is_kept) left_alone.push_back(device);
  }
  for (auto& [device, browser] : operators_) {
    if (!browser.request || now < browser.request->ends) continue;
    router_.fail(browser.request->call, name_or(browser.person.name, "its operator") +
                                            " did not answer within 30 s; " + device +
                                            " stays as it is");
    browser.request.reset();
  }
  for (const std::string& device : left_alone)
    release(device);
  for (const std::string& name : devices_.names()) {
    const auto link = devices_.link(name);
    if (!link || link->lease() == 0) continue;
    static_cast<void>(pool_.run("renew " + name, [this, name, link] {
      const std::uint64_t lease = link->lease();
      if (lease == 0) return;
      const DeviceError error = error_of(link->stub().renew(device::Holder{lease}));
      if (error.outcome() != DeviceOutcome::kNotHolder || link->lease() != lease) return;
      link->set_lease(0);
      post_([this, name] { end_operation(name); });
    }));
  }
}

void OperatorDesk::release(const std::string& device) {
  end_operation(device);
  const auto link = devices_.link(device);
  if (!link || link->lease() == 0) return;
  static_cast<void>(pool_.run(device, [link] { static_cast<void>(give_back(*link)); }));
}

// A browser whose operator has a name resumes when it has said the same one.
void OperatorDesk::on_open(std::uint64_t connection_id, MonotonicTime now) {
  browsers_[connection_id] = {.since = now};
  for (auto& [device, browser] : operators_) {
    if (!browser.gone_since || !browser.person.name.empty()) continue;
    browser.connection_id = connection_id;
    browser.gone_since.reset();
  }
}

void OperatorDesk::on_close(std::uint64_t connection_id, MonotonicTime since) {
  const std::string name = name_of(connection_id);
  browsers_.erase(connection_id);
  // A reloaded page may connect before the end of its previous connection is noticed.
  std::optional<std::uint64_t> next;
  if (!browsers_.empty()) {
    const auto& [newest, browser] = *browsers_.rbegin();
    const bool is_same = browser.person.name == name;
    if (is_same && newest > connection_id && rt::now() - browser.since <= kNoticeMax) next = newest;
  }
  for (auto& [device, browser] : operators_) {
    if (browser.request && browser.request->call.connection_id == connection_id) {
      browser.request.reset();
    }
    if (browser.connection_id != connection_id) continue;
    if (next) {
      browser.connection_id = *next;
    } else {
      browser.gone_since = since;
    }
  }
}

void OperatorDesk::set_person(const PendingCall& call, const nlohmann::json& request) {
  const Person person{tidy_person(fields::text(request, "name")),
                      tidy_person(fields::text(request, "room"))};
  browsers_[call.connection_id].person = person;
  for (auto& [device, browser] : operators_) {
    const bool is_back = browser.gone_since && browser.person.name == person.name;
    if (browser.connection_id != call.connection_id && !is_back) continue;
    browser.connection_id = call.connection_id;
    browser.gone_since.reset();
    if (browser.person.name == person.name && browser.person.room == person.room) continue;
    browser.person = person;
    introduce(device);
  }
  router_.succeed(
      call, nlohmann::ordered_json{
                {"connection", call.connection_id}, {"name", person.name}, {"room", person.room}});
}

void OperatorDesk::keep_lease(const PendingCall& call, const nlohmann::json& request) {
  const std::string device = fields::text(request, "device");
  const auto found = operators_.find(device);
  if (found == operators_.end() || found->second.connection_id != call.connection_id) {
    return router_.fail(call, "this browser does not operate '" + device + "'");
  }
  found->second.is_kept = fields::flag(request, "keep");
  router_.succeed(call, nlohmann::ordered_json{{"keep", found->second.is_kept}});
}

void OperatorDesk::ask_for_lease(const PendingCall& call, const nlohmann::json& request) {
  const std::string device = fields::text(request, "device");
  const auto found = operators_.find(device);
  if (found == operators_.end() || found->second.gone_since) {
    return router_.fail(
        call, "nobody at this console can hand over '" + device + "'; take it over instead");
  }
  Operator& present = found->second;
  if (present.connection_id == call.connection_id) {
    return router_.fail(call, "this browser operates '" + device + "' already");
  }
  if (present.request) {
    return router_.fail(
        call, name_or(present.request->person.name, "another browser") + " asks for it already");
  }
  present.request = {call, browsers_[call.connection_id].person, rt::now() + kAnswerMax};
}

void OperatorDesk::answer_for_lease(const PendingCall& call, const nlohmann::json& request) {
  const std::string device = fields::text(request, "device");
  const auto found = operators_.find(device);
  if (found == operators_.end() || found->second.connection_id != call.connection_id ||
      !found->second.request) {
    return router_.fail(call, "nobody asks this browser for '" + device + "'");
  }
  Operator& present = found->second;
  const Request asked = *present.request;
  present.request.reset();
  const bool is_granted = fields::flag(request, "consent");
  if (!is_granted) {
    router_.fail(asked.call, name_or(present.person.name, "its operator") + " keeps " + device);
  } else {
    present = {.connection_id = asked.call.connection_id,
               .person = asked.person,
               .since_ns = rt::utc_ns(rt::now())};
    introduce(device);
    router_.succeed(asked.call, nlohmann::ordered_json{{"granted", true}});
  }
  router_.succeed(call, nlohmann::ordered_json{{"ok", true}});
}

void OperatorDesk::end_operation(const std::string& device) {
  const auto found = operators_.find(device);
  if (found == operators_.end()) return;
  const std::optional<Request> request = std::move(found->second.request);
  operators_.erase(found);
  if (request) router_.fail(request->call, "the operator of " + device + " has changed meanwhile");
}

std::string OperatorDesk::holder_text(const std::string& device) const {
  const auto found = operators_.find(device);
  const Person person = found == operators_.end() ? Person{} : found->second.person;
  if (person.name.empty()) return gvd::own_holder_name();
  const std::string room = person.room.empty() ? "" : " (" + person.room + ")";
  return person.name + room + " by " + gvd::own_holder_name();
}

void OperatorDesk::introduce(const std::string& device) {
  const auto link = devices_.link(device);
  if (!link || link->lease() == 0) return;
  // A name that is not told does not matter.
  static_cast<void>(
      pool_.run(device, [link, name = holder_text(device)] { link->introduce(name); }));
}

std::string OperatorDesk::name_of(std::uint64_t connection_id) const {
  const auto found = browsers_.find(connection_id);
  return found == browsers_.end() ? std::string{} : found->second.person.name;
}

void OperatorDesk::add_operator(const std::string& device, MonotonicTime now,
                                nlohmann::ordered_json& lease) const {
  const auto found = operators_.find(device);
  if (found == operators_.end()) return;
  const Operator& present = found->second;
  lease["operator"] = {{"connection", present.connection_id},
                       {"name", present.person.name},
                       {"room", present.person.room},
                       {"since_ns", present.since_ns},
                       {"is_gone", present.gone_since.has_value()},
                       {"is_kept", present.is_kept}};
  if (!present.request) return;
  const Request& request = *present.request;
  lease["request"] = {{"connection", request.call.connection_id},
                      {"name", request.person.name},
                      {"room", request.person.room},
                      {"ends_in_s", std::chrono::duration<double>(request.ends - now).count()}};
}

std::optional<Duration> OperatorDesk::left(const std::string& device, MonotonicTime now) const {
  const auto found = operators_.find(device);
  if (found == operators_.end() || !found->second.gone_since || found->second.is_kept) {
    return std::nullopt;
  }
  return std::max(kGoneMax - (now - *found->second.gone_since), Duration{0});
}

void OperatorDesk::release_all() {
  for (const std::string& name : devices_.names()) {
    const auto link = devices_.link(name);
    if (link) static_cast<void>(give_back(*link));
  }
}

}  // namespace rtpm::console
