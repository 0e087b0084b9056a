#include "rtpm/rt/public_memory.hpp"

#include <dirent.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <memory>
#include <set>
#include <utility>

#include "rtpm/rt/memory.hpp"

#ifndef F_SEAL_FUTURE_WRITE
#define F_SEAL_FUTURE_WRITE 0x0010
#endif

// Found through /proc/<process>/fd, where an anonymous file shows its name.
namespace rtpm::rt {
namespace {

constexpr std::string_view kPrefix = "rtpm-";

void close_file(int& file) noexcept {
  if (file >= 0) close(file);
  file = -1;
}

// The numeric entries of a folder in /proc, ascending.
std::vector<int> numbers_in(const std::string& folder) {
  std::vector<int> numbers;
  const std::unique_ptr<DIR, int (*)(DIR*)> listing(opendir(folder.c_str()), &closedir);
  if (listing == nullptr) return numbers;
  // Not thread-safe, but only this thread uses the listing.
  while (const dirent* entry = readdir(listing.get())) {  // NOLINT(concurrency-mt-unsafe)
    const std::string_view name = entry->d_name;
    int number = 0;
    const auto read = std::from_chars(name.data(), name.data() + name.size(), number);
    if (read.ec == std::errc{} && read.ptr == name.data() + name.size()) numbers.push_back(number);
  }
  std::ranges::sort(numbers);
  return numbers;
}

// Whether `path`, a descriptor in /proc, is an anonymous file of that name.
bool is_named(const std::string& path, const std::string& wanted) {
  std::array<char, 128> target{};
  const ssize_t size = readlink(path.c_str(), target.data(), target.size());
  return size > 0 && std::string_view(target.data(), static_cast<std::size_t>(size)) == wanted;
}

struct Mapped {
  ConstBytes bytes{};
  std::pair<dev_t, ino_t> identity{};
};

// Maps the file for reading if it can't shrink; otherwise returns an empty mapping.
Mapped map_for_reading(const std::string& path, std::size_t size_max) {
  int file = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (file < 0) return {};
  Mapped mapped;
  struct stat status {};
  const int seals = fcntl(file, F_GET_SEALS);
  if (seals >= 0 && (seals & F_SEAL_SHRINK) != 0 && fstat(file, &status) == 0 &&
      status.st_size > 0 && static_cast<std::size_t>(status.st_size) <= size_max) {
    const auto size = static_cast<std::size_t>(status.st_size);
    void* const begin = mmap(nullptr, size, PROT_READ, MAP_SHARED, file, 0);
    if (begin != MAP_FAILED) {
      mapped.bytes = {static_cast<const std::byte*>(begin), size};
      mapped.identity = {status.st_dev, status.st_ino};
    }
  }
  close_file(file);
  return mapped;
}

void unmap(ConstBytes bytes) noexcept {
  if (!bytes.empty()) munmap(const_cast<std::byte*>(bytes.data()), bytes.size());
}

}  // namespace

expected<PublicMemory, SetupError> PublicMemory::create(std::string_view name, std::size_t size) {
  PublicMemory memory;
  const std::string full_name = std::string(kPrefix).append(name);
  memory.file_ = memfd_create(full_name.c_str(), MFD_CLOEXEC | MFD_ALLOW_SEALING);
  void* begin = MAP_FAILED;
  if (memory.file_ >= 0 && ftruncate(memory.file_, static_cast<off_t>(size)) == 0) {
    begin = mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, memory.file_, 0);
  }
  if (begin == MAP_FAILED) {
    return setup_error("memory '" + full_name + "' can't be made", system_error(errno),
                       "raise the limit of open files (ulimit -n) or of memory");
  }
  memory.bytes_ = {static_cast<std::byte*>(begin), size};
  prefault(memory.bytes_);
  // Before Linux 5.1 other processes of the user could write there, but readers' safety does not
  // depend on it.
  constexpr int kSeals = F_SEAL_SHRINK | F_SEAL_GROW;
  if (fcntl(memory.file_, F_ADD_SEALS, kSeals | F_SEAL_FUTURE_WRITE | F_SEAL_SEAL) != 0) {
    static_cast<void>(fcntl(memory.file_, F_ADD_SEALS, kSeals | F_SEAL_SEAL));
  }
  return memory;
}

bool PublicView::is_alive() const noexcept {
  return faccessat(process_folder_, "stat", F_OK, 0) == 0;
}

std::vector<PublicView> find_public_memory(std::string_view name, std::size_t size_max) {
  std::vector<PublicView> found;
  std::set<std::pair<dev_t, ino_t>> known;
  const std::string wanted = "/memfd:" + std::string(kPrefix).append(name) + " (deleted)";
  for (const int process : numbers_in("/proc")) {
    const std::string folder = "/proc/" + std::to_string(process);
    for (const int number : numbers_in(folder + "/fd")) {
      const std::string path = folder + "/fd/" + std::to_string(number);
      if (!is_named(path, wanted)) continue;
      const Mapped mapped = map_for_reading(path, size_max);
      if (mapped.bytes.empty()) continue;
      // A forked process has its parent's descriptors.
      if (!known.insert(mapped.identity).second) {
        unmap(mapped.bytes);
        continue;
      }
      found.push_back(
          {process, open(folder.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC), mapped.bytes});
    }
  }
  return found;
}

}  // namespace rtpm::rt
