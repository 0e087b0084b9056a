#include "laboratory/running_program.hpp"

#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <utility>

#include "rtpm/wire/url.hpp"

namespace rtpm::laboratory {
namespace {

constexpr std::size_t kLineSizeMax = 4096;  // Longer lines are split.
constexpr std::size_t kReadSizeMax = std::size_t{64} * 1024;

Launch launch_of(const ProgramPlan& plan, const std::vector<std::string>& urls,
                 const std::string& registry_url) {
  Launch launch{.path = plan.path, .folder = plan.folder};
  for (const Text& word : plan.command)
    launch.arguments.push_back(word.resolved(urls));
  std::vector<std::pair<std::string, std::string>> variables;
  bool has_registry = false;
  for (const auto& [name, value] : plan.environment) {
    variables.emplace_back(name, value.resolved(urls));
    has_registry = has_registry || name == kRegistryVariable;
  }
  if (!has_registry && !registry_url.empty()) {
    variables.emplace_back(wire::is_url(registry_url) ? kRegistryVariable : kDiscoverVariable,
                           registry_url);
  }
  launch.environment = environment_with(variables);
  return launch;
}

}  // namespace

expected<RunningProgram, SetupError> RunningProgram::start(const ProgramPlan& plan,
                                                           const std::vector<std::string>& urls,
                                                           const std::string& registry_url,
                                                           bool has_terminal) {
  RunningProgram program;
  Launch description = launch_of(plan, urls, registry_url);
  std::array<Handle, 3> theirs{Handle(), Handle(), Handle()};
  if (plan.output == Output::kTerminal && has_terminal) {
    // The program joins this process's group, because only that group may read from the terminal.
    program.has_own_group_ = false;
    description.has_own_group = false;
  } else {
    theirs[0] = Handle(::open("/dev/null", O_RDONLY | O_CLOEXEC));
    for (std::size_t i = 0; i < 2; ++i) {
      auto pipe = make_pipe();
      if (!pipe) return unexpected{pipe.error()};
      // Only this end does not block: programs expect their end to block.
      ::fcntl((*pipe)[0].number(), F_SETFL, O_NONBLOCK);
      program.streams_[i].handle = std::move((*pipe)[0]);
      theirs[i + 1] = std::move((*pipe)[1]);
    }
    description.input = theirs[0].number();
    description.output = theirs[1].number();
    description.errors = theirs[2].number();
  }
  const auto process = launch(description);
  if (!process) return unexpected{process.error()};
  program.process_ = *process;
  return program;
}

std::array<int, 2> RunningProgram::streams() const noexcept {
  return {streams_[0].handle.number(), streams_[1].handle.number()};
}

void RunningProgram::read(const TakeLine& take) {
  for (std::size_t i = 0; i < streams_.size(); ++i)
    read_stream(streams_[i], i == 1, take);
}

void RunningProgram::read_rest(const TakeLine& take) {
  read(take);
  for (std::size_t i = 0; i < streams_.size(); ++i) {
    const std::string text = std::exchange(streams_[i].text, {});
    if (!text.empty()) take(i == 1, text);
    streams_[i].handle.reset();
  }
}

void RunningProgram::read_stream(Stream& stream, bool is_error, const TakeLine& take) {
  std::array<char, 4096> part{};
  for (std::size_t taken = 0; stream.handle.is_open() && taken < kReadSizeMax;) {
    const ssize_t size = ::read(stream.handle.number(), part.data(), part.size());
    if (size < 0 && errno == EINTR) continue;
    if (size < 0 && errno == EAGAIN) return;
    if (size <= 0) {
      if (!stream.text.empty()) take(is_error, std::exchange(stream.text, {}));
      stream.handle.reset();
      return;
    }
    taken += static_cast<std::size_t>(size);
    stream.text.append(part.data(), static_cast<std::size_t>(size));
    std::size_t begin = 0;
    for (std::size_t end = 0; (end = stream.text.find('\n', begin)) != std::string::npos;
         begin = end + 1)
      take(is_error, std::string_view(stream.text).substr(begin, end - begin));
    stream.text.erase(0, begin);
    if (stream.text.size() > kLineSizeMax) take(is_error, std::exchange(stream.text, {}));
  }
}

void RunningProgram::send_signal(int signal) const {
  ::kill(has_own_group_ ? -process_ : process_, signal);
}

}  // namespace rtpm::laboratory
