#include "isolated_driver.hpp"

#include <map>
#include <span>
#include <string_view>
#include <utility>

#include "drivers.hpp"
#include "rtpm/driver/arguments.hpp"
#include "rtpm/driver_host/isolated.hpp"
#include "rtpm/rt/crash.hpp"
#include "rtpm/rt/memory.hpp"

namespace rtpm::deviced {
namespace {

constexpr std::string_view kMark = "--isolated-driver";

std::string joined(const std::vector<int>& numbers) {
  std::string text;
  for (const int number : numbers)
    text += (text.empty() ? "" : ",") + std::to_string(number);
  return text;
}

std::vector<int> numbers_of(std::string_view text) {
  std::vector<int> numbers;
  while (!text.empty()) {
    const std::string_view word = text.substr(0, text.find(','));
    if (const auto number = driver::to_number<int>(word)) numbers.push_back(*number);
    text.remove_prefix(std::min(word.size() + 1, text.size()));
  }
  return numbers;
}

rt::RealtimeMode mode_of(std::string_view text) {
  for (const rt::RealtimeMode mode : {rt::RealtimeMode::kRequire, rt::RealtimeMode::kOff}) {
    if (to_string(mode) == text) return mode;
  }
  return rt::RealtimeMode::kPrefer;
}

}  // namespace

std::vector<std::string> isolated_command(const DeviceSettings& device, const std::string& name,
                                          const rt::ThreadConfig& thread) {
  const std::pair<const char*, std::string> words[]{
      {"device", device.name},
      {"driver", device.driver},
      {"arguments", device.arguments},
      {"serial", device.serial},
      {"hand", device.hand},
      {"free", device.is_free ? "1" : "0"},
      {"seed", std::to_string(device.seed)},
      {"name", name},
      {"thread", thread.name},
      {"priority", std::to_string(thread.priority.value_or(Priority::kLowest).value())},
      {"cpus", joined(thread.cpus)},
      {"realtime", std::string(to_string(thread.realtime))}};
  std::vector<std::string> command{"/proc/self/exe", std::string(kMark)};
  for (const auto& [word, value] : words)
    command.push_back(std::string(word) + "=" + value);
  return command;
}

std::optional<IsolatedDriver> read_isolated_command(int argc, const char* const* argv) {
  if (argc < 2 || argv[1] != kMark) return std::nullopt;
  std::map<std::string_view, std::string> words;
  for (const std::string_view word : std::span(argv, static_cast<std::size_t>(argc)).subspan(2)) {
    const std::size_t size = std::min(word.find('='), word.size() - 1);
    words[word.substr(0, size)] = word.substr(size + 1);
  }
  IsolatedDriver read;
  read.device.name = words["device"];
  read.device.driver = words["driver"];
  read.device.arguments = words["arguments"];
  read.device.serial = words["serial"];
  read.device.hand = words["hand"];
  read.device.is_free = words["free"] == "1";
  read.device.seed = driver::to_number<std::uint64_t>(words["seed"]).value_or(1);
  read.name = words["name"];
  read.thread.name = words["thread"];
  read.thread.priority = Priority{driver::to_number<std::uint16_t>(words["priority"]).value_or(0)};
  read.thread.cpus = numbers_of(words["cpus"]);
  read.thread.realtime = mode_of(words["realtime"]);
  return read;
}

std::optional<int> serve_isolated(int argc, const char* const* argv) {
  const auto isolated = read_isolated_command(argc, argv);
  if (!isolated) return std::nullopt;
  static std::string program = "rtpm-deviced, the driver's process of " + isolated->name;
  rt::report_crashes(program.c_str(), "");
  if (auto locked = rt::lock_memory(isolated->thread.realtime); !locked) {
    return driver_host::serve_driver(unexpected{std::move(locked.error())}, isolated->thread);
  }
  return driver_host::serve_driver(make_driver(isolated->device, isolated->name), isolated->thread);
}

}  // namespace rtpm::deviced
