// A plug-in that does what its argument says: "exchange", "first" or "configure" block for ever in
// exchange(), in its first call, or in configure(); "error" and "timeless" are wrong at set-up.
#include <unistd.h>

#include <memory>
#include <string>

#include "rtpm/driver/plugin.hpp"

namespace {

using namespace rtpm::driver;

class Stubborn final : public Driver {
 public:
  explicit Stubborn(std::string_view behaviour) : behaviour_(behaviour) {}

  [[nodiscard]] Descriptor describe() const override {
    Descriptor descriptor;
    descriptor.model = "stubborn";
    descriptor.serial = "s-1";
    descriptor.frame = "stubborn/base";
    if (behaviour_ == "timeless") descriptor.rate_hz = 0;
    return descriptor;
  }
  [[nodiscard]] rtpm::expected<void, rtpm::SetupError> configure(const DriverConfig&) override {
    if (behaviour_ == "configure") block();
    return {};
  }
  [[nodiscard]] rtpm::expected<void, rtpm::SetupError> activate() override { return {}; }
  [[nodiscard]] ExchangeStatus exchange(const Command& command, Sample& sample) noexcept override {
    ++exchange_count_;
    if (behaviour_ == "first" || (behaviour_ == "exchange" && exchange_count_ > 100)) block();
    sample.host_time = command.cycle_time;
    return ExchangeStatus::kOk;
  }
  void deactivate() noexcept override {}

 private:
  static void block() noexcept {
    for (;;)
      pause();
  }

  std::string behaviour_;
  int exchange_count_ = 0;
};

rtpm::expected<std::unique_ptr<Driver>, rtpm::SetupError> make(std::string_view arguments) {
  if (arguments == "error") return rtpm::setup_error("it will not", "", "ask it nicely");
  return std::make_unique<Stubborn>(arguments);
}

}  // namespace

RTPM_DRIVER_PLUGIN(&make);
