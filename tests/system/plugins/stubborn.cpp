// A plug-in whose behaviour its argument selects: "exchange", "first" or "configure" block for ever
// in exchange(), in its first call, or in configure(); "error", "timeless", "buttons" and
// "describe" are wrong at set-up; "crash:FILE" writes to unmapped memory once FILE exists;
// "hold:FILE" does not return from exchange() while FILE exists; "mark:FILE" creates FILE when it
// is deactivated.
#include <poll.h>
#include <unistd.h>

#include <fstream>
#include <memory>
#include <stdexcept>
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
    if (behaviour_ == "buttons") descriptor.buttons.assign(40, "button");
    if (behaviour_ == "describe") throw std::runtime_error("it is shy");
    return descriptor;
  }
  [[nodiscard]] rtpm::expected<void, rtpm::SetupError> configure(const DriverConfig&) override {
    if (behaviour_ == "configure") block();
    return {};
  }
  [[nodiscard]] rtpm::expected<void, rtpm::SetupError> activate() override { return {}; }
  [[nodiscard]] ExchangeStatus exchange(const Command& command, Sample& sample) noexcept override {
    ++exchange_count_;
    if (crash_file_ != nullptr && access(crash_file_, F_OK) == 0) {
      unlink(crash_file_);
      crash();
    }
    while (hold_file_ != nullptr && access(hold_file_, F_OK) == 0)
      poll(nullptr, 0, /*timeout=*/1);
    if (behaviour_ == "first" || (behaviour_ == "exchange" && exchange_count_ > 100)) block();
    sample.host_time = command.cycle_time;
    return ExchangeStatus::kOk;
  }
  void deactivate() noexcept override {
    constexpr std::string_view kMark = "mark:";
    if (behaviour_.starts_with(kMark)) std::ofstream(behaviour_.substr(kMark.size())).put(' ');
  }

 private:
  static void block() noexcept {
    for (;;)
      pause();
  }

  /// The write is in its own function, so that it is not optimised away.
  [[gnu::noinline]] static void crash() noexcept {
    int* volatile nowhere = nullptr;
    *nowhere = 1;
  }
  /// The file of "PREFIX:FILE"; null if another behaviour is selected.
  [[nodiscard]] const char* file_after(std::string_view prefix) const noexcept {
    return behaviour_.starts_with(prefix) ? behaviour_.c_str() + prefix.size() : nullptr;
  }

  std::string behaviour_;
  const char* crash_file_ = file_after("crash:");
  const char* hold_file_ = file_after("hold:");
  int exchange_count_ = 0;
};

rtpm::expected<std::unique_ptr<Driver>, rtpm::SetupError> make(std::string_view arguments) {
  if (arguments == "error") return rtpm::setup_error("it will not", "", "ask it nicely");
  return std::make_unique<Stubborn>(arguments);
}

}  // namespace

RTPM_DRIVER_PLUGIN(&make);
