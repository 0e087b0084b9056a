// rtpm-display: the paper's graphics consumer, in text. It subscribes to the events of devices of
// any class, at its own pace, and shows each device in one line.
#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "configuration.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/gvd/client.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/program/stop_signal.hpp"
#include "rtpm/program/terminal.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/log.hpp"
#include "view.hpp"

namespace rtpm::display {
namespace {

constexpr std::size_t kTerminalWidth = 80;  ///< Used if the terminal does not report it.
constexpr std::size_t kPrintedWidth = 100;
constexpr std::size_t kCurveSize = 12;
constexpr Duration kSilence = std::chrono::milliseconds{500};

/// A device with its view and its two subscriptions: samples at the display's pace, and all
/// changes.
struct Shown {
  std::unique_ptr<View> view{};
  gvd::DeviceConsumer samples;
  gvd::DeviceConsumer changes;
};

gvd::DeviceConsumerConfig subscription(const Configuration& configuration,
                                       const std::string& device) {
  gvd::DeviceConsumerConfig config{.hub = configuration.events, .devices = {device}};
  config.subscription.name = "display";
  config.subscription.realtime = rt::RealtimeMode::kOff;
  return config;
}

expected<Shown, SetupError> show(rpc::Node& node, const Configuration& configuration,
                                 const std::string& device) {
  auto client = gvd::DeviceClient::open(node, device);
  if (!client) return unexpected{std::move(client.error())};
  auto view = std::make_unique<View>(device, client->descriptor(), kCurveSize);
  auto of_samples = subscription(configuration, device);
  of_samples.subscription.filter =
      events::any_of({gvd::samples_of(device), events::silence(kSilence)});
  of_samples.subscription.delivery = {.interval = std::chrono::duration_cast<Duration>(
                                          std::chrono::duration<double>(1 / configuration.rate_hz)),
                                      .replay = 1};
  auto samples = gvd::DeviceConsumer::start(node, std::move(of_samples), *view);
  if (!samples) return unexpected{std::move(samples.error())};
  auto of_changes = subscription(configuration, device);
  of_changes.subscription.filter = gvd::changes_of(device);
  auto changes = gvd::DeviceConsumer::start(node, std::move(of_changes), *view);
  if (!changes) return unexpected{std::move(changes.error())};
  return Shown{std::move(view), std::move(*samples), std::move(*changes)};
}

std::size_t name_width(const Configuration& configuration) {
  std::size_t width = 0;
  for (const std::string& device : configuration.devices)
    width = std::max(width, printable(device).size());
  return width;
}

void print_lines(const std::vector<Shown>& devices, std::size_t width, bool is_rewriting) {
  // A line that wraps can't be rewritten.
  const std::size_t line_width =
      is_rewriting ? program::terminal_width(kTerminalWidth) - 1 : kPrintedWidth;
  for (const Shown& device : devices) {
    std::printf("%s%s\n", is_rewriting ? "\r\033[K" : "",
                device.view->line(width, line_width).c_str());
  }
  std::fflush(stdout);
}

void watch(const std::vector<Shown>& devices, const Configuration& configuration,
           const program::StopSignal& stop) {
  const bool is_rewriting = configuration.live == "rewrite";
  const Duration pause =
      is_rewriting ? Duration{std::chrono::milliseconds{100}} : Duration{std::chrono::seconds{1}};
  const MonotonicTime end =
      configuration.seconds > 0
          ? rt::now() + std::chrono::duration_cast<Duration>(
                            std::chrono::duration<double>(configuration.seconds))
          : kNever;
  const std::size_t width = name_width(configuration);
  bool is_first = true;
  while (!stop.wait_for(pause) && rt::now() < end) {
    if (is_rewriting && !is_first) std::printf("\033[%zuA", devices.size());
    is_first = false;
    print_lines(devices, width, is_rewriting);
    if (!is_rewriting && devices.size() > 1) std::puts("");
  }
}

void print_summary(const std::vector<Shown>& devices) {
  std::puts("");
  for (const Shown& device : devices) {
    const Sight sight = device.view->sight();
    std::printf(
        "%s: %llu of %llu samples shown, %llu presses, %llu contacts, %llu changes of the lease, "
        "%llu others, %llu gaps\n",
        printable(device.view->name()).c_str(), static_cast<unsigned long long>(sight.sample_count),
        static_cast<unsigned long long>(sight.cycle_count),
        static_cast<unsigned long long>(sight.press_count),
        static_cast<unsigned long long>(sight.contact_count),
        static_cast<unsigned long long>(sight.lease_count),
        static_cast<unsigned long long>(sight.other_count),
        static_cast<unsigned long long>(sight.gap_count));
  }
}

int serve(const Configuration& configuration) {
  // Created before any thread, so that all threads inherit its blocked signals.
  const program::StopSignal stop(program::LostOutput::kRequestsEnd);
  rpc::Node node(
      {.wait = {.strategy = rt::WaitStrategy::kBlock}, .security = configuration.security});
  names::RegistryResolver resolver(node, configuration.registry);
  node.use(resolver);
  std::vector<Shown> devices;
  for (const std::string& name : configuration.devices) {
    auto shown = show(node, configuration, name);
    if (!shown) {
      rt::print_error("rtpm-display", shown.error().text());
      return 1;
    }
    devices.push_back(std::move(*shown));
  }
  watch(devices, configuration, stop);
  print_summary(devices);
  return 0;
}

}  // namespace
}  // namespace rtpm::display

int main(int argc, char** argv) {
  rtpm::display::Configuration configuration;
  if (const auto exit_code = rtpm::display::read_configuration(argc, argv, configuration)) {
    return *exit_code;
  }
  return rtpm::display::serve(configuration);
}
