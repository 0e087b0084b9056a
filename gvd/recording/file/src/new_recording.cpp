#include <filesystem>
#include <utility>

#include "rtpm/recording/file_writer.hpp"

namespace rtpm::recording {

expected<NewRecording, SetupError> NewRecording::create(const std::string& path,
                                                        WriterConfig config, Existing existing) {
  std::error_code ignored;
  if (existing == Existing::kRefuse && std::filesystem::exists(path, ignored)) {
    return setup_error("'" + path + "' can't be written", "it exists already",
                       "choose another name, or remove it");
  }
  NewRecording made(path);
  std::filesystem::remove(made.draft(), ignored);  // The temporary file of a program that died.
  auto writer = FileWriter::create(made.draft(), std::move(config));
  if (!writer) return unexpected{writer.error()};
  made.writer_ = std::move(*writer);
  return made;
}

NewRecording::~NewRecording() {
  std::error_code ignored;
  if (writer_) std::filesystem::remove(draft(), ignored);
}

expected<std::uint64_t, SetupError> NewRecording::finish() {
  if (auto closed = writer_->close(); !closed) return unexpected{closed.error()};
  const std::uint64_t count = writer_->statistics().message_count;
  std::error_code cause;
  std::filesystem::rename(draft(), path_, cause);
  if (cause) return setup_error("'" + path_ + "' can't be written", cause);
  writer_.reset();
  return count;
}

}  // namespace rtpm::recording
