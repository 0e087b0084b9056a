#include "events/echo_device.hpp"

#include <atomic>
#include <device_events.rtpm.events.hpp>
#include <utility>

#include "cli/output.hpp"
#include "events/payload_json.hpp"
#include "objects/unbound.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/gvd/poller.hpp"
#include "rtpm/gvd/wire.hpp"
#include "rtpm/program/text.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::tool {
namespace {

constexpr Duration kPollPeriod = std::chrono::milliseconds{50};

class EchoSink final : public gvd::SampleSink {
 public:
  EchoSink(const DeviceEchoRequest& request, bool as_json)
      : device_(request.device), as_json_(as_json), left_count_(request.count) {}

  void push(const driver::Sample& sample) override {
    if (is_done_) return;
    const device::Sample wire = gvd::to_wire(sample);
    Json payload =
        payload_json(schemas_, rpc::struct_bytes(wire), &device::SampledEvent::kDescriptor);
    const std::int64_t time_ns = to_ns(sample.host_time);
    if (as_json_) {
      print_json({{"device", device_},
                  {"sequence", sample.sequence},
                  {"host_time_ns", time_ns},
                  {"sample", std::move(payload)}});
    } else {
      print_line(program::formatted("%.6f  ", static_cast<double>(time_ns) * 1e-9) +
                 printable(device_) + "  #" + std::to_string(sample.sequence) + "  " +
                 printable(payload.dump(), kShownWhole));
    }
    if (left_count_ > 0 && --left_count_ == 0) is_done_ = true;
  }
  [[nodiscard]] bool is_done() const { return is_done_; }

 private:
  std::string device_;
  bool as_json_;
  std::uint64_t left_count_;
  capture::EventSchemas schemas_{};
  std::atomic<bool> is_done_{false};
};

}  // namespace

int echo_device(Context& context, const DeviceEchoRequest& request) {
  const program::StopSignal& stop = context.stop();
  EchoSink sink(request, context.json);
  gvd::DevicePollerConfig config{.rate_hz = request.rate_hz};
  config.priority = context.priority.value_or(config.priority);
  auto poller = gvd::DevicePoller::start(context.node(), request.device, config, sink);
  if (!poller)
    return context.not_reached(
        named(request.device, with_similar_names(context, request.device, poller.error())));
  const MonotonicTime end = request.time ? rt::now() + *request.time : kNever;
  bool is_absence_told = false;
  while (!sink.is_done() && rt::now() < end && !stop.wait_for(kPollPeriod)) {
    const auto error = poller->last_error();
    if (error && !is_absence_told) {
      rt::print_error("rtpm", printable(request.device) +
                                  " does not answer: " + std::string(rpc::to_string(*error)));
    }
    is_absence_told = error.has_value();
  }
  poller->stop();
  return kDone;
}

}  // namespace rtpm::tool
