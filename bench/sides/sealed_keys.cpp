#include "sides/sealed_keys.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <utility>

#include "rtpm/access/files.hpp"
#include "rtpm/access/fingerprint.hpp"

namespace rtpm::bench {
namespace {

Outcome<std::string> make_public_text(const std::string& path) {
  const auto key = access::make_key(path, "rtpm-bench");
  if (!key) return failure(key.error());
  return access::public_key_text(key->public_key);
}

/// Writes a file that only its owner may write.
bool write_line(const std::string& path, const std::string& line) {
  std::ofstream file(path);
  file << line << '\n';
  file.close();
  return file.good() && ::chmod(path.c_str(), 0600) == 0;
}

}  // namespace

SealedKeys::~SealedKeys() {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

Outcome<std::shared_ptr<const SealedKeys>> SealedKeys::make(const std::string& host) {
  std::string folder = (std::filesystem::temp_directory_path() / "rtpm-bench-XXXXXX").string();
  if (::mkdtemp(folder.data()) == nullptr) {
    return failure(folder + " can't be made: " + std::strerror(errno));
  }
  std::shared_ptr<const SealedKeys> keys(new SealedKeys(std::move(folder)));
  const auto server = make_public_text(keys->file("server"));
  if (!server) return failure(server.error());
  const auto client = make_public_text(keys->file("client"));
  if (!client) return failure(client.error());
  if (!write_line(keys->file("authorized"), *client + " name=bench role=administer on=**") ||
      !write_line(keys->file("known_servers"), host + " " + *server)) {
    return failure(keys->folder_ + " can't be written");
  }
  return keys;
}

}  // namespace rtpm::bench
