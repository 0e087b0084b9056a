#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <string>
#include <utility>

#include "cli/context.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::tool {

/// A progress bar on standard error if that is a terminal; Ctrl-C asks the work to stop.
/// @ownership refers to its context
/// @threads  one
class ProgressBar {
 public:
  ProgressBar(Context& context, std::string what);
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;
  /// Clears the bar.
  ~ProgressBar();

  /// Shows the progress. @return false if the work must stop
  bool show(std::uint64_t done, std::uint64_t whole);

 private:
  Context& context_;
  std::string what_;
  bool is_shown_;
  int percent_ = -1;
};

/// A changing line on standard error, if that is a terminal.
class StatusLine {
 public:
  explicit StatusLine(const Context& context);
  StatusLine(const StatusLine&) = delete;
  StatusLine& operator=(const StatusLine&) = delete;
  /// Clears the line.
  ~StatusLine();
  void show(const std::string& text);

 private:
  bool is_shown_;
};

/// A line on standard error, if that is a terminal, with what a command waits for and for how long.
/// Nothing else may print meanwhile.
class WaitLine {
 public:
  /// @param after  an answer that comes sooner shows no line
  WaitLine(const Context& context, std::string what, Duration after = std::chrono::seconds{2});
  WaitLine(const WaitLine&) = delete;
  WaitLine& operator=(const WaitLine&) = delete;
  /// Clears the line.
  ~WaitLine();

 private:
  void run();

  std::string what_;
  Duration after_;
  std::mutex mutex_{};
  std::condition_variable changed_{};
  bool is_over_ = false;  ///< Guarded by `mutex_`.
  rt::Thread thread_{};   ///< Not running without a terminal.
};

/// The result of `ask`, with a WaitLine meanwhile.
template <class Ask>
auto awaited(const Context& context, std::string what, Ask ask) {
  const WaitLine line(context, std::move(what));
  return ask();
}

}  // namespace rtpm::tool
