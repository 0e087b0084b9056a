#pragma once

#include <memory>
#include <utility>

#include "falcon_model.hpp"
#include "rtpm/device_falcon/transport.hpp"

namespace rtpm::test {

/// A transport whose other end is a model, on the model's time line.
class ScriptedFalcon final : public device_falcon::Transport {
 public:
  /// How often it asks the model.
  static constexpr Duration kStep = std::chrono::microseconds{125};
  static constexpr Duration kRequestPatience = std::chrono::milliseconds{100};

  explicit ScriptedFalcon(std::shared_ptr<FalconModel> model) : model_(std::move(model)) {}

  [[nodiscard]] device_falcon::UsbStatus request(device_falcon::FtdiRequest request,
                                                 std::uint16_t value) override;
  [[nodiscard]] device_falcon::UsbStatus send(std::span<const std::byte> bytes) override;
  [[nodiscard]] device_falcon::Received receive(std::span<std::byte> buffer,
                                                Duration patience) override;
  [[nodiscard]] MonotonicTime now() const override { return model_->now(); }

 private:
  std::shared_ptr<FalconModel> model_;
};

/// Opens the model, as long as it is plugged in.
[[nodiscard]] device_falcon::OpenTransport open_scripted(std::shared_ptr<FalconModel> model);

}  // namespace rtpm::test
