#include "operators/operator_desk.hpp"

#include <algorithm>
#include <atomic>
#include <mutex>
#include <utility>

#include "rtpm/rpc/binding.hpp"

namespace rtpm::console {
namespace {

using gvd::DeviceError;
using gvd::DeviceOutcome;

constexpr Duration kStopDeadline = std::chrono::milliseconds{500};
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

/// The results of stopping several devices.
struct Stops {
  std::mutex mutex{};
  nlohmann::ordered_json stopped = nlohmann::ordered_json::array();
  nlohmann::ordered_json failed = nlohmann::ordered_json::array();
  std::size_t left_count = 0;
};

std::string text_in(const nlohmann::json& request, const char* key) {
  const auto found = request.find(key);
  return found != request.end() && found->is_string() ? found->get<std::string>() : std::string{};
}

}  // namespace

OperatorDesk::OperatorDesk(CallRouter& router, WorkerPool& pool, WorkerPool& urgent, Post post,
                           Devices devices)
    : router_(router),
      pool_(pool),
      urgent_(urgent),
      post_(std::move(post)),
      devices_(std::move(devices)) {}

void OperatorDesk::start() {
  router_.add_json("console/estop", [this](const PendingCall& call, const nlohmann::json& request) {
    stop(call, request);
  });
  const auto add = [this](const char* name, Step step, bool needs_lease, bool ends_operation) {
    router_.add_json(std::string("console/") + name,
                     [this, step = std::move(step), needs_lease, ends_operation](
                         const PendingCall& call, const nlohmann::json& request) {
                       command(call, request, step, needs_lease, ends_operation);
                     });
  };
  add("take_over", &take_over, false, false);
  add("release", &give_back, false, true);
  const auto add_step = [&](const char* name, auto method) {
    add(
        name,
        [method](DeviceLink& link) {
          return error_of((link.stub().*method)(device::Holder{link.lease()}, {}));
        },
        true, false);
  };
  add_step("rearm", &device::DeviceClient::rearm);
  add_step("activate", &device::DeviceClient::activate);
  add_step("deactivate", &device::DeviceClient::deactivate);
  add_step("recover", &device::DeviceClient::recover);
}

void OperatorDesk::stop(const PendingCall& call, const nlohmann::json& request) {
  const std::string one = text_in(request, "device");
  const bool is_all = !request.contains("device");
  const std::vector<std::string> names = is_all ? devices_.names() : std::vector<std::string>{one};
  const auto stops = std::make_shared<Stops>();
  stops->left_count = names.size();
  const auto answer = [this, call, stops] {
    router_.succeed(call,
                    nlohmann::ordered_json{{"stopped", stops->stopped}, {"failed", stops->failed}});
  };
  if (names.empty()) return answer();
  const auto scope = is_all ? device::StopScope::System : device::StopScope::Device;
  for (const std::string& name : names) {
    const auto end = [stops, answer, name, post = post_](const std::string& why) {
      const std::lock_guard lock(stops->mutex);
      if (why.empty()) {
        stops->stopped.push_back(name);
      } else {
        stops->failed.push_back({{"device", name}, {"why", why}});
      }
      if (--stops->left_count == 0) post(answer);
    };
    const auto link = devices_.link(name);
    if (!link) {
      end("it was not reached yet");
      continue;
    }
    const bool is_queued = urgent_.run(name, [link, scope, end] {
      rpc::CallOptions options;
      options.priority = Priority{Priority::kHighest};
      options.deadline = kStopDeadline;
      const DeviceError error = error_of(link->stub().emergency_stop(device::Stop{scope}, options));
      // Outside of a system its own server's devices are stopped all the same.
      const bool is_stopped = is_done(error) || error.outcome() == DeviceOutcome::kNotInSystem;
      end(is_stopped ? std::string{} : std::string(to_string(error)));
    });
    if (!is_queued) end("too many stops are under way");
  }
}

std::string OperatorDesk::refusal(std::uint64_t connection_id, const std::string& device,
                                  bool is_forced) const {
  const auto found = operators_.find(device);
  if (found != operators_.end() && found->second != connection_id && !is_forced) {
    return "another browser (connection " + std::to_string(found->second) + ") operates " + device +
           "; take over first";
  }
  return {};
}

void OperatorDesk::command(const PendingCall& call, const nlohmann::json& request, const Step& step,
                           bool needs_lease, bool ends_operation) {
  const std::string name = text_in(request, "device");
  const auto link = devices_.link(name);
  if (!link) return router_.fail(call, "there is no device '" + name + "' that answers");
  const auto force = request.find("force");
  const bool is_forced = force != request.end() && force->is_boolean() && force->get<bool>();
  const bool was_free = !operators_.contains(name);
  if (const std::string why = refusal(call.connection_id, name, is_forced); !why.empty()) {
    return router_.fail(call, why);
  }
  // From now on, so that a second browser does not come in between.
  operators_[name] = call.connection_id;
  const bool is_queued = pool_.run(name, [=, this] {
    DeviceError error = kDone;
    if (needs_lease && link->lease() == 0) error = take_over(*link);
    if (is_done(error)) error = step(*link);
    // The lease has ended in the meantime.
    if (needs_lease && error.outcome() == DeviceOutcome::kNotHolder) {
      error = take_over(*link);
      if (is_done(error)) error = step(*link);
    }
    post_([=, this] {
      if (ends_operation || (!is_done(error) && was_free && link->lease() == 0)) {
        operators_.erase(name);
      }
      if (is_done(error)) return router_.succeed(call, nlohmann::ordered_json{{"ok", true}});
      router_.fail(call, name + ": " + std::string(to_string(error)));
    });
  });
  if (!is_queued) router_.fail(call, "too much waits to be done; try again");
}

void OperatorDesk::renew() {
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

void OperatorDesk::on_close(std::uint64_t connection_id) {
  std::vector<std::string> operated;
  for (const auto& [device, connection] : operators_) {
    if (connection == connection_id) operated.push_back(device);
  }
  for (const std::string& device : operated)
    release(device);
}

void OperatorDesk::release_all() {
  for (const std::string& name : devices_.names()) {
    const auto link = devices_.link(name);
    if (link) static_cast<void>(give_back(*link));
  }
}

}  // namespace rtpm::console
