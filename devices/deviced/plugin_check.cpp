#include "plugin_check.hpp"

#include <cstdio>
#include <cstdlib>
#include <memory>
#include <utility>

#include "rtpm/base/printable.hpp"
#include "rtpm/driver_host/check.hpp"
#include "rtpm/driver_host/plugin.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/rt/semaphore.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::deviced {
namespace {

constexpr std::chrono::seconds kCheckPatience{60};
constexpr int kExitDriverBlocks = 3;

class PluginMaker final : public driver_host::DriverMaker {
 public:
  PluginMaker(const std::string& file, const std::string& arguments)
      : file_(file), arguments_(arguments) {}
  [[nodiscard]] expected<std::unique_ptr<driver::Driver>, SetupError> make() override {
    return driver_host::load_plugin(file_, arguments_);
  }

 private:
  const std::string& file_;
  const std::string& arguments_;
};

/// Ends the program if a check takes too long.
class HangGuard {
 public:
  explicit HangGuard(const char* check) {
    auto thread = rt::Thread::start({.name = "check-guard"}, [this, check] {
      if (has_ended_.wait_until(rt::now() + kCheckPatience)) return;
      rt::print_error("rtpm-deviced", std::string(check) + ": the driver has not returned for " +
                                          std::to_string(kCheckPatience.count()) +
                                          " s. Remedy: each call of a driver must return");
      std::_Exit(kExitDriverBlocks);
    });
    if (thread) thread_ = std::move(*thread);
  }
  HangGuard(const HangGuard&) = delete;
  HangGuard& operator=(const HangGuard&) = delete;
  ~HangGuard() {
    has_ended_.post();
    thread_.join();
  }

 private:
  rt::Semaphore has_ended_{};
  rt::Thread thread_{};
};

/// The period for the driver's stated rate; 1 ms if it states none.
Duration period_of(const driver::Descriptor& descriptor) {
  const bool is_rate = descriptor.rate_hz >= 10 && descriptor.rate_hz <= 50'000;
  const double rate_hz = is_rate ? descriptor.rate_hz : 1000;
  return std::chrono::duration_cast<Duration>(std::chrono::duration<double>(1 / rate_hz));
}

}  // namespace

int check_plugin(const std::string& file, const std::string& arguments) {
  PluginMaker maker(file, arguments);
  Duration period{};
  {
    const HangGuard guard("the plug-in");
    const auto driver = maker.make();
    if (!driver) {
      rt::print_error("rtpm-deviced", driver.error().text());
      return 1;
    }
    period = period_of((*driver)->describe());
  }
  int broken_count = 0;
  for (const driver_host::DriverCheck& check : driver_host::driver_checks()) {
    const HangGuard guard(check.name);
    const auto breaches =
        driver_host::run_check(check, maker, period, driver_host::CheckPace::kReal);
    std::printf("%-7s %s\n", breaches.empty() ? "ok" : "broken", check.name);
    for (const std::string& breach : breaches)
      std::printf("        %s\n", printable(breach).c_str());
    std::fflush(stdout);
    if (!breaches.empty()) ++broken_count;
  }
  std::printf("%d of %zu promises are broken\n", broken_count, driver_host::driver_checks().size());
  return broken_count == 0 ? 0 : 1;
}

}  // namespace rtpm::deviced
