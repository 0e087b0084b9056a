#pragma once

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "rtpm/access/files.hpp"
#include "rtpm/rpc/caller.hpp"
#include "rtpm/rt/pi_mutex.hpp"
#include "rtpm/test/echo_server.hpp"
#include "rtpm/test/key_folder.hpp"

// A server that checks its callers' grants, and an interface with a method for each role.
namespace rtpm::rpc::test {

[[nodiscard]] inline std::string own_user() {
  return "uid:" + std::to_string(access::this_user());
}

namespace vault {

inline constexpr MethodDescriptor kRead{1, "read", 201, true, {}, Role::kObserve};
inline constexpr MethodDescriptor kMove{2, "move", 202, false, {}, Role::kCommand};
inline constexpr MethodDescriptor kTune{3, "tune", 203, false, {}, Role::kConfigure};
inline constexpr MethodDescriptor kReset{4, "reset", 204, false, {}, Role::kAdminister};
inline constexpr MethodDescriptor kPlain{5, "plain", 205, false, {}};
inline constexpr MethodDescriptor kWatch{6, "watch", 206, false, {}, Role::kObserve};
inline constexpr std::array kMethods{kRead, kMove, kTune, kReset, kPlain, kWatch};
inline constexpr InterfaceDescriptor kInterface{
    .name = "test.Vault",
    .fingerprint = 99,
    .compiler_version = "by hand",
    .methods = kMethods,
    .text = "vault",
};

/// Counts its calls, and records the last caller's identity.
class Vault final : public Servant {
 public:
  const InterfaceDescriptor& interface() const noexcept override { return kInterface; }
  DispatchResult dispatch(std::uint16_t method, ConstBytes, MutableBytes,
                          const CallContext& context) override {
    if (method == 0 || method > kMethods.size()) return {wire::Status::kNoSuchMethod, 0};
    if (context.identity != nullptr) {
      const std::lock_guard lock(mutex_);
      last_subject_ = context.identity->subject();
      const std::string_view name = context.identity->name();
      last_name_size_ = name.copy(last_name_.data(), last_name_.size());
      last_role_elsewhere_ = context.identity->role_on("lab/elsewhere");
    } else {
      ++nobody_count;
    }
    ++run_counts[method - 1U];
    if (method == kWatch.id) {
      if (ItemWriter writer = context.deferral->stream()) writer.finish();
    }
    return {};
  }
  // The identity of the last caller.
  [[nodiscard]] access::Subject subject() const {
    const std::lock_guard lock(mutex_);
    return last_subject_;
  }
  [[nodiscard]] std::string name() const {
    const std::lock_guard lock(mutex_);
    return {last_name_.data(), last_name_size_};
  }
  [[nodiscard]] Role role_elsewhere() const {
    const std::lock_guard lock(mutex_);
    return last_role_elsewhere_;
  }

  std::array<std::atomic<int>, kMethods.size()> run_counts{};
  std::atomic<int> nobody_count{0};

 private:
  mutable rt::PiMutex mutex_;
  access::Subject last_subject_{};
  std::array<char, 128> last_name_{};
  std::size_t last_name_size_ = 0;
  Role last_role_elsewhere_ = Role::kNone;
};

}  // namespace vault

/// A started server that reads its grants from `folder`'s file `authorized`, with a vault at each
/// path.
struct SecuredServer {
  SecuredServer(const KeyFolder& folder, const std::string& grants,
                const std::vector<std::string>& paths, ServerConfig config = quiet_config()) {
    config.host = "127.0.0.1";
    config.stream_count_max = 64;
    config.security.authorized_file = folder.write("authorized", grants);
    if (config.security.key_file.empty()) config.security.key_file = folder.file("server-key");
    auto created = Server::create(std::move(config));
    EXPECT_TRUE(created) << created.error().text();
    if (!created) return;
    server = std::move(*created);
    for (const std::string& path : paths) {
      vaults.push_back(std::make_unique<vault::Vault>());
      const auto added = server->add(path, *vaults.back());
      EXPECT_TRUE(added) << added.error().text();
    }
    const auto started = server->start();
    EXPECT_TRUE(started) << started.error().text();
  }
  ~SecuredServer() {
    if (server) server->stop();
  }
  SecuredServer(const SecuredServer&) = delete;
  SecuredServer& operator=(const SecuredServer&) = delete;

  std::vector<std::unique_ptr<vault::Vault>> vaults;
  std::unique_ptr<Server> server;
};

}  // namespace rtpm::rpc::test
