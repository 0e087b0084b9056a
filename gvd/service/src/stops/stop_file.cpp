#include "stops/stop_file.hpp"

#include <array>
#include <charconv>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <optional>
#include <system_error>

#include "rtpm/configuration/device_file.hpp"
#include "rtpm/rt/durable_file.hpp"

namespace rtpm::gvd {
namespace {

constexpr std::string_view kFirstLine = "rtpm-stop 1";
constexpr std::string_view kStopped = "stopped";
constexpr std::string_view kRearmed = "rearmed";
constexpr std::string_view kObeyed = "obeyed ";
/// Larger than any file that save() writes.
constexpr std::size_t kFileSizeMax = std::size_t{64} * 1024;

/// Removes and returns the next line of `text`; nullopt if there is no complete line.
std::optional<std::string_view> take_line(std::string_view& text) {
  const std::size_t end = text.find('\n');
  if (end == std::string_view::npos) return std::nullopt;
  const std::string_view line = text.substr(0, end);
  text.remove_prefix(end + 1);
  return line;
}

std::optional<std::uint64_t> request_in(std::string_view line) {
  if (!line.starts_with(kObeyed)) return std::nullopt;
  line.remove_prefix(kObeyed.size());
  std::uint64_t id = 0;
  const auto read = std::from_chars(line.data(), line.data() + line.size(), id, 16);
  if (read.ec != std::errc{} || read.ptr != line.data() + line.size()) return std::nullopt;
  return id;
}

/// Parses a stop file; nullopt if it has another format or is truncated.
std::optional<StopState> parse(std::string_view text) {
  StopState state;
  if (take_line(text) != kFirstLine) return std::nullopt;
  const auto standing = take_line(text);
  if (standing != kStopped && standing != kRearmed) return std::nullopt;
  state.is_stopped = standing == kStopped;
  while (!text.empty()) {
    const auto line = take_line(text);
    const auto id = line ? request_in(*line) : std::nullopt;
    if (!id || state.obeyed.size() == StopState::kObeyedCountMax) return std::nullopt;
    state.obeyed.push_back(*id);
  }
  return state;
}

std::string text_of(const StopState& state) {
  std::string text(kFirstLine);
  text += "\n" + std::string(state.is_stopped ? kStopped : kRearmed) + "\n";
  for (const std::uint64_t id : state.obeyed) {
    std::array<char, 17> digits{};
    std::snprintf(digits.data(), digits.size(), "%016llx", static_cast<unsigned long long>(id));
    text += std::string(kObeyed) + digits.data() + "\n";
  }
  return text;
}

}  // namespace

StopFile::StopFile(const std::string& folder, std::string_view model, std::string_view serial)
    : folder_(folder), path_(device_file(folder, model, serial, ".stop")) {}

expected<StopState, SetupError> StopFile::load() const {
  const auto refused = [this](const std::string& why) {
    return setup_error("'" + path_ + "' does not say whether the device is stopped, so it is", why,
                       "rearm the device, which writes the file again");
  };
  std::error_code error;
  const auto status = std::filesystem::status(path_, error);
  if (status.type() == std::filesystem::file_type::not_found) return StopState{};
  if (status.type() != std::filesystem::file_type::regular) {
    return refused(error ? error.message() : "it is no file");
  }
  std::ifstream file(path_, std::ios::binary);
  std::string text(kFileSizeMax, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (!file.is_open() || file.bad()) return refused("it can't be read");
  text.resize(static_cast<std::size_t>(file.gcount()));
  auto state = parse(text);
  if (!state) return refused("it is damaged, or of a later version");
  return std::move(*state);
}

expected<void, SetupError> StopFile::save(const StopState& state) const {
  std::error_code error;
  std::filesystem::create_directories(folder_, error);
  if (const auto replaced = rt::replace_file(path_, text_of(state)); !replaced) {
    return setup_error("'" + path_ + "' can't be written", replaced.error(),
                       "let the device's server write to that folder, or name another");
  }
  return {};
}

}  // namespace rtpm::gvd
