#include "cli/progress.hpp"

#include <utility>

#include "cli/output.hpp"
#include "os/system.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::tool {
namespace {

constexpr int kWidth = 40;

}  // namespace

ProgressBar::ProgressBar(Context& context, std::string what)
    : context_(context), what_(std::move(what)), is_shown_(is_error_terminal() && !context.json) {
  static_cast<void>(context_.stop());
}

ProgressBar::~ProgressBar() {
  if (is_shown_) os::write_error("\r\x1b[K");
}

bool ProgressBar::show(std::uint64_t done, std::uint64_t whole) {
  // A damaged file may claim a smaller size than it has.
  const int percent =
      done >= whole
          ? 100
          : static_cast<int>(100.0 * static_cast<double>(done) / static_cast<double>(whole));
  if (is_shown_ && std::exchange(percent_, percent) != percent) {
    const auto full = static_cast<std::size_t>(kWidth * percent / 100);
    os::write_error("\r" + what_ + " [" + std::string(full, '#') + std::string(kWidth - full, ' ') +
                    "] " + std::to_string(percent) + " %");
  }
  return !context_.stop().is_requested();
}

StatusLine::StatusLine(const Context& context) : is_shown_(is_error_terminal() && !context.json) {}

StatusLine::~StatusLine() {
  if (is_shown_) os::write_error("\r\x1b[K");
}

void StatusLine::show(const std::string& text) {
  if (is_shown_) os::write_error("\r\x1b[K" + text);
}

WaitLine::WaitLine(const Context& context, std::string what, Duration after)
    : what_(std::move(what)), after_(after) {
  if (!is_error_terminal() || context.json) return;
  auto started = rt::Thread::start({.name = "progress", .realtime = rt::RealtimeMode::kOff},
                                   [this] { run(); });
  // Without the thread the command works as well, but shows no line.
  if (started) thread_ = std::move(*started);
}

WaitLine::~WaitLine() {
  if (!thread_.is_running()) return;
  {
    const std::lock_guard lock(mutex_);
    is_over_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void WaitLine::run() {
  const MonotonicTime begin = rt::now();
  bool is_shown = false;
  std::unique_lock lock(mutex_);
  Duration pause = after_;
  while (!changed_.wait_for(lock, pause, [this] { return is_over_; })) {
    const auto s = std::chrono::duration_cast<std::chrono::seconds>(rt::now() - begin).count();
    os::write_error("\r\x1b[K" + what_ + ", " + std::to_string(s) + " s; Ctrl-C ends it");
    is_shown = true;
    pause = std::chrono::seconds{1};
  }
  if (is_shown) os::write_error("\r\x1b[K");
}

}  // namespace rtpm::tool
