#include "output_file.hpp"

#include <utility>

namespace rtpm::recording {

expected<OutputFile, SetupError> OutputFile::create(const std::string& path) {
  auto file = os::create(path);
  if (!file) {
    return setup_error("the recording " + path + " can't be created", file.error(),
                       file.error() == std::errc::file_exists
                           ? "name another file, or remove that one"
                           : "name a file in a folder that you may write to");
  }
  return OutputFile(path, std::move(*file));
}

OutputFile::OutputFile(std::string path, os::File file) noexcept
    : path_(std::move(path)), file_(std::move(file)) {}

unexpected<SetupError> OutputFile::fail(const std::error_code& error) {
  failure_ = SetupError{
      "the recording " + path_ + " can't go on", error.message(),
      os::is_full(error) ? "make room, or record to another disk" : "see whether its disk is well",
      error};
  return unexpected{*failure_};
}

expected<void, SetupError> OutputFile::append(ConstBytes bytes) {
  if (failure_) return unexpected{*failure_};
  if (const std::error_code error = os::append(file_, bytes)) {
    os::cut(file_, size_);
    return fail(error);
  }
  size_ += bytes.size();
  return {};
}

expected<void, SetupError> OutputFile::close() {
  if (failure_) return unexpected{*failure_};
  const std::error_code error = os::flush(file_);
  file_.reset();
  if (error) return fail(error);
  return {};
}

}  // namespace rtpm::recording
