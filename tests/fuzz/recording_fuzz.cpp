// Recordings of unknown origin: opened, read, checked and recovered. A recovered one is whole.

#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <string>

#include "rtpm/base/assert.hpp"
#include "rtpm/recording/file_reader.hpp"
#include "rtpm/recording/repair.hpp"

using namespace rtpm;

namespace {

/// A file in memory, with these bytes.
class MemoryFile {
 public:
  MemoryFile() : descriptor_(::memfd_create("recording", MFD_CLOEXEC)) {
    RTPM_ASSERT(descriptor_ >= 0, "the system has memory");
  }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  ~MemoryFile() { ::close(descriptor_); }
  void put(const std::uint8_t* data, std::size_t size) const {
    const bool is_put = ::ftruncate(descriptor_, 0) == 0 &&
                        ::pwrite(descriptor_, data, size, 0) == static_cast<ssize_t>(size);
    RTPM_ASSERT(is_put, "the system has memory");
  }
  [[nodiscard]] std::string path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

 private:
  int descriptor_;
};

void read_all(const std::string& path, recording::Incomplete incomplete) {
  const auto reader = recording::FileReader::open(path, incomplete);
  if (!reader) {
    RTPM_ASSERT(!reader.error().what.empty(), "a refusal has a reason");
    return;
  }
  std::uint64_t last_ns = 0;
  static_cast<void>((*reader)->read({}, [&](const recording::Message& message) {
    RTPM_ASSERT(message.log_time_ns >= last_ns, "messages come in the order of time");
    last_ns = message.log_time_ns;
    return true;
  }));
  static_cast<void>((*reader)->read_metadata());
  static_cast<void>((*reader)->read_attachments());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const MemoryFile file;
  // The file is in memory where possible: closing a recording waits for the disk.
  static const std::filesystem::path kMemory = "/dev/shm";
  static const std::filesystem::path kFolder =
      std::filesystem::is_directory(kMemory) ? kMemory : std::filesystem::temp_directory_path();
  static const std::string saved =
      (kFolder / ("fuzz_recording_" + std::to_string(::getpid()) + ".mcap")).string();
  file.put(data, size);
  read_all(file.path(), recording::Incomplete::kRefuse);
  read_all(file.path(), recording::Incomplete::kRead);
  static_cast<void>(recording::read_outline(file.path()));
  static_cast<void>(recording::check(file.path()));
  // Recovers only every second input, because this takes longer than the other checks.
  if (size % 2 == 1) return 0;
  std::filesystem::remove(saved);
  if (const auto recovery = recording::recover(file.path(), saved)) {
    const auto problems = recording::check(saved);
    RTPM_ASSERT(problems && problems->empty(), "what is recovered is whole");
  }
  std::filesystem::remove(saved);
  return 0;
}
