#include "operators/operator_desk.hpp"

#include <algorithm>
#include <utility>

#include "rtpm/driver/sample.hpp"
#include "rtpm/rpc/binding.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::console {
namespace {

using gvd::DeviceError;
using gvd::DeviceOutcome;

constexpr Duration kEffectPatience = std::chrono::milliseconds{500};
constexpr Duration kEffectInterval = std::chrono::milliseconds{5};
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
  const auto lease = link.stub().take_over({}, options);
  if (!lease) return lease.error();
  if (lease->outcome() == device::OutcomeCode::Done) link.set_lease(lease->id());
  return static_cast<DeviceOutcome>(lease->outcome());
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

std::string text_in(const nlohmann::json& request, const char* key) {
  const auto found = request.find(key);
  return found != request.end() && found->is_string() ? found->get<std::string>() : std::string{};
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
  if (other.connection_id == connection_id || other.gone_since) return {};
  return "another browser (connection " + std::to_string(other.connection_id) + ") operates " +
         device + "; take over first";
}

void OperatorDesk::run(const PendingCall& call, const nlohmann::json& request,
                       const Command& command) {
  const std::string name = text_in(request, "device");
  const auto link = devices_.link(name);
  if (!link) return router_.fail(call, "there is no device '" + name + "' that answers");
  const auto force = request.find("force");
  const bool is_forced = force != request.end() && force->is_boolean() && force->get<bool>();
  const bool was_free = !operators_.contains(name);
  if (const std::string why = refusal(call.connection_id, name, is_forced); !why.empty()) {
    return router_.fail(call, why);
  }
  // Reserves the device at once, so that a second browser can't intervene.
  operators_[name] = {call.connection_id};
  const bool is_queued = pool_.run(name, [=, this] {
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
    post_([=, this] {
      if (command.ends_operation || (!why.empty() && was_free && link->lease() == 0)) {
        operators_.erase(name);
      }
      if (why.empty()) return router_.succeed(call, nlohmann::ordered_json{{"ok", true}});
      router_.fail(call, name + ": " + why);
    });
  });
  if (!is_queued) router_.fail(call, "too much waits to be done; try again");
}

void OperatorDesk::renew(MonotonicTime now) {
  std::vector<std::string> left_alone;
  for (const auto& [device, browser] : operators_) {
    if (browser.gone_since && now - *browser.gone_since >= kGoneMax) left_alone.push_back(device);
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
      post_([this, name] { operators_.erase(name); });
    }));
  }
}

void OperatorDesk::release(const std::string& device) {
  operators_.erase(device);
  const auto link = devices_.link(device);
  if (!link || link->lease() == 0) return;
  static_cast<void>(pool_.run(device, [link] { static_cast<void>(give_back(*link)); }));
}

void OperatorDesk::on_open(std::uint64_t connection_id, MonotonicTime now) {
  browsers_[connection_id] = now;
  for (auto& [device, browser] : operators_) {
    if (browser.gone_since) browser = {connection_id};
  }
}

void OperatorDesk::on_close(std::uint64_t connection_id, MonotonicTime since) {
  browsers_.erase(connection_id);
  Operator next{connection_id, since};
  // A reloaded page may connect before the end of its previous connection is noticed.
  if (!browsers_.empty()) {
    const auto& [newest, came] = *browsers_.rbegin();
    if (newest > connection_id && rt::now() - came <= kNoticeMax) next = {newest};
  }
  for (auto& [device, browser] : operators_) {
    if (browser.connection_id == connection_id) browser = next;
  }
}

std::optional<Duration> OperatorDesk::left(const std::string& device, MonotonicTime now) const {
  const auto found = operators_.find(device);
  if (found == operators_.end() || !found->second.gone_since) return std::nullopt;
  return std::max(kGoneMax - (now - *found->second.gone_since), Duration{0});
}

void OperatorDesk::release_all() {
  for (const std::string& name : devices_.names()) {
    const auto link = devices_.link(name);
    if (link) static_cast<void>(give_back(*link));
  }
}

}  // namespace rtpm::console
