// A server of RTPM with the grants and the key of a folder, for clients written from
// spec/security.md: its object, number 1, answers each call of method 1 with the bytes of its
// request in reverse. It prints its port, its suites and its key, and ends with its standard input.
//   secured_server FOLDER

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <string>

#include "rtpm/rpc/server.hpp"

namespace rtpm::rpc {
namespace {

constexpr std::array kMethods{MethodDescriptor{1, "reverse", 1, true, {}}};
constexpr InterfaceDescriptor kInterface{"test.Reverse", 1, "by hand", kMethods};

class Reverse final : public Servant {
 public:
  [[nodiscard]] const InterfaceDescriptor& interface() const noexcept override {
    return kInterface;
  }
  DispatchResult dispatch(std::uint16_t, ConstBytes request, MutableBytes reply,
                          const CallContext&) override {
    std::ranges::reverse_copy(request, reply.begin());
    return {wire::Status::kOk, static_cast<std::uint32_t>(request.size())};
  }
};

int serve(const std::string& folder) {
  ServerConfig config;
  config.realtime = rt::RealtimeMode::kOff;
  config.lanes.push_back({.wait = {.strategy = rt::WaitStrategy::kBlock}});
  config.security.authorized_file = folder + "/authorized";
  config.security.key_file = folder + "/key";
  Reverse reverse;
  auto server = Server::create(config);
  if (!server) {
    std::fprintf(stderr, "%s\n", server.error().text().c_str());
    return 1;
  }
  if (!(*server)->add("reverse", reverse) || !(*server)->start()) return 1;
  std::printf("%d %d ", (*server)->port(), crypto::suites_here());
  for (const std::byte byte : *(*server)->public_key())
    std::printf("%02x", std::to_integer<unsigned>(byte));
  std::printf("\n");
  std::fflush(stdout);
  char byte = 0;
  while (::read(STDIN_FILENO, &byte, 1) > 0) {
  }
  (*server)->stop();
  return 0;
}

}  // namespace
}  // namespace rtpm::rpc

int main(int argument_count, char** arguments) {
  return argument_count == 2 ? rtpm::rpc::serve(arguments[1]) : 2;
}
