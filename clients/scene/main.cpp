// rtpm-scene: the graphics node of the paper's §3.1. It subscribes to the samples of a device and
// to the touches of its force node, at its own pace, and draws both.
#include <array>
#include <cstdio>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "braille.hpp"
#include "configuration.hpp"
#include "drawing.hpp"
#include "picture.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/gvd/consumer.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/program/stop_signal.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/log.hpp"
#include "touch_event.hpp"
#include "view.hpp"

namespace rtpm::scene {
namespace {

constexpr std::size_t kPanelColumns = 38;
constexpr std::size_t kPanelRows = 13;
/// The length of the trail in a live frame: 2 s at 60 Hz.
constexpr std::size_t kTrailCount = 120;
constexpr std::size_t kPictureForceStride = 10;

using TouchConsumer = events::TypedConsumer<touch::TouchedEvent>;

class SampleView final : public gvd::SampleSink {
 public:
  explicit SampleView(View& view) noexcept : view_(view) {}
  void push(const driver::Sample& sample) override { view_.see(sample, rt::now()); }

 private:
  View& view_;
};

events::ConsumerConfig subscription(const Configuration& configuration, const char* name) {
  events::ConsumerConfig config{.name = name};
  config.realtime = rt::RealtimeMode::kOff;
  config.delivery.interval = std::chrono::duration_cast<Duration>(
      std::chrono::duration<double>(1 / configuration.rate_hz));
  return config;
}

expected<TouchConsumer, SetupError> start_touches(rpc::Node& node,
                                                  const Configuration& configuration, View& view) {
  auto config = subscription(configuration, "touches");
  config.filter =
      events::of_type(touch::TouchedEvent::kType, touch_source_of(configuration.device));
  return TouchConsumer::create(
      node, configuration.events,
      [&view](const touch::State& state, const events::EventHeader&) {
        if (const auto report = from_wire(state)) view.see(*report, rt::now());
      },
      std::move(config));
}

std::array<Panel, 2> panels(const History& history, std::size_t force_stride) {
  const Story story{history.device_m, history.touches, force_stride};
  return {section_panel(story), front_panel(story)};
}

/// Prints section and front side by side, and a line of numbers.
void print_frame(const View& view, const std::string& status, bool is_first) {
  const auto drawn = panels(view.history(kTrailCount), kTrailCount);
  const auto left = braille_rows(drawn[0], kPanelColumns, kPanelRows, true);
  const auto right = braille_rows(drawn[1], kPanelColumns, kPanelRows, true);
  std::string frame = is_first ? "" : "\r\033[" + std::to_string(kPanelRows) + "A";
  for (std::size_t row = 0; row < kPanelRows; ++row)
    frame += left[row] + "  " + right[row] + "\n";
  std::fputs((frame + "\033[K" + status).c_str(), stdout);
  std::fflush(stdout);
}

/// Draws until the end; returns the number of frames.
std::uint64_t watch(const View& view, const Configuration& configuration,
                    const program::StopSignal& stop, MonotonicTime begin) {
  const auto length = [](double seconds) {
    return std::chrono::duration_cast<Duration>(std::chrono::duration<double>(seconds));
  };
  const bool is_drawing = configuration.live == "rewrite";
  const MonotonicTime end =
      configuration.seconds > 0 ? begin + length(configuration.seconds) : kNever;
  MonotonicTime next_line = begin + std::chrono::seconds{1};
  std::uint64_t frame_count = 0;
  MonotonicTime due = begin;
  while (due < end && !stop.wait_for(due - rt::now())) {
    const MonotonicTime now = rt::now();
    const std::string status = status_text(view.sight(), now, now - begin);
    if (is_drawing) print_frame(view, status, frame_count == 0);
    if (configuration.live == "lines" && now >= next_line) {
      std::puts(status.c_str());
      std::fflush(stdout);
      next_line += std::chrono::seconds{1};
    }
    ++frame_count;
    // A slow terminal skips frames.
    due = std::max(due + length(1 / configuration.rate_hz), now);
  }
  if (is_drawing) std::puts("");
  return frame_count;
}

expected<void, SetupError> write_picture(const View& view, const Configuration& configuration) {
  if (configuration.picture.empty()) return {};
  const auto drawn = panels(view.history(View::kHistoryMax), kPictureForceStride);
  const Sight sight = view.sight();
  return write_file(configuration.picture,
                    svg_text(drawn, caption_text(sight, printable(configuration.device))));
}

int fail(const SetupError& error) {
  rt::print_error("rtpm-scene", error.text());
  return 1;
}

int serve(const Configuration& configuration) {
  // Created before any thread, so that all threads inherit its blocked signals.
  const program::StopSignal stop(program::LostOutput::kRequestsEnd);
  rpc::Node node(
      {.wait = {.strategy = rt::WaitStrategy::kBlock}, .security = configuration.security});
  names::RegistryResolver resolver(node, configuration.registry);
  node.use(resolver);
  View view;
  SampleView sample_view(view);
  gvd::DeviceConsumerConfig of_samples{.hub = configuration.events};
  of_samples.subscription = subscription(configuration, "samples");
  const auto samples =
      gvd::DeviceConsumer::start(node, configuration.device, std::move(of_samples), sample_view);
  if (!samples) return fail(samples.error());
  const auto touches = start_touches(node, configuration, view);
  if (!touches) return fail(touches.error());
  const MonotonicTime begin = rt::now();
  const std::uint64_t frame_count = watch(view, configuration, stop, begin);
  std::puts(summary_text(view.sight(), frame_count, rt::now() - begin).c_str());
  std::fflush(stdout);
  const auto written = write_picture(view, configuration);
  return written ? 0 : fail(written.error());
}

}  // namespace
}  // namespace rtpm::scene

int main(int argc, char** argv) {
  rtpm::scene::Configuration configuration;
  if (const auto exit_code = rtpm::scene::read_configuration(argc, argv, configuration)) {
    return *exit_code;
  }
  return rtpm::scene::serve(configuration);
}
