#include "rtpm/schema/output.hpp"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <random>
#include <system_error>

namespace rtpm::schema {
namespace {

/// Owns temporary files, and removes those that were not renamed.
class TemporaryFiles {
 public:
  TemporaryFiles() = default;
  TemporaryFiles(const TemporaryFiles&) = delete;
  TemporaryFiles& operator=(const TemporaryFiles&) = delete;
  ~TemporaryFiles() {
    for (const std::string& path : paths_)
      std::remove(path.c_str());
  }

  /// Adds a random name next to `path`, because another rtpmc may be running.
  std::string add(const std::string& path) {
    return paths_.emplace_back(path + ".tmp" + std::to_string(std::random_device{}()));
  }

 private:
  std::vector<std::string> paths_{};
};

std::string because(const std::string& what, const std::string& path, const std::string& cause) {
  return "cannot " + what + " \"" + path + "\": " + cause +
         "; check the path, the permission to write there and the free space";
}

std::optional<std::string> make_folder_of(const std::string& path) {
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (folder.empty()) return std::nullopt;
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return because("make the folder", folder.string(), error.message());
  return std::nullopt;
}

std::optional<std::string> write(const std::string& path, const std::string& text) {
  std::FILE* file = std::fopen(path.c_str(), "wb");
  if (file == nullptr) return because("write", path, std::strerror(errno));
  const bool is_written = std::fwrite(text.data(), 1, text.size(), file) == text.size();
  const int write_error = errno;
  // fclose writes the buffer, so a full disk may only show here.
  const bool is_closed = std::fclose(file) == 0;
  if (!is_written) return because("write", path, std::strerror(write_error));
  if (!is_closed) return because("write", path, std::strerror(errno));
  return std::nullopt;
}

std::string escaped_for_make(const std::string& path) {
  std::string text;
  for (const char c : path) {
    if (c == ' ' || c == '#' || c == '\\') text += '\\';
    if (c == '$') text += '$';
    text += c;
  }
  return text;
}

}  // namespace

std::optional<std::string> write_all(const std::vector<OutputFile>& files) {
  TemporaryFiles temporaries;
  std::vector<std::string> written;
  for (const OutputFile& file : files) {
    if (auto error = make_folder_of(file.path)) return error;
    std::error_code ignored;
    if (std::filesystem::is_directory(file.path, ignored)) {
      return because("write", file.path, "it is a folder");
    }
    written.push_back(temporaries.add(file.path));
    if (auto error = write(written.back(), file.text)) return error;
  }
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (std::rename(written[i].c_str(), files[i].path.c_str()) != 0) {
      return because("write", files[i].path, std::strerror(errno));
    }
  }
  return std::nullopt;
}

std::string dependency_text(const std::vector<std::string>& targets,
                            const std::vector<std::string>& sources) {
  std::string text;
  for (const std::string& target : targets) {
    text.append(text.empty() ? "" : " ").append(escaped_for_make(target));
  }
  text += ':';
  for (const std::string& source : sources)
    text += " \\\n  " + escaped_for_make(source);
  return text + '\n';
}

}  // namespace rtpm::schema
