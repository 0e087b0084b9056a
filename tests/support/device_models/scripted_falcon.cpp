#include "scripted_falcon.hpp"

namespace rtpm::test {
namespace {

using device_falcon::Received;
using device_falcon::UsbStatus;

UsbStatus status_of(UsbReply reply) {
  switch (reply) {
    case UsbReply::kOk:
      return UsbStatus::kOk;
    case UsbReply::kNothingYet:
      return UsbStatus::kTimeout;
    case UsbReply::kStall:
      return UsbStatus::kStalled;
    case UsbReply::kOverflow:
      return UsbStatus::kOverflow;
    case UsbReply::kNoDevice:
      return UsbStatus::kGone;
  }
  return UsbStatus::kGone;
}

}  // namespace

UsbStatus ScriptedFalcon::request(device_falcon::FtdiRequest request, std::uint16_t value) {
  const UsbSetup setup{.type = device_falcon::kVendorRequestType,
                       .request = static_cast<std::uint8_t>(request),
                       .value = value};
  const UsbStatus status = status_of(model_->control(setup, {}).reply);
  model_->advance(status == UsbStatus::kTimeout ? kRequestPatience : kStep);
  return status;
}

UsbStatus ScriptedFalcon::send(std::span<const std::byte> bytes) {
  return status_of(model_->write(bytes).reply);
}

Received ScriptedFalcon::receive(std::span<std::byte> buffer, Duration patience) {
  const MonotonicTime end = now() + patience;
  while (true) {
    const UsbAnswer answer = model_->read(buffer);
    if (answer.reply != UsbReply::kNothingYet) {
      return {status_of(answer.reply), answer.size, now()};
    }
    if (now() >= end) return {UsbStatus::kTimeout, 0, now()};
    model_->advance(std::min(kStep, end - now()));
  }
}

device_falcon::OpenTransport open_scripted(std::shared_ptr<FalconModel> model) {
  return [model]() -> expected<std::unique_ptr<device_falcon::Transport>, SetupError> {
    if (!model->is_plugged_in()) return setup_error("no Falcon is plugged in");
    return std::make_unique<ScriptedFalcon>(model);
  };
}

}  // namespace rtpm::test
