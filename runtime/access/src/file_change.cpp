#include "rtpm/access/file_change.hpp"

#include <algorithm>
#include <optional>
#include <system_error>
#include <utility>

#include "folder.hpp"
#include "os/file.hpp"
#include "rtpm/access/files.hpp"
#include "rtpm/base/printable.hpp"

namespace rtpm::access {
namespace {

constexpr int kTryCountMax = 500;  // One every 10 ms.

unexpected<SetupError> failed(const std::string& path, std::error_code error) {
  return setup_error(printable(path, kShownWhole) + " can't be changed", error);
}

/// Resolves links to the file itself; if the file does not exist yet, creates its folder.
expected<std::string, SetupError> real_path_of(const std::string& path) {
  if (const auto made = make_folder_of(path); !made) return unexpected{made.error()};
  auto real = os::real_path_of(path);
  if (!real) return failed(path, real.error());
  return std::move(*real);
}

/// @return whether the file has the new text
expected<bool, SetupError> change_locked(const os::File& lock, const std::string& path,
                                         const FileChange& change) {
  const auto old = read_trusted_file(path);
  if (!old) return unexpected{old.error()};
  auto text = change(*old);
  if (!text) return unexpected{text.error()};
  if (text->size() > kFileSizeMax)
    return setup_error(printable(path, kShownWhole) + " would have more than " +
                       std::to_string(kFileSizeMax) + " bytes");
  if (*text == *old) return true;
  const auto replaced = os::replace(lock, path, *text);
  if (!replaced) return failed(path, replaced.error());
  return *replaced;
}

/// Changes the file, unless another program holds its lock or has replaced it meanwhile.
/// @return whether it did
expected<bool, SetupError> try_change(const std::string& path, const FileChange& change) {
  const bool is_new = !stamp_of(path).is_of_file();
  const auto lock = os::lock(path);
  if (!lock) return failed(path, lock.error());
  if (!*lock) return false;
  auto changed = change_locked(**lock, path, change);
  // An empty file of grants would make servers require grants that nobody has.
  if (!changed && is_new) os::remove(path);
  return changed;
}

}  // namespace

expected<void, SetupError> change_trusted_file(const std::string& path, const FileChange& change) {
  const auto real = real_path_of(path);
  if (!real) return unexpected{real.error()};
  for (int i = 0; i < kTryCountMax; ++i) {
    const auto changed = try_change(*real, change);
    if (!changed) return unexpected{changed.error()};
    if (*changed) return {};
    os::pause();
  }
  return setup_error(printable(path, kShownWhole) + " can't be changed",
                     "another program has it locked", "try again");
}

std::string with_line(std::string text, std::string_view line) {
  if (!text.empty() && text.back() != '\n') text += '\n';
  return text.append(line) + '\n';
}

std::string without_lines(std::string_view text, const std::vector<std::size_t>& numbers) {
  std::string rest;
  for (std::size_t number = 1; !text.empty(); ++number) {
    const std::size_t size = std::min(text.find('\n'), text.size() - 1) + 1;
    if (std::ranges::find(numbers, number) == numbers.end()) rest.append(text.substr(0, size));
    text.remove_prefix(size);
  }
  return rest;
}

}  // namespace rtpm::access
