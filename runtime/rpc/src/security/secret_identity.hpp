#pragma once

#include <memory>
#include <string>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/rt/secret_memory.hpp"
#include "rtpm/sealed/handshake_job.hpp"

namespace rtpm::rpc {

/// A server's long-lived key, in memory for secrets.
/// @threads  any, once open
class SecretIdentity {
 public:
  /// Reads the key, or makes it at the first start.
  /// @param file   empty: the one in access::key_folder()
  /// @realtime set-up only
  /// @errors   as access::read_key() and make_key(); no memory
  [[nodiscard]] static expected<std::unique_ptr<SecretIdentity>, SetupError> open(
      const std::string& file);
  SecretIdentity(const SecretIdentity&) = delete;
  SecretIdentity& operator=(const SecretIdentity&) = delete;
  ~SecretIdentity();

  [[nodiscard]] const sealed::ServerIdentity& get() const noexcept { return *identity_; }

 private:
  SecretIdentity(rt::SecretMemory memory, seal::KeyPair key) noexcept;

  rt::SecretMemory memory_;
  sealed::ServerIdentity* identity_;  ///< In memory_.
};

}  // namespace rtpm::rpc
