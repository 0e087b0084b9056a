// RTPM's real server as a program under test of spec/conform that gets no instructions: method 2 of
// its object answers with the number of its runs.
//   counting_server [AUTHORIZED KEY]
// With these files it requires grants of its callers, and its sessions are sealed.

#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdlib>
#include <iostream>

#include "rtpm/base/bytes.hpp"
#include "rtpm/rpc/server.hpp"

namespace rtpm::spec {
namespace {

constexpr std::uint16_t kCountMethod = 2;
constexpr std::array<rpc::MethodDescriptor, 1> kMethods{
    {{.id = kCountMethod, .name = "count", .fingerprint = 0x22222222}}};
constexpr rpc::InterfaceDescriptor kInterface{
    .name = "lab.Arm", .fingerprint = 0x0123456789abcdef, .methods = kMethods};

class CountingServant final : public rpc::Servant {
 public:
  [[nodiscard]] const rpc::InterfaceDescriptor& interface() const noexcept override {
    return kInterface;
  }
  rpc::DispatchResult dispatch(std::uint16_t method_id, ConstBytes, MutableBytes reply,
                               const rpc::CallContext&) override {
    if (method_id != kCountMethod) return {wire::Status::kNoSuchMethod, 0};
    store_le<std::uint64_t>(reply.data(), ++run_count_);
    return {wire::Status::kOk, sizeof(std::uint64_t)};
  }

 private:
  std::atomic<std::uint64_t> run_count_{0};
};

/// Serves until stdin ends.
int serve(const rpc::ServerSecurity& security) {
  CountingServant servant;
  rpc::ServerConfig config;
  config.security = security;
  config.realtime = rt::RealtimeMode::kOff;
  auto server = rpc::Server::create(config);
  if (!server) {
    std::cerr << server.error().text() << '\n';
    return EXIT_FAILURE;
  }
  if (const auto added = (*server)->add("lab/arm0", servant); !added) {
    std::cerr << added.error().text() << '\n';
    return EXIT_FAILURE;
  }
  if (const auto started = (*server)->start(); !started) {
    std::cerr << started.error().text() << '\n';
    return EXIT_FAILURE;
  }
  std::cout << "127.0.0.1:" << (*server)->port() << std::endl;
  char byte = 0;
  while (::read(STDIN_FILENO, &byte, 1) > 0) {
  }
  return EXIT_SUCCESS;
}

}  // namespace
}  // namespace rtpm::spec

int main(int argc, char** argv) {
  rtpm::rpc::ServerSecurity security;
  if (argc == 3) {
    security.authorized_file = argv[1];
    security.key_file = argv[2];
  }
  return rtpm::spec::serve(security);
}
