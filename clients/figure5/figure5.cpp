// The program of the paper's Figure 5, line by line where possible, with both of its models: a
// client opens a haptic device, reads one position at a high priority and another at a low one, and
// sends a force back; a consumer gets the device's samples as events, at its own pace.
#include <cstdio>
#include <string>

#include "rtpm/gvd/client.hpp"
#include "rtpm/gvd/consumer.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/options/options.hpp"
#include "rtpm/program/stop_signal.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/log.hpp"

namespace {

using rtpm::driver::Sample;
using rtpm::driver::Vector3;

/// Overrides the push() operation of the consumer, as in the paper.
class PositionPrinter final : public rtpm::gvd::SampleSink {
 public:
  void push(const Sample& sample) override {
    const Vector3& at = sample.pose.position_m;
    std::printf("new position = %+.4f %+.4f %+.4f m\n", at.x, at.y, at.z);
    std::fflush(stdout);
  }
};

/// A soft spring towards the middle in x, and some lift in y.
Vector3 calculate_force(double x_m, double y_m) {
  return {-40 * x_m, 0.2 - 10 * y_m, 0};
}

int fail(const std::string& text) {
  rtpm::rt::print_error("rtpm-figure5", text);
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  std::string device = "lab/arm0";
  std::string hub{rtpm::events::kHubPath};
  std::string registry{rtpm::names::kThisHost};
  rtpm::options::Options options("rtpm-figure5",
                                 "the paper's Figure 5: one device, two ways to use it");
  options.add("device", device, "The device's name, or its URL");
  options.add("events", hub, "The hub of the device's events, by name or URL");
  options.add_registry(registry);
  rtpm::rpc::NodeSecurity security;
  rtpm::options::add_caller(options, security);
  if (const auto exit_code = options.parse(argc, argv)) return *exit_code;

  const rtpm::program::StopSignal stop(rtpm::program::LostOutput::kRequestsEnd);
  rtpm::rpc::Node node({.security = security});
  rtpm::names::RegistryResolver resolver(node, registry);
  node.use(resolver);

  auto arm = rtpm::gvd::DeviceClient::open(node, device);  // start device
  if (!arm) return fail(arm.error().text());
  if (auto acquired = arm->acquire(); !acquired) {
    return fail("no right to command " + device + ": " + std::string(to_string(acquired.error())));
  }
  PositionPrinter printer;
  rtpm::gvd::DeviceConsumerConfig config{.hub = hub};
  config.subscription.delivery.interval = std::chrono::milliseconds{500};
  auto consumer = rtpm::gvd::DeviceConsumer::start(node, device, config, printer);
  if (!consumer) return fail(consumer.error().text());

  while (!stop.wait_for(std::chrono::milliseconds{5})) {
    const auto x = arm->read({.priority = 3});
    const auto y = arm->read({.priority = 1});
    if (!x || !y) return fail(device + " was lost");
    const Vector3 force = calculate_force(x->pose.position_m.x, y->pose.position_m.y);
    if (const auto sent = arm->set_force(force); !sent) {
      return fail("the force did not arrive: " + std::string(to_string(sent.error())));
    }
  }
  return 0;  // The destructors stop the consumer and close the device.
}
