// rtpm-media: the paper's §3.2. A knob with detents drives a media player; they may be on different
// hosts.
#include <cstdio>
#include <memory>
#include <string_view>

#include "clip.hpp"
#include "configuration.hpp"
#include "line.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/program/stop_signal.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/log.hpp"
#include "session.hpp"

namespace rtpm::media {
namespace {

constexpr int kSetUpFailed = 1;
constexpr int kDeviceLost = 3;

int fail(int exit_code, std::string_view text) {
  rt::print_error("rtpm-media", text);
  return exit_code;
}

/// Rewrites one line ten times a second, or prints one line per second.
class Display {
 public:
  explicit Display(bool is_headless) noexcept : is_headless_(is_headless) {}
  void show(const Session& session, MonotonicTime now) {
    if (now < next_) return;
    next_ = now + (is_headless_ ? Duration{std::chrono::seconds{1}}
                                : Duration{std::chrono::milliseconds{100}});
    std::printf(is_headless_ ? "%s\n" : "\r\033[K%s", session.line().c_str());
    std::fflush(stdout);
  }
  void end() const {
    if (!is_headless_) std::printf("\n");
  }

 private:
  bool is_headless_;
  MonotonicTime next_{};
};

int play(const Configuration& configuration) {
  const program::StopSignal stop(program::LostOutput::kRequestsEnd);
  rpc::Node node({.security = configuration.security});
  names::RegistryResolver resolver(node, configuration.registry);
  node.use(resolver);
  auto session = Session::open(node, configuration);
  if (!session) return fail(kSetUpFailed, session.error().text());
  std::printf("%s drives %s\n", printable(configuration.knob).c_str(),
              printable(configuration.player).c_str());
  Display display(configuration.is_headless);
  const MonotonicTime begin = rt::now();
  const MonotonicTime end = configuration.seconds > 0
                                ? begin + std::chrono::duration_cast<Duration>(
                                              std::chrono::duration<double>(configuration.seconds))
                                : kNever;
  for (MonotonicTime due = begin; due < end && !stop.wait_for(due - rt::now());) {
    if (const auto stepped = (*session)->step(); !stepped) {
      display.end();
      return fail(kDeviceLost, stepped.error().text());
    }
    const MonotonicTime now = rt::now();
    display.show(**session, now);
    // Cycles already over are skipped.
    due += configuration.period() * ((now - due) / configuration.period() + 1);
  }
  display.end();
  std::printf("%s\n", follow_text((*session)->meter()).c_str());
  return 0;
}

}  // namespace
}  // namespace rtpm::media

int main(int argc, char** argv) {
  rtpm::media::Configuration configuration;
  if (const auto exit_code = rtpm::media::read_configuration(argc, argv, configuration)) {
    return *exit_code;
  }
  if (configuration.clip.empty()) return rtpm::media::play(configuration);
  if (const auto written = rtpm::media::write_clip(configuration.clip); !written) {
    return rtpm::media::fail(rtpm::media::kSetUpFailed, written.error().text());
  }
  return 0;
}
