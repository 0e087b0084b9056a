#include "rtpm/replay/replayed_device.hpp"

#include <algorithm>
#include <string_view>

#include "rtpm/driver/sample.hpp"
#include "rtpm/gvd/wire.hpp"
#include "rtpm/rt/memory.hpp"

namespace rtpm::replay {
namespace {

using gvd::DeviceOutcome;
using gvd::refused_to_wire;
using gvd::to_wire;

const device::Description& description_of(const RecordedDevice& recorded) {
  return *flatbuffers::GetRoot<device::Description>(recorded.description.data());
}

/// Like a device server's sample of an unplugged device.
device::Sample gone(const device::Sample& last) noexcept {
  driver::Sample sample = gvd::from_wire(last);
  sample.lifecycle = driver::Lifecycle::kFault;
  sample.faults.set(driver::Fault::kDeviceGone);
  return gvd::to_wire(sample);
}

constexpr std::string_view kNoModels =
    "this device is a replayed one, which renders no models: let the client compute the force";

}  // namespace

ReplayedDevice::ReplayedDevice(const RecordedDevice& recorded, const ReplayedDeviceConfig& config)
    : recorded_(recorded),
      config_(config),
      limiter_(gvd::from_wire(description_of(recorded))),
      lease_(config.lease, config.lease_key) {
  description_of(recorded).UnPackTo(&description_);
}

void ReplayedDevice::attend(MonotonicTime now) noexcept {
  if (is_gone_.load(std::memory_order_acquire)) lease_.revoke();
  static_cast<void>(lease_.step(now));
}

ReplayedDevice::Counters ReplayedDevice::counters() const noexcept {
  return {read_count_.load(std::memory_order_relaxed),
          command_count_.load(std::memory_order_relaxed),
          refused_count_.load(std::memory_order_relaxed)};
}

const device::Sample* ReplayedDevice::sample_at(MonotonicTime now) const noexcept {
  const auto after = std::upper_bound(recorded_.times.begin(), recorded_.times.end(),
                                      config_.pace->position(now).at);
  if (after == recorded_.times.begin()) return nullptr;
  return &recorded_.samples[static_cast<std::size_t>(after - recorded_.times.begin()) - 1];
}

const device::Sample* ReplayedDevice::next_sample() noexcept {
  const std::uint64_t count = recorded_.samples.size();
  const std::uint64_t step = step_count_.fetch_add(1, std::memory_order_acq_rel);
  if (step < count) return &recorded_.samples[step];
  if (config_.end == End::kLoop) return &recorded_.samples[step % count];
  if (config_.end == End::kGone) lose();
  return &recorded_.samples.back();
}

const device::Sample* ReplayedDevice::last_shown(MonotonicTime now) const noexcept {
  if (!is_stepped()) return sample_at(now);
  const std::uint64_t count = recorded_.samples.size();
  const std::uint64_t step = step_count();
  // Before the first step the device stands at the first sample.
  if (step == 0) return &recorded_.samples.front();
  if (config_.end == End::kLoop) return &recorded_.samples[(step - 1) % count];
  return &recorded_.samples[std::min(step, count) - 1];
}

rpc::Result<void> ReplayedDevice::describe(rpc::ReplyBuilder<device::Description>& reply,
                                           const rpc::CallContext&) {
  // Called once per bind, not in a loop.
  const rt::AllowAllocationScope set_up;
  reply.finish(device::CreateDescription(reply.builder(), &description_));
  return {};
}

rpc::Result<device::Sample> ReplayedDevice::read(const rpc::CallContext& context) {
  read_count_.fetch_add(1, std::memory_order_relaxed);
  const device::Sample* const sample = is_stepped() ? next_sample() : sample_at(context.received);
  if (sample == nullptr) return device::Sample{};
  if (is_gone_.load(std::memory_order_acquire)) return gone(*sample);
  return *sample;
}

bool ReplayedDevice::is_active(MonotonicTime now) const noexcept {
  if (is_gone_.load(std::memory_order_acquire)) return false;
  if (is_deactivated_.load(std::memory_order_acquire)) return false;
  const device::Sample* const sample = last_shown(now);
  return sample != nullptr &&
         sample->lifecycle() == static_cast<std::uint8_t>(driver::Lifecycle::kActive);
}

bool ReplayedDevice::is_newest(std::uint64_t lease, std::uint32_t sequence) noexcept {
  constexpr std::uint64_t kPresent = std::uint64_t{1} << 63;
  const std::uint64_t serial = gvd::Lease::serial_of(lease);
  std::uint64_t before = newest_command_.load(std::memory_order_acquire);
  do {
    const bool is_comparable = (before & kPresent) != 0 && (before >> 32 & 0xffff) == serial;
    const auto newest = static_cast<std::uint32_t>(before);
    if (is_comparable && static_cast<std::int32_t>(sequence - newest) <= 0) return false;
  } while (!newest_command_.compare_exchange_weak(before, kPresent | serial << 32 | sequence,
                                                  std::memory_order_acq_rel,
                                                  std::memory_order_acquire));
  return true;
}

// Checks in the order of a real device.
DeviceOutcome ReplayedDevice::submit(const device::Command& request, MonotonicTime now) noexcept {
  const gvd::ClientCommand command = gvd::from_wire(request);
  if (!lease_.renew(command.lease)) return DeviceOutcome::kNotHolder;
  if (emergency_.is_set()) return DeviceOutcome::kEmergencyStop;
  if (!is_active(now)) return DeviceOutcome::kNotActive;
  if (!limiter_.takes(command.setpoint.mode)) return DeviceOutcome::kWrongMode;
  if (!is_newest(command.lease, command.sequence)) return DeviceOutcome::kSuperseded;
  if (!lease_.use(command.lease)) return DeviceOutcome::kNotHolder;
  if (!gvd::is_finite(command.setpoint)) return DeviceOutcome::kNotFinite;
  return DeviceOutcome::kDone;
}

rpc::Result<device::Outcome> ReplayedDevice::command(const device::Command& request,
                                                     const rpc::CallContext& context) {
  const DeviceOutcome outcome = submit(request, context.received);
  if (outcome != DeviceOutcome::kDone) {
    refused_count_.fetch_add(1, std::memory_order_relaxed);
    return to_wire(outcome);
  }
  command_count_.fetch_add(1, std::memory_order_relaxed);
  const device::Sample* const shown = last_shown(context.received);
  if (config_.commands != nullptr && shown != nullptr) {
    config_.commands->take(request, shown->sequence());
  }
  return to_wire(DeviceOutcome::kDone);
}

rpc::Result<device::Lease> ReplayedDevice::acquire(const rpc::CallContext&) {
  if (lease_.holder() != gvd::Lease::kNobody) return refused_to_wire(DeviceOutcome::kHeld);
  const auto id = lease_.acquire();
  return id ? gvd::granted_to_wire(*id, lease_.config()) : refused_to_wire(DeviceOutcome::kTooSoon);
}

rpc::Result<device::Lease> ReplayedDevice::take_over(const rpc::CallContext& context) {
  if (context.priority.value() < description_.operator_priority) {
    return refused_to_wire(DeviceOutcome::kBelowOperatorPriority);
  }
  const auto id = lease_.take_over();
  return id ? gvd::granted_to_wire(*id, lease_.config().of_operator())
            : refused_to_wire(DeviceOutcome::kTooSoon);
}

rpc::Result<device::Outcome> ReplayedDevice::renew(const device::Holder& request,
                                                   const rpc::CallContext&) {
  return to_wire(lease_.renew(request.lease()) ? DeviceOutcome::kDone : DeviceOutcome::kNotHolder);
}

rpc::Result<device::Outcome> ReplayedDevice::release(const device::Holder& request,
                                                     const rpc::CallContext&) {
  return to_wire(lease_.release(request.lease()) ? DeviceOutcome::kDone
                                                 : DeviceOutcome::kNotHolder);
}

rpc::Result<device::LeaseStanding> ReplayedDevice::lease_state(const device::Holder& request,
                                                               const rpc::CallContext&) {
  return device::LeaseStanding{static_cast<std::uint8_t>(lease_.state_of(request.lease()))};
}

device::Outcome ReplayedDevice::use(const device::Holder& holder) noexcept {
  return to_wire(lease_.use(holder.lease()) ? DeviceOutcome::kDone : DeviceOutcome::kNotHolder);
}

rpc::Result<device::Outcome> ReplayedDevice::recover(const device::Holder& request,
                                                     const rpc::CallContext&) {
  return use(request);
}

rpc::Result<device::Outcome> ReplayedDevice::activate(const device::Holder& request,
                                                      const rpc::CallContext&) {
  const device::Outcome outcome = use(request);
  if (outcome.code() == device::OutcomeCode::Done) is_deactivated_ = false;
  return outcome;
}

rpc::Result<device::Outcome> ReplayedDevice::deactivate(const device::Holder& request,
                                                        const rpc::CallContext&) {
  const device::Outcome outcome = use(request);
  if (outcome.code() == device::OutcomeCode::Done) is_deactivated_ = true;
  return outcome;
}

rpc::Result<device::Outcome> ReplayedDevice::emergency_stop(const device::Stop& request,
                                                            const rpc::CallContext&) {
  emergency_.stop();
  gvd::EmergencyStops* const others = config_.emergency_stops;
  if (request.scope() == device::StopScope::Server && others != nullptr) others->stop_devices();
  if (request.scope() == device::StopScope::System &&
      (others == nullptr || !others->stop_system())) {
    return to_wire(DeviceOutcome::kNotInSystem);
  }
  return to_wire(DeviceOutcome::kDone);
}

rpc::Result<device::Outcome> ReplayedDevice::rearm(const device::Holder& request,
                                                   const rpc::CallContext&) {
  const std::uint32_t stop_number = emergency_.number();
  const device::Outcome outcome = use(request);
  if (outcome.code() == device::OutcomeCode::Done) emergency_.rearm(stop_number);
  return outcome;
}

rpc::Result<void> ReplayedDevice::set_models(const device::SetModelsRequest& request,
                                             rpc::ReplyBuilder<device::SetModelsReply>& reply,
                                             const rpc::CallContext& context) {
  // Rare, and refusals come with words.
  const rt::AllowAllocationScope set_up;
  const bool has_models = request.models()->size() > 0;
  DeviceOutcome outcome = DeviceOutcome::kDone;
  if (!lease_.use(request.lease())) {
    outcome = DeviceOutcome::kNotHolder;
  } else if (emergency_.is_set()) {
    outcome = DeviceOutcome::kEmergencyStop;
  } else if (!is_active(context.received)) {
    outcome = DeviceOutcome::kNotActive;
  } else if (has_models) {
    outcome = DeviceOutcome::kOutOfRange;
  }
  flatbuffers::FlatBufferBuilder& builder = reply.builder();
  const device::Outcome wire = to_wire(outcome);
  const auto words = outcome == DeviceOutcome::kOutOfRange
                         ? builder.CreateString(kNoModels.data(), kNoModels.size())
                         : flatbuffers::Offset<flatbuffers::String>{};
  reply.finish(device::CreateSetModelsReply(builder, &wire, words));
  return {};
}

rpc::Result<void> ReplayedDevice::read_flight_record(
    const device::FlightRecordRequest&, rpc::ReplyBuilder<device::FlightRecordReply>& reply,
    const rpc::CallContext&) {
  // People read it, so it may allocate. The log is empty: a replayed device has no faults.
  const rt::AllowAllocationScope set_up;
  flatbuffers::FlatBufferBuilder& builder = reply.builder();
  const auto none = builder.CreateVectorOfStructs<device::FlightRecord>({});
  reply.finish(device::CreateFlightRecordReply(builder, 0, device::FlightCause::None, 0, 0, none));
  return {};
}

}  // namespace rtpm::replay
