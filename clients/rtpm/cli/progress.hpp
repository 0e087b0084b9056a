#pragma once

#include <cstdint>
#include <string>

#include "cli/context.hpp"

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

}  // namespace rtpm::tool
