#include "rtpm/configuration/device_file.hpp"

#include "rtpm/base/utf8_path.hpp"

namespace rtpm::gvd {
namespace {

/// Model or serial number as a part of a file's name: distinct texts give distinct parts.
std::string file_part(std::string_view text) {
  std::string part;
  for (const char c : text) {
    const bool is_plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                          (c >= '0' && c <= '9') || c == '-' || c == '.' || c == '_';
    if (is_plain) {
      part += c;
      continue;
    }
    constexpr std::string_view kDigits = "0123456789abcdef";
    const auto byte = static_cast<unsigned char>(c);
    part += {'%', kDigits[byte >> 4], kDigits[byte & 15]};
  }
  return part;
}

}  // namespace

std::string device_file(const std::string& folder, std::string_view model, std::string_view serial,
                        std::string_view ending) {
  const std::string name = file_part(model) + "@" + file_part(serial) + std::string(ending);
  return utf8_of(path_of_utf8(folder) / name);
}

}  // namespace rtpm::gvd
