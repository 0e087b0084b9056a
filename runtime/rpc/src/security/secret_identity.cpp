#include "security/secret_identity.hpp"

#include <cerrno>
#include <new>
#include <utility>

#include "rtpm/access/files.hpp"

namespace rtpm::rpc {
namespace {

expected<seal::KeyPair, SetupError> read_or_make_key(const std::string& file) {
  auto path = access::key_file_path(file, access::kKeyFile);
  if (!path) return unexpected{path.error()};
  const auto is_there = [&] { return access::stamp_of(*path).is_of_file(); };
  if (is_there()) return access::read_key(*path);
  auto made = access::make_key(*path, access::user_at_host());
  // Another program may have made it meanwhile.
  if (!made && is_there()) return access::read_key(*path);
  return made;
}

}  // namespace

expected<std::unique_ptr<SecretIdentity>, SetupError> SecretIdentity::open(
    const std::string& file) {
  auto key = read_or_make_key(file);
  if (!key) return unexpected{key.error()};
  rt::SecretMemory memory(sizeof(sealed::ServerIdentity));
  if (memory.bytes().empty()) {
    return setup_error("the system gives no memory for the server's key", system_error(ENOMEM),
                       "raise the limit of the process (ulimit -v)");
  }
  return std::unique_ptr<SecretIdentity>(new SecretIdentity(std::move(memory), std::move(*key)));
}

SecretIdentity::SecretIdentity(rt::SecretMemory memory, seal::KeyPair key) noexcept
    : memory_(std::move(memory)),
      identity_(new (memory_.bytes().data())
                    sealed::ServerIdentity{.key = std::move(key), .preshared = {}}) {}

SecretIdentity::~SecretIdentity() {
  identity_->~ServerIdentity();
}

}  // namespace rtpm::rpc
