#include "os/system.hpp"

#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>

namespace rtpm::tool::os {
namespace {

volatile std::sig_atomic_t code_at_end = 0;

int descriptor_of(Stream stream) noexcept {
  switch (stream) {
    case Stream::kInput:
      return STDIN_FILENO;
    case Stream::kOutput:
      return STDOUT_FILENO;
    case Stream::kError:
      break;
  }
  return STDERR_FILENO;
}

}  // namespace

bool is_terminal(Stream stream) noexcept {
  return ::isatty(descriptor_of(stream)) == 1;
}

void write_error(std::string_view text) noexcept {
  static_cast<void>(!::write(STDERR_FILENO, text.data(), text.size()));
}

SetupError become_python(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "python3");
  std::vector<char*> texts;
  for (std::string& argument : arguments)
    texts.push_back(argument.data());
  texts.push_back(nullptr);
  ::execvp("python3", texts.data());
  return {.what = "Parquet files are written by python3, which can't be run",
          .why = system_error(errno).message(),
          .remedy = "install Python, then: pip install 'rtpm[parquet]'"};
}

void end_after(Duration time, int exit_code) noexcept {
  code_at_end = exit_code;
  std::signal(SIGALRM, [](int) { ::_exit(code_at_end); });
  const auto us = std::max<std::int64_t>(1, time.count() / 1000);
  const itimerval timer{.it_interval = {}, .it_value = {us / 1'000'000, us % 1'000'000}};
  static_cast<void>(::setitimer(ITIMER_REAL, &timer, nullptr));
}

}  // namespace rtpm::tool::os
