#include "security/node_keys.hpp"

#include <mutex>
#include <utility>

#include "rtpm/rt/memory.hpp"

namespace rtpm::rpc {

expected<void, SetupError> NodeKeys::read_known_servers() {
  const auto path = access::key_file_path(files_.known_servers_file, access::kKnownServersFile);
  // Without a folder of keys no server is known.
  if (!path) return {};
  const access::FileStamp stamp = access::stamp_of(*path);
  // The file may exist but be invisible to this user: reading it shows which.
  if (stamp == known_stamp_ && stamp.is_of_file()) return {};
  auto text = access::read_trusted_file(*path);
  if (!text) return unexpected{text.error()};
  known_ = access::parse_known_servers(*text);
  known_stamp_ = stamp;
  for (const access::LineFault& fault : known_.faults)
    errors_.write(access::to_text(fault, *path) + "; this line is not used");
  return {};
}

expected<void, SetupError> NodeKeys::read_own() {
  if (own_ && !own_->is_here()) return {};  // In a child process, own() reports the error.
  const auto path = access::key_file_path(files_.key_file, access::kKeyFile);
  if (!path) return unexpected{path.error()};
  const access::FileStamp stamp = access::stamp_of(*path);
  if (own_ && stamp == own_stamp_) return {};
  auto pair = access::read_key(*path);
  if (!pair) return unexpected{pair.error()};
  auto kept = OwnKey::make(std::move(*pair));
  if (!kept) return unexpected{kept.error()};
  own_ = std::make_shared<const OwnKey>(std::move(*kept));
  own_stamp_ = stamp;
  return {};
}

expected<void, SetupError> NodeKeys::open_log() {
  if (!has_log() || key_log_) return {};
  auto opened = access::LogFile::open(files_.key_log_file);
  if (!opened) return unexpected{opened.error()};
  key_log_.emplace(std::move(*opened));
  return {};
}

expected<std::vector<access::KnownServer>, SetupError> NodeKeys::keys_of(
    const std::string& host, const transport::SocketAddress& server) {
  const std::lock_guard lock(mutex_);
  if (auto read = read_known_servers(); !read) {
    if (server.is_loopback()) return std::vector<access::KnownServer>{};
    return unexpected{read.error()};
  }
  std::vector<access::KnownServer> found = known_.find(host, server.port());
  if (found.empty()) found = known_.find(server.host(), server.port());
  if (found.empty()) return found;
  if (auto read = read_own(); !read) return unexpected{read.error()};
  if (auto opened = open_log(); !opened) return unexpected{opened.error()};
  return found;
}

// A file that can't be trusted names no users; keys_of() reports it to callers that need it.
std::vector<std::uint32_t> NodeKeys::trusted_users() {
  const std::lock_guard lock(mutex_);
  if (!read_known_servers()) return {};
  return known_.local_users;
}

expected<std::shared_ptr<const OwnKey>, SetupError> NodeKeys::own() {
  const std::lock_guard lock(mutex_);
  if (own_ && own_->is_here()) return own_;
  return setup_error("this process has no key to call a known server with",
                     "a child of fork() does not get the keys of its parent's node",
                     "make a rpc::Node of its own in the child, or call exec()");
}

access::KnownServer NodeKeys::entry_of(const crypto::PublicKey& key) {
  const std::lock_guard lock(mutex_);
  for (const access::KnownServer& known : known_.servers) {
    if (known.key == key) return known;
  }
  access::KnownServer without_line;
  without_line.key = key;
  return without_line;
}

void NodeKeys::log(std::uint64_t session, const crypto::SessionKeys& keys) noexcept {
  const rt::AllowAllocationScope is_allowed;
  const std::lock_guard lock(mutex_);
  if (!key_log_) return;
  const auto written =
      key_log_->write_line(sealed::key_log_line(session, keys.suite, keys.send, keys.receive));
  if (!written) errors_.write(written.error().text());
}

}  // namespace rtpm::rpc
