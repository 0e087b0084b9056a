#include "rtpm/gvd/client.hpp"

#include <algorithm>
#include <atomic>
#include <string>
#include <utility>

#include "flight_wire.hpp"
#include "holder_introduction.hpp"
#include "rtpm/gvd/command_lease.hpp"
#include "rtpm/gvd/lease.hpp"
#include "rtpm/gvd/models_wire.hpp"
#include "rtpm/gvd/wire.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/wire/clock_sync.hpp"

namespace rtpm::gvd {
namespace {

constexpr Duration kAcquireRetry = std::chrono::milliseconds{20};
constexpr Duration kOpenRetry = std::chrono::milliseconds{100};

/// Whether a retry may open the device later.
bool may_come(const SetupError& error) noexcept {
  return error.cause != rpc::CallError::kWrongInterface &&
         error.cause != rpc::CallError::kNotAllowed;
}

Duration from_us(std::uint32_t us) noexcept {
  return std::chrono::microseconds{us};
}

DeviceResult result_of(const expected<device::Outcome, rpc::CallError>& reply) noexcept {
  if (!reply) return unexpected{reply.error()};
  if (reply->code() == device::OutcomeCode::Done) return {};
  return unexpected{static_cast<DeviceOutcome>(reply->code())};
}

}  // namespace

struct DeviceClient::Impl {
  Impl(HolderIntroduction its_introduction, device::DeviceClient bound,
       const device::Description& description, Duration hold_wanted)
      : introduction(std::move(its_introduction)),
        stub(std::move(bound)),
        descriptor(from_wire(description)),
        hold(std::clamp(hold_wanted, Duration{0}, from_us(description.hold_us_max()))),
        operator_priority(std::min<int>(description.operator_priority(), Priority::kHighest)) {
    const Duration period = std::chrono::duration_cast<Duration>(
        std::chrono::duration<double>(1.0 / std::max(descriptor.rate_hz, 1.0)));
    force_end = hold + from_us(description.ramp_us()) + period;
  }
  ~Impl() { static_cast<void>(release()); }

  [[nodiscard]] device::Holder holder() const noexcept {
    return device::Holder{lease.load(std::memory_order_relaxed)};
  }
  DeviceResult hold_lease(const expected<device::Lease, rpc::CallError>& granted) {
    if (!granted) return unexpected{granted.error()};
    if (granted->outcome() != device::OutcomeCode::Done) {
      return unexpected{static_cast<DeviceOutcome>(granted->outcome())};
    }
    lease.store(granted->id(), std::memory_order_relaxed);
    introduction.tell(granted->id());
    return {};
  }
  DeviceResult release() {
    const std::uint64_t held = lease.exchange(Lease::kNobody, std::memory_order_relaxed);
    if (held == Lease::kNobody) return {};
    return result_of(stub.release(device::Holder{held}));
  }

  HolderIntroduction introduction;
  device::DeviceClient stub;
  driver::Descriptor descriptor;
  Duration hold;
  Duration force_end{};
  Priority operator_priority;
  std::atomic<std::uint64_t> lease{Lease::kNobody};
  std::atomic<std::uint32_t> sequence{1};
};

expected<DeviceClient, SetupError> DeviceClient::open(rpc::Node& node, std::string_view device,
                                                      const DeviceClientOptions& options) {
  const MonotonicTime until = rt::now() + options.patience;
  while (true) {
    auto opened = open_once(node, device, options);
    if (opened || !may_come(opened.error())) return opened;
    const MonotonicTime next = rt::now() + kOpenRetry;
    if (next > until) return opened;
    rt::sleep_until(next);
  }
}

expected<DeviceClient, SetupError> DeviceClient::open_once(rpc::Node& node, std::string_view device,
                                                           const DeviceClientOptions& options) {
  auto stub = device::DeviceClient::bind(node, device, options.bind);
  if (!stub) return unexpected{stub.error()};
  rpc::CallOptions call;
  call.deadline = options.bind.deadline;
  std::unique_ptr<Impl> impl;
  {
    const auto description = stub->describe({}, call);
    if (!description) {
      return setup_error("device " + std::string(device) + " was found, but not described",
                         description.error());
    }
    impl = std::make_unique<Impl>(HolderIntroduction(node, stub->binding().url()), std::move(*stub),
                                  **description, options.hold);
  }
  return DeviceClient{std::move(impl)};
}

DeviceClient::DeviceClient(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
DeviceClient::DeviceClient(DeviceClient&&) noexcept = default;
DeviceClient& DeviceClient::operator=(DeviceClient&&) noexcept = default;
DeviceClient::~DeviceClient() = default;

const driver::Descriptor& DeviceClient::descriptor() const noexcept {
  return impl_->descriptor;
}
std::string DeviceClient::url() const {
  return impl_->stub.binding().url();
}
Duration DeviceClient::force_end() const noexcept {
  return impl_->force_end;
}
Priority DeviceClient::operator_priority() const noexcept {
  return impl_->operator_priority;
}

expected<driver::Sample, DeviceError> DeviceClient::read(const rpc::CallOptions& options) noexcept {
  const auto sample = impl_->stub.read({}, options);
  if (!sample) return unexpected{sample.error()};
  if (sample->sequence() == 0) return unexpected{DeviceOutcome::kNoSample};
  return from_wire(*sample);
}

DeviceResult DeviceClient::set_force(const driver::Vector3& force_newton,
                                     const rpc::CallOptions& options) noexcept {
  return set_wrench({force_newton, {}}, options);
}

DeviceResult DeviceClient::set_wrench(const driver::Wrench& wrench,
                                      const rpc::CallOptions& options) noexcept {
  return set(driver::Setpoint::with_wrench(wrench), options);
}

DeviceResult DeviceClient::set(const driver::Setpoint& setpoint,
                               const rpc::CallOptions& options) noexcept {
  const ClientCommand command{impl_->lease.load(std::memory_order_relaxed),
                              impl_->sequence.fetch_add(1, std::memory_order_relaxed), impl_->hold,
                              setpoint};
  return result_of(impl_->stub.command(to_wire(command), options));
}

expected<void, ModelsError> DeviceClient::set_models(std::span<const Model> models) {
  device::SetModelsRequestT request;
  request.lease = impl_->lease.load(std::memory_order_relaxed);
  request.sequence = impl_->sequence.fetch_add(1, std::memory_order_relaxed);
  request.models = to_wire(models);
  const auto reply = impl_->stub.set_models(request);
  if (!reply) {
    const DeviceError error = reply.error();
    return unexpected{ModelsError{error, std::string(to_string(error))}};
  }
  const auto code = (*reply)->outcome()->code();
  if (code == device::OutcomeCode::Done) return {};
  const DeviceError error = static_cast<DeviceOutcome>(code);
  const flatbuffers::String* words = (*reply)->words();
  return unexpected{
      ModelsError{error, words != nullptr ? words->str() : std::string(to_string(error))}};
}

expected<FlightLog, DeviceError> DeviceClient::flight_record() {
  FlightLog log;
  do {
    device::FlightRecordRequestT request;
    request.first = static_cast<std::uint32_t>(log.records.size());
    const auto reply = impl_->stub.read_flight_record(request);
    if (!reply) return unexpected{reply.error()};
    const device::FlightRecordReply& part = **reply;
    // Another fault occurred meanwhile: reads its record from the start.
    if (log.number != 0 && part.number() != log.number) {
      log = {};
      continue;
    }
    if (part.cycles()->size() == 0) break;
    add_from_wire(part, log);
  } while (log.records.size() < log.record_count || log.number == 0);
  const auto clock = impl_->stub.binding().ping();
  if (clock && clock->uncertainty != Duration::max()) log.clock_offset = clock->offset;
  return log;
}

DeviceResult DeviceClient::acquire(Duration patience) {
  const MonotonicTime until = rt::now() + patience;
  while (true) {
    const auto acquired = impl_->hold_lease(impl_->stub.acquire());
    const bool is_busy = !acquired && (acquired.error() == DeviceOutcome::kHeld ||
                                       acquired.error() == DeviceOutcome::kTooSoon);
    if (!is_busy) return acquired;
    const MonotonicTime next = rt::now() + kAcquireRetry;
    if (next > until) return acquired;
    rt::sleep_until(next);
  }
}
DeviceResult DeviceClient::reacquire(Duration patience) {
  const auto state = lease_state();
  if (!state) return unexpected{state.error()};
  if (*state == LeaseState::kHeld) return {};
  if (*state == LeaseState::kTakenOver) return unexpected{DeviceOutcome::kNotHolder};
  return acquire(patience);
}
DeviceResult DeviceClient::take_over(std::optional<Priority> priority) {
  rpc::CallOptions options;
  options.priority = priority.value_or(impl_->operator_priority);
  return impl_->hold_lease(impl_->stub.take_over({}, options));
}
expected<LeaseState, DeviceError> DeviceClient::lease_state() {
  const auto standing = impl_->stub.lease_state(impl_->holder());
  if (!standing) return unexpected{standing.error()};
  return standing->state() < kLeaseStateCount ? static_cast<LeaseState>(standing->state())
                                              : LeaseState::kUnknown;
}
DeviceResult DeviceClient::renew() {
  return result_of(impl_->stub.renew(impl_->holder()));
}
DeviceResult DeviceClient::release() {
  return impl_->release();
}
DeviceResult DeviceClient::recover() {
  return result_of(impl_->stub.recover(impl_->holder()));
}
DeviceResult DeviceClient::activate() {
  return result_of(impl_->stub.activate(impl_->holder()));
}
DeviceResult DeviceClient::deactivate() {
  return result_of(impl_->stub.deactivate(impl_->holder()));
}
DeviceResult DeviceClient::emergency_stop(StopScope scope) {
  return result_of(impl_->stub.emergency_stop(device::Stop{static_cast<device::StopScope>(scope)}));
}
DeviceResult DeviceClient::rearm() {
  return result_of(impl_->stub.rearm(impl_->holder()));
}

}  // namespace rtpm::gvd
