#include "rtpm/capture/command_recorder.hpp"

#include <cstring>
#include <mutex>
#include <utility>
#include <vector>

#include "device_schemas.hpp"
#include "rtpm/capture/channels.hpp"
#include "rtpm/gvd/wire.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/pi_mutex.hpp"

namespace rtpm::capture {

struct CommandRecorder::Impl {
  Impl(recording::Recorder& given, std::uint16_t number)
      : recorder(given), track(given.add_track()), channel(number) {
    flatbuffers::FlatBufferBuilder builder;
    const device::Command blank{};
    builder.Finish(device::CreateCommandRequest(builder, &blank));
    const auto bytes = std::as_bytes(std::span(builder.GetBufferPointer(), builder.GetSize()));
    table.assign(bytes.begin(), bytes.end());
    const auto* const at = static_cast<const void*>(
        flatbuffers::GetRoot<device::CommandRequest>(table.data())->command());
    offset = static_cast<std::size_t>(static_cast<const std::byte*>(at) - table.data());
  }

  recording::Recorder& recorder;
  recording::Recorder::Track& track;
  std::uint16_t channel;
  rt::PiMutex mutex{};
  std::vector<std::byte> table{};  ///< A finished CommandRequest,
  std::size_t offset = 0;          ///< in which the command is here.
};

expected<std::unique_ptr<CommandRecorder>, SetupError> CommandRecorder::create(
    recording::Recorder& recorder, const std::string& device) {
  const auto channel = add_device_channel(
      recorder, device,
      {.kind = kCommandKind, .leaf = "command", .type = "rtpm.device.CommandRequest"});
  if (!channel) return unexpected{channel.error()};
  return std::unique_ptr<CommandRecorder>(
      new CommandRecorder(std::make_unique<Impl>(recorder, *channel)));
}

CommandRecorder::CommandRecorder(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
CommandRecorder::~CommandRecorder() = default;

void CommandRecorder::record(const device::Command& command,
                             std::uint64_t sample_sequence) noexcept {
  gvd::ClientCommand without_lease = gvd::from_wire(command);
  without_lease.lease = 0;
  const device::Command kept = gvd::to_wire(without_lease);
  const std::lock_guard lock(impl_->mutex);
  std::memcpy(impl_->table.data() + impl_->offset, &kept, sizeof kept);
  const std::uint64_t now_ns = impl_->recorder.log_time_ns(rt::now());
  static_cast<void>(impl_->track.put({.channel_id = impl_->channel,
                                      .sequence = static_cast<std::uint32_t>(sample_sequence),
                                      .log_time_ns = now_ns,
                                      .publish_time_ns = now_ns,
                                      .data = impl_->table}));
}

}  // namespace rtpm::capture
