#include "vectors.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <stdexcept>

namespace rtpm::spec {
namespace {

namespace fs = std::filesystem;

/// The first of `count` values with this name; fails the test if there is none.
template <class T>
T named(const std::string& name, std::size_t first, std::size_t count) {
  for (std::size_t i = first; i < first + count; ++i) {
    const T value = static_cast<T>(i);
    if (to_string(value) == name) return value;
  }
  ADD_FAILURE() << "the code knows no '" << name << "'";
  return T{};
}

}  // namespace

Json read_vectors(const std::string& name) {
  std::ifstream file(fs::path(RTPM_SPEC_DIR) / "vectors" / name);
  return Json::parse(file);
}

std::vector<std::string> conversation_names() {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(RTPM_SPEC_DIR "/vectors/conversations")) {
    if (entry.path().extension() == ".json") names.push_back(entry.path().stem().string());
  }
  std::ranges::sort(names);
  return names;
}

Bytes bytes_of_hex(const std::string& hex) {
  EXPECT_EQ(hex.size() % 2, 0u) << hex;
  Bytes bytes(hex.size() / 2);
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    bytes[i] = static_cast<std::byte>(std::stoul(hex.substr(2 * i, 2), nullptr, 16));
  }
  return bytes;
}

std::string hex_of(ConstBytes bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string hex;
  for (const std::byte byte : bytes) {
    hex += kDigits[std::to_integer<unsigned>(byte) >> 4];
    hex += kDigits[std::to_integer<unsigned>(byte) & 15];
  }
  return hex;
}

std::uint64_t wide_number(const Json& text) {
  return std::stoull(text.get<std::string>(), nullptr, 16);
}

wire::FrameKind kind_named(const std::string& name) {
  return named<wire::FrameKind>(name, 1, wire::kFrameKindLast);
}

wire::Status status_named(const std::string& name) {
  return named<wire::Status>(name, 0, wire::kStatusCount);
}

wire::DropReason reason_named(const std::string& name) {
  return named<wire::DropReason>(name, 0, wire::kDropReasonCount);
}

wire::Medium medium_named(const std::string& name) {
  EXPECT_TRUE(name == "datagram" || name == "stream") << name;
  return name == "stream" ? wire::Medium::kStream : wire::Medium::kDatagram;
}

std::string newly_dropped(const wire::FrameCounters& before, const wire::FrameCounters& after) {
  std::string names;
  for (std::size_t i = 0; i < wire::kDropReasonCount; ++i) {
    for (std::uint64_t count = before.dropped[i]; count < after.dropped[i]; ++count) {
      if (!names.empty()) names += ' ';
      names += to_string(static_cast<wire::DropReason>(i));
    }
  }
  return names;
}

}  // namespace rtpm::spec
